//! The fine scaffold against solids of known topology, and its incidence against itself.

use datasets_synthetic::shapes;
use glam::DVec3;
use medial_scaffold::fine_scaffold::{
    Betti, FineScaffold, FineScaffoldError, FineScaffoldSettings, Side, fine_scaffold, mesh_betti,
    solid_betti,
};
use medial_scaffold::geometry::TriangleMesh;
use medial_scaffold::segregation::{
    KnownSurfaceSettings, RefinedSegregation, Segregation, segregate_known_refined,
};

fn segregated(shape: &shapes::Shape, n: usize) -> (TriangleMesh, RefinedSegregation) {
    let mesh = shape.mesh(20_000);
    let surface = TriangleMesh {
        points: mesh.points,
        triangles: mesh.triangles,
    };
    let points = shape.sample_poisson(n, 1).points;
    let refined = segregate_known_refined(&points, &surface, &KnownSurfaceSettings::default())
        .expect("a closed surface");
    (surface, refined)
}

fn fine(refined: &RefinedSegregation, side: Side) -> FineScaffold {
    let settings = FineScaffoldSettings { side };
    fine_scaffold(&refined.triangulation, &refined.result.segregation, &settings).expect("an inside")
}

#[test]
fn betti_numbers_are_the_solids_by_three_routes() {
    let cavities = [
        (DVec3::new(0.5, 0.0, 0.0), 0.3),
        (DVec3::new(-0.5, 0.0, 0.0), 0.25),
    ];
    for shape in [
        shapes::sphere(1.0),
        shapes::torus(1.0, 0.3),
        shapes::genus_five(),
        shapes::hollow_sphere(1.0, 0.6),
        shapes::ball_with_cavities(1.0, &cavities),
        shapes::l_block(2.0, 0.8, 0.5),
    ] {
        let (surface, refined) = segregated(&shape, 4000);
        let truth = shape.truth.solid_betti.expect("a solid").map(i64::from);
        let found = fine(&refined, Side::Interior).betti();
        assert_eq!(found, Betti::from(truth));
        assert_eq!(
            found,
            solid_betti(
                &refined.triangulation,
                &refined.result.segregation,
                Side::Interior
            )
            .expect("labels of this triangulation")
        );
        assert_eq!(Some(found), mesh_betti(&surface));
    }
}

#[test]
fn incidence_agrees_with_itself_and_radii_with_generators() {
    let (_, refined) = segregated(&shapes::torus(1.0, 0.3), 3000);
    let s = fine(&refined, Side::Interior);
    for f in 0..s.num_facets() {
        let (vertices, edges) = (s.facet_vertices(f), s.facet_edges(f));
        let [a, b] = s.facet_generators[f];
        assert!(a < b && edges.len() >= 3);
        for k in 0..edges.len() {
            let mut ends = [vertices[k], vertices[(k + 1) % vertices.len()]];
            ends.sort_unstable();
            assert_eq!(s.edge_vertices[edges[k] as usize], ends);
            assert!(s.facets_of_edge(edges[k] as usize).contains(&(f as u32)));
            assert!(s.edge_generators[edges[k] as usize].contains(&a));
            assert!(s.edge_generators[edges[k] as usize].contains(&b));
            let v = vertices[k] as usize;
            let reach = s.vertex_position[v].distance(s.generator_position[a.index()]);
            assert!((reach - s.vertex_radius[v]).abs() < 1e-6 * s.scale.diagonal_mm);
        }
    }
    let total: usize = (0..s.num_edges()).map(|e| s.facets_of_edge(e).len()).sum();
    assert_eq!(total, s.ring_edges.len());
}

#[test]
fn the_volumes_of_the_generators_add_up_to_the_solid() {
    let shape = shapes::ellipsoid(1.0, 0.7, 0.4);
    let (_, refined) = segregated(&shape, 8000);
    let volume = fine(&refined, Side::Interior).solid_volume_mm3();
    let exact = shape.truth.volume_mm3.expect("closed form");
    assert!((volume / exact - 1.0).abs() < 0.005, "{volume} {exact}");
}

#[test]
fn the_exterior_of_a_torus_has_a_hole_filled_by_its_hull_side() {
    let (_, refined) = segregated(&shapes::torus(1.0, 0.3), 3000);
    let outside = fine(&refined, Side::Exterior);
    assert_eq!(
        outside.betti(),
        solid_betti(
            &refined.triangulation,
            &refined.result.segregation,
            Side::Exterior
        )
        .expect("labels of this triangulation")
    );
}

#[test]
fn wrong_labels_are_refused() {
    let (_, refined) = segregated(&shapes::sphere(1.0), 500);
    let t = &refined.triangulation;
    let settings = FineScaffoldSettings::default();
    let none = Segregation::default();
    assert_eq!(
        fine_scaffold(t, &none, &settings).err(),
        Some(FineScaffoldError::Open)
    );
    let short = Segregation {
        inside: vec![true],
        ..Segregation::default()
    };
    assert!(matches!(
        fine_scaffold(t, &short, &settings),
        Err(FineScaffoldError::Labels { labels: 1, .. })
    ));
    let empty = Segregation {
        inside: vec![false; t.num_tets()],
        ..Segregation::default()
    };
    assert!(matches!(
        fine_scaffold(t, &empty, &settings),
        Err(FineScaffoldError::Empty { .. })
    ));
}
