//! Writes every bone as PLY into a directory and prints its size, to be looked at.
//!
//! `cargo run --release -p datasets-synthetic --example gallery -- OUT [SEED]`

use datasets_synthetic::{bones, ply};
use std::fs::{File, create_dir_all};
use std::io::BufWriter;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let directory = arguments.next().unwrap_or_else(|| "gallery".to_string());
    let seed: u64 = arguments.next().map_or(Ok(0), |s| s.parse())?;
    create_dir_all(&directory)?;
    for shape in bones::all(seed) {
        let start = std::time::Instant::now();
        let mesh = shape.mesh(20_000);
        let seconds = start.elapsed().as_secs_f64();
        let b = mesh.bounds();
        println!(
            "{:12} size {:5.2} mm  centre {:5.2} mm  {} triangles  volume {:.0} mm3  {seconds:.2} s",
            shape.name,
            b.size(),
            b.centre(),
            mesh.triangles.len(),
            mesh.volume()
        );
        let mut file = BufWriter::new(File::create(format!("{directory}/{}.ply", shape.name))?);
        ply::write_mesh(&mut file, &mesh)?;
    }
    Ok(())
}
