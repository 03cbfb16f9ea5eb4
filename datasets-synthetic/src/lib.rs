//! Synthetic shapes with exact ground truth.
