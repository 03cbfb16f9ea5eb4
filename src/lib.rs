//! Medial scaffolds of anatomical shapes.
