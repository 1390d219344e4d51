//! Figures of the results in a folder, from its files alone: nothing here computes a map or a chain.
//!
//! [`drawing`] has shapes, axes and colours and writes SVG and PNG; [`plot`] reads a folder and draws it; [`report`]
//! makes a page of it, and [`printed`](printed::printed) is the text output of its command. A new figure is a file of
//! `plot` and a line in `plot/mod.rs`, where `KINDS` assigns figures to files.

pub mod drawing;
pub mod plot;
pub mod printed;
pub mod report;
