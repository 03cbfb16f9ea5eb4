//! The medial command.
fn main() {}
