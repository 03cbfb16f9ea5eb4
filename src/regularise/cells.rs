//! Step 1: 3-cells are collapsed away, thinnest wall first.
//!
//! A generator off the surface (noise) has a 3-cell. It is collapsed through the facet between the two closest generators,
//! the wall that matters least. Every 3-cell goes: a finite complex in space whose 3-cells cover no closed
//! manifold always has a 3-cell with a facet of its own.

use super::complex::Complex;
use super::queue::Queue;
use crate::fine_scaffold::complex::NONE;

pub(crate) fn remove_cells(complex: &mut Complex) {
    let fine = complex.fine;
    if fine.num_cells() == 0 {
        return;
    }
    let mut cells_of_facet = vec![[NONE; 2]; fine.num_facets()];
    for c in 0..fine.num_cells() {
        for &f in fine.facets_of_cell(c) {
            let slots = &mut cells_of_facet[f as usize];
            slots[usize::from(slots[0] != NONE)] = c as u32;
        }
    }
    let only_cell = |complex: &Complex, f: u32| {
        let mut alive = cells_of_facet[f as usize]
            .into_iter()
            .filter(|&c| c != NONE && complex.cell_alive[c as usize]);
        match (alive.next(), alive.next()) {
            (Some(c), None) => Some(c),
            _ => None,
        }
    };
    let key = |f: u32| {
        let [a, b] = fine.facet_generators[f as usize].map(|g| fine.generator_position[g.index()]);
        a.distance(b)
    };
    let mut queue = Queue::new();
    for f in 0..fine.num_facets() as u32 {
        if only_cell(complex, f).is_some() {
            queue.push(key(f), f);
        }
    }
    while let Some((_, f)) = queue.pop() {
        if !complex.facet_alive[f as usize] {
            continue;
        }
        let Some(cell) = only_cell(complex, f) else {
            continue;
        };
        complex.remove_cell(cell, f);
        for &g in fine.facets_of_cell(cell as usize) {
            if complex.facet_alive[g as usize] && only_cell(complex, g).is_some() {
                queue.push(key(g), g);
            }
        }
    }
}
