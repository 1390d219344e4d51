//! Memory layout of pairs of a visible pixel and an observation for the hot path: blocks of one pixel of each of
//! several cells.
//!
//! Indices of pixels and their moments are separate: stars that differ little have the same pixels in their cells.

/// Cells per block: as many as the widest registers hold in double precision.
pub const LANES: usize = 8;

/// Moments of one pixel of each cell; a cell without further pixels has one of weight 0, and so have the cells after
/// it.
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

/// A group of cells, with their pixels.
#[derive(Clone, Copy, Debug)]
pub struct Group<'a> {
    /// First node of each cell.
    pub cells: &'a [u32; LANES],
    /// Moments, ...
    pub blocks: &'a [Block],
    /// ... and indices of pixels.
    pub pixels: &'a [Pixels],
}
