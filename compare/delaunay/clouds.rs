//! Writes a cloud for the race: `delaunay-clouds KIND N FILE`, little-endian `f64` triples.

#[path = "../../tests/support/clouds.rs"]
mod clouds;

use std::{env, error::Error, fs, io::Write};

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = env::args().collect();
    let [_, kind, n, file] = args.as_slice() else {
        return Err("usage: delaunay-clouds cube|ellipsoid|bone|sphere|grid N FILE".into());
    };
    if !clouds::KINDS.contains(&kind.as_str()) {
        return Err(format!("unknown kind of cloud: {kind}").into());
    }
    let points = clouds::cloud(kind, n.parse()?);
    let mut out = std::io::BufWriter::new(fs::File::create(file)?);
    for v in points.iter().flat_map(|p| p.to_array()) {
        out.write_all(&v.to_le_bytes())?;
    }
    out.flush()?;
    Ok(())
}
