//! Settings of the coarse scaffold.

use serde::{Deserialize, Serialize};

/// Settings of the coarse scaffold. Factors multiply the tolerance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CoarseScaffoldSettings {
    /// Seams up to this long (or three spacings, below which there is only sampling) are shrunk to a node, so that the axial curve ends
    /// on the rib (merge A1A5). Longer ones stay curves: where a view hides the axial curve, what its seam parted is one
    /// sheet again, which a node cannot tell. Between samplings of 25 bones sheets change by 16 % in views with 1, by
    /// 20 % with 4.5.
    pub contract_seam: f64,
    /// How far from the rib it would have met an axial curve may end, the longest seam of the regularisation: ribs are drawn to nodes
    /// this near, and wires up to one and a half of it are whiskers.
    pub near_end: f64,
    /// Axial curves up to this long between two nodes are shrunk to a node (transitions A1^5 and A1^2A3-I).
    pub contract_curve: f64,
    /// Sheets of which half the extent is up to this are shrunk to a node (transition A1^5).
    pub contract_sheet: f64,
    /// Standard deviation of the Gaussian that curves are smoothed with; their ends stay.
    pub smoothing: f64,
}

impl Default for CoarseScaffoldSettings {
    fn default() -> Self {
        Self {
            contract_seam: 1.0,
            near_end: 4.5,
            contract_curve: 0.5,
            contract_sheet: 1.0,
            smoothing: 1.0,
        }
    }
}
