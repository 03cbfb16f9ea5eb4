//! Which samples of a surface lie outside: those that a ball rolling over the shape from outside comes near.
//!
//! In: a view. Out: a flag a sample.
//!
//! A segmented bone may bring a second surface within the first: marrow that was left out, joined to the outer surface by pores. Its
//! shape as others know it is the outer surface, and the inner one makes half of its samples, so that no bone is like it.
//!
//! 1. Cells of a box round the shape whose nearest sample is farther than a ball's radius can hold its centre.
//! 2. Those that hang together with the corner of the box are reached from outside.
//! 3. A sample is outside when such a cell lies within the radius and a cell's diagonal of it.
//!
//! Pores narrower than the ball are closed; so are grooves, whose bottoms go, in all shapes alike. Cost: `O(cells)`.

use super::oriented::View;
use glam::{DVec3, IVec3};

/// Radius of the ball, in units.
const BALL: f64 = 0.06;
/// Edge of a cell, in units.
const CELL: f64 = 0.03;
/// Empty space round the shape, in units; within what the view's own table covers.
const MARGIN: f64 = 0.15;

/// For every sample whether it lies outside.
pub(crate) fn outer_samples(view: &View) -> Vec<bool> {
    let Some([low, high]) = crate::geometry::mesh::bounds(&view.points) else {
        return Vec::new();
    };
    let origin = low - MARGIN;
    let size = ((high - low + 2.0 * MARGIN) / CELL).ceil().as_ivec3();
    let slot = |c: IVec3| ((c.z * size.y + c.y) * size.x + c.x) as usize;
    let centre = |c: IVec3| origin + (c.as_dvec3() + 0.5) * CELL;
    let mut free = vec![false; slot(size - 1) + 1];
    for z in 0..size.z {
        for y in 0..size.y {
            for x in 0..size.x {
                let (c, q) = (IVec3::new(x, y, z), centre(IVec3::new(x, y, z)));
                let near = view.grid.nearest(q).map(|i| view.points[i].distance(q));
                free[slot(c)] = near.is_none_or(|d| d > BALL);
            }
        }
    }
    let mut reached = vec![false; free.len()];
    let mut open = vec![IVec3::ZERO];
    reached[0] = true;
    let steps = [IVec3::X, IVec3::Y, IVec3::Z];
    while let Some(c) = open.pop() {
        for next in steps.iter().flat_map(|s| [c + *s, c - *s]) {
            let inside = next.cmpge(IVec3::ZERO).all() && next.cmplt(size).all();
            if inside && free[slot(next)] && !reached[slot(next)] {
                reached[slot(next)] = true;
                open.push(next);
            }
        }
    }
    let reach = BALL + CELL * 3f64.sqrt();
    let span = (reach / CELL).ceil() as i32;
    let near = |p: &DVec3| {
        let c = ((*p - origin) / CELL).floor().as_ivec3();
        let all = (-span..=span).flat_map(|x| (-span..=span).map(move |y| (x, y)));
        all.flat_map(|(x, y)| (-span..=span).map(move |z| c + IVec3::new(x, y, z)))
            .filter(|n| n.cmpge(IVec3::ZERO).all() && n.cmplt(size).all())
            .any(|n| reached[slot(n)] && centre(n).distance(*p) < reach)
    };
    view.points.iter().map(near).collect()
}
