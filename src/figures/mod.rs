//! Figures of what a folder holds, from its files alone: nothing here computes a map or a chain.
//!
//! [`drawing`] has shapes, axes and colours and writes SVG and PNG; [`plot`] reads a folder and draws it; [`report`]
//! makes a page of it.

pub mod drawing;
pub mod plot;
pub mod report;
