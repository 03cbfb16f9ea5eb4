//! Regularise: homotopy-preserving simplification, cheapest first.
