//! One reader a format. Each takes the bytes of a file and gives its content in the file's own frame and units, or says what
//! is wrong and where.
//!
//! They are ours because every message must name a line or a byte and no header may be believed before it is checked against
//! the bytes that follow; the crates for these formats report neither, keep a hash map for every vertex (PLY), lose digits
//! (ASCII STL), cannot read what VTK 9 writes, or panic on damaged XML. The tests compare with those crates where they can
//! read a file.

pub(super) mod clouds;
pub(super) mod dicom_seg;
pub(super) mod gifti;
pub(super) mod medit;
pub(super) mod metaimage;
pub(super) mod nifti;
pub(super) mod nrrd;
pub(super) mod obj;
pub(super) mod off;
pub(super) mod ply;
pub(super) mod stl;
pub(super) mod volume;
pub(super) mod vtk_legacy;
pub(super) mod vtp;
