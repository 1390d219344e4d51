//! Priors of single parameters (to be written).
