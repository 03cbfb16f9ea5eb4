//! Which hand and which face of the shapes are laid on each other.
//!
//! In: two views and whether the source may be mirrored. Out: the pairs of views that compete.
//!
//! A cloud that is nearly flat and open does not say which of its faces is outside: a plate seen from its hollow side has its
//! normals turned to the wrong side by any rule that asks the cloud alone, and then fits the other wall upside down. So such a
//! sheet takes part twice, once with its normals turned, and the search decides. Of two sheets one is enough: only
//! whether their faces agree matters. The same for the two hands.

use super::oriented::View;
use super::settings::Mirror;
use std::sync::Arc;

/// Mean of the normals of an open surface above which it is a sheet. A quarter of a sphere has 0.75, an eighth 0.88.
const SHEET: f64 = 0.85;

/// A source and a target as they are laid on each other.
pub(crate) struct ViewPair {
    pub(crate) source: Arc<View>,
    pub(crate) target: Arc<View>,
}

/// The pairs of views that compete; the first is the shapes as they are, or mirrored if they must be.
pub(crate) fn pairs(target: View, source: View, mirror: Mirror) -> Vec<ViewPair> {
    let (source_is_sheet, target_is_sheet) = (is_sheet(&source), is_sheet(&target));
    let mut sources = match mirror {
        Mirror::No => vec![source],
        Mirror::Yes => vec![source.mirror_image()],
        Mirror::Auto => {
            let image = source.mirror_image();
            vec![source, image]
        }
    };
    let mut targets = vec![target];
    if source_is_sheet {
        let turned: Vec<View> = sources.iter().map(View::turned).collect();
        sources.extend(turned);
    } else if target_is_sheet {
        let turned = targets[0].turned();
        targets.push(turned);
    }
    let sources: Vec<Arc<View>> = sources.into_iter().map(Arc::new).collect();
    let mut out = Vec::new();
    for target in targets.into_iter().map(Arc::new) {
        out.extend(sources.iter().map(|source| ViewPair {
            source: Arc::clone(source),
            target: Arc::clone(&target),
        }));
    }
    out
}

fn is_sheet(view: &View) -> bool {
    let mean = view.normals.iter().copied().sum::<glam::DVec3>() / view.normals.len().max(1) as f64;
    !view.closed && mean.length() > SHEET
}
