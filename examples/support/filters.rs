//! Filters that decide facet by facet, to compare with: the separation angle (Foskey, Lin & Manocha, "Efficient computation of a
//! simplified medial axis", 2003) and lambda (Chazal & Lieutier, "The lambda-medial axis", 2005). Neither is part of the library: they say
//! nothing of sheets as wholes and do not keep the topology.

use glam::DVec3;
use medial_scaffold::fine_scaffold::{Betti, FineScaffold};
use medial_scaffold::geometry::TriangleMesh;
use medial_scaffold::geometry::mesh::DisjointSets;

/// What a facet must have to stay.
#[derive(Clone, Copy, Debug)]
pub enum Filter {
    /// Angle at the facet between its two generators, degrees.
    Angle(f64),
    /// Half the distance between its two generators, % of the diagonal: the radius of the smallest ball that holds both.
    Lambda(f64),
}

/// What a filter left.
pub struct Filtered {
    /// Axial curves and sheets.
    pub counts: [usize; 2],
    /// Betti numbers of the facets and their faces.
    pub betti: Betti,
    /// The facets as one mesh.
    pub surface: TriangleMesh,
}

/// The facets that pass a filter, with their faces, counted as a scaffold is.
pub fn filtered(fine: &FineScaffold, filter: Filter) -> Filtered {
    let keep: Vec<bool> = (0..fine.num_facets()).map(|f| passes(fine, f, filter)).collect();
    let mut edge_count = vec![0u8; fine.num_edges()];
    let mut vertex_alive = vec![false; fine.num_vertices()];
    for f in (0..fine.num_facets()).filter(|&f| keep[f]) {
        for &e in fine.facet_edges(f) {
            edge_count[e as usize] += 1;
        }
        for &v in fine.facet_vertices(f) {
            vertex_alive[v as usize] = true;
        }
    }
    let edge_alive: Vec<bool> = edge_count.iter().map(|&c| c > 0).collect();
    let no_cells = vec![false; fine.num_cells()];
    Filtered {
        counts: [axial_curves(fine, &edge_count), sheets(fine, &keep, &edge_count)],
        betti: fine.betti_of(&vertex_alive, &edge_alive, &keep, &no_cells),
        surface: surface(fine, &keep),
    }
}

fn passes(fine: &FineScaffold, facet: usize, filter: Filter) -> bool {
    let [a, b] = fine.facet_generators[facet].map(|g| fine.generator_position[g.index()]);
    match filter {
        Filter::Lambda(percent) => 0.5 * a.distance(b) >= 0.01 * percent * fine.scale.diagonal_mm,
        Filter::Angle(degrees) => {
            let ring = fine.facet_vertices(facet);
            let centre: DVec3 = ring
                .iter()
                .map(|&v| fine.vertex_position[v as usize])
                .sum::<DVec3>()
                / ring.len() as f64;
            (a - centre).angle_between(b - centre).to_degrees() >= degrees
        }
    }
}

fn sheets(fine: &FineScaffold, keep: &[bool], edge_count: &[u8]) -> usize {
    let mut sets = DisjointSets::new(fine.num_facets());
    let mut count = keep.iter().filter(|k| **k).count();
    for e in (0..fine.num_edges()).filter(|&e| edge_count[e] == 2) {
        let mut own = fine.facets_of_edge(e).iter().filter(|&&f| keep[f as usize]);
        if let (Some(&a), Some(&b)) = (own.next(), own.next()) {
            count -= usize::from(sets.union(a, b));
        }
    }
    count
}

/// Chains of edges with three facets, joined where just two of them meet.
fn axial_curves(fine: &FineScaffold, edge_count: &[u8]) -> usize {
    let edges: Vec<usize> = (0..fine.num_edges()).filter(|&e| edge_count[e] >= 3).collect();
    let mut at = vec![Vec::new(); fine.num_vertices()];
    for (i, &e) in edges.iter().enumerate() {
        for v in fine.edge_vertices[e] {
            at[v as usize].push(i as u32);
        }
    }
    let mut sets = DisjointSets::new(edges.len());
    let mut count = edges.len();
    for own in at {
        if let [a, b] = own[..] {
            count -= usize::from(sets.union(a, b));
        }
    }
    count
}

fn surface(fine: &FineScaffold, keep: &[bool]) -> TriangleMesh {
    TriangleMesh {
        points: fine.vertex_position.clone(),
        triangles: (0..fine.num_facets())
            .filter(|&f| keep[f])
            .flat_map(|f| {
                let ring = fine.facet_vertices(f);
                (1..ring.len() - 1).map(|k| [ring[0], ring[k], ring[k + 1]])
            })
            .collect(),
    }
}
