//! The scaffold of a box, whose medial axis is derived by hand: 13 sheets, 12 axial curves, 12 ribs, 12 nodes.
//!
//! `cargo run --release --example 01_scaffold_of_a_box`

use datasets_synthetic::shapes;
use medial_scaffold::geometry::TriangleMesh;
use medial_scaffold::input::{Geometry, Shape};
use medial_scaffold::pipeline::{ScaffoldSettings, scaffold};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let made = shapes::box_shape(10.0, 14.0, 20.0).mesh(5_000);
    let mesh = TriangleMesh {
        points: made.points,
        triangles: made.triangles,
    };
    let shape = Shape::generated("box", Geometry::Mesh(mesh));
    let done = scaffold(&shape, &ScaffoldSettings::default(), &|stage| {
        println!("{stage} ...");
    })?;
    let document = done.document();
    println!(
        "{:#?}\n{:#?}\n{:#?}",
        document.counts, document.topology, document.fidelity
    );
    if !document.topology.agree {
        return Err("the Betti numbers of solid and scaffold differ".into());
    }
    Ok(())
}
