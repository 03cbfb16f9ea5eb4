//! Ids: `u32` newtypes, so that a vertex can never be mistaken for a tetrahedron.

use serde::{Deserialize, Serialize};

macro_rules! id {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        #[serde(transparent)]
        pub struct $name(pub u32);

        impl $name {
            /// The id as an index into the array of its kind.
            #[inline]
            pub fn index(self) -> usize {
                self.0 as usize
            }

            /// The id of the element at `index`; ids end at `u32::MAX - 1`, which every stage checks at its door.
            #[inline]
            pub fn from_index(index: usize) -> Self {
                debug_assert!(index < u32::MAX as usize);
                Self(index as u32)
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                self.0.fmt(f)
            }
        }
    };
}

id!(
    /// A generator: a distinct input point, a vertex of the Delaunay triangulation.
    VertexId
);
id!(
    /// A tetrahedron of the Delaunay triangulation, finite or ghost; dual to a vertex (A1^4) of the full scaffold.
    TetId
);
id!(
    /// A node of the coarse scaffold.
    NodeId
);
id!(
    /// A curve of the coarse scaffold: axial, rib, wire or seam.
    CurveId
);
id!(
    /// A sheet of the coarse scaffold.
    SheetId
);
