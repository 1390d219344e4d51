//! Pairs of a visible pixel and an observation as the hot path reads them: a pixel of each of several cells side by
//! side.
//!
//! Which pixels they are, and what is seen of them, are kept apart: stars that differ little have the same pixels in
//! their cells.

/// Cells side by side: as many as the widest registers hold in double precision.
pub const LANES: usize = 8;

/// What is seen of a pixel of each cell; a cell that has no pixel left has one of weight 0, and the cells after it have
/// none either.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(32))]
pub struct Block {
    /// Projected area times limb darkening.
    pub weight: [f32; LANES],
    /// Distance of the mean velocity from the middle of the cell over the grid's step.
    pub position: [f32; LANES],
    /// Variance of the velocity over twice the squared step.
    pub spread: [f32; LANES],
}

/// Index of a pixel of each cell.
pub type Pixels = [u32; LANES];

/// Cells side by side, with their pixels.
#[derive(Clone, Copy, Debug)]
pub struct Group<'a> {
    /// First node of each cell.
    pub cells: &'a [u32; LANES],
    /// What is seen, ...
    pub blocks: &'a [Block],
    /// ... and of which pixels.
    pub pixels: &'a [Pixels],
}
