//! Attributed hypergraph matching.
