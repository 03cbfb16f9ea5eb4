//! Why a pipeline stopped: the stage, and what it said.

use crate::change::ChangeError;
use crate::delaunay::DelaunayError;
use crate::fine_scaffold::FineScaffoldError;
use crate::input::sampling::SamplingError;
use crate::registration::RegistrationError;
use crate::regularise::RegulariseError;
use crate::segregation::SegregationError;
use thiserror::Error;

/// The error of a stage, with the name of the shape it stopped at.
#[derive(Debug, Error)]
#[error("{shape}: {source}")]
pub struct PipelineError {
    /// Name or path of the shape.
    pub shape: String,
    /// What the stage said.
    #[source]
    pub source: Box<StageError>,
}

/// The error of one stage.
#[derive(Debug, Error)]
#[allow(missing_docs)]
pub enum StageError {
    #[error(transparent)]
    Sampling(#[from] SamplingError),
    #[error(transparent)]
    Delaunay(#[from] DelaunayError),
    #[error(transparent)]
    Segregation(#[from] SegregationError),
    #[error(transparent)]
    FineScaffold(#[from] FineScaffoldError),
    #[error(transparent)]
    Regularise(#[from] RegulariseError),
    #[error(transparent)]
    Change(#[from] ChangeError),
    #[error("{name}: a point cloud cannot be aligned on; give a mesh, or a mask")]
    Structure { name: String },
    #[error(transparent)]
    Registration(#[from] RegistrationError),
}

impl StageError {
    /// Names the shape.
    pub fn of(self, shape: &str) -> PipelineError {
        PipelineError {
            shape: shape.to_owned(),
            source: Box::new(self),
        }
    }
}
