//! Cell of the velocity grid, and position in it, of every visible pixel of every observation: the pairs in the order
//! of the hot path.

use super::block::{Block, Group, LANES, Pixels};
use std::cell::Cell;
use std::sync::Arc;

/// The visible pixels of all observations, and perhaps nearly visible ones of weight 0.
#[derive(Clone, Debug)]
pub struct Placement {
    arrangement: Arc<Arrangement>,
    blocks: Vec<Block>,
}

/// Arrangement of the pixels.
#[derive(Debug)]
pub struct Arrangement {
    /// Number of (pixel, observation) pairs.
    pub pairs: usize,
    /// Groups of cells, equally many for each observation.
    pub groups: Vec<Cells>,
    /// Groups of an observation.
    pub groups_each: usize,
    /// Pixels of every block.
    pub pixels: Vec<Pixels>,
}

/// A group of cells, those with most pixels first; or a single cell, whose pixels are distributed over all lanes.
#[derive(Clone, Copy, Debug)]
pub struct Cells {
    /// First node of each cell.
    pub first_nodes: [u32; LANES],
    /// First of the group's blocks, and the end.
    pub blocks: [u32; 2],
}

impl Cells {
    /// Number of blocks.
    pub fn rows(&self) -> usize {
        (self.blocks[1] - self.blocks[0]) as usize
    }
}

/// The cells of a grid of velocities, in units of its steps.
#[derive(Clone, Copy, Debug)]
pub struct Scale {
    /// Velocity of the first node.
    pub first_node: f64,
    /// Cells that can contain a pixel.
    pub cells: usize,
}

/// Nodes of a cell before the one at its lower border.
const NODES_BEFORE: f64 = 2.0;

impl Scale {
    /// Velocity in the middle of the first cell.
    pub fn first_middle(&self) -> f32 {
        (self.first_node + NODES_BEFORE + 0.5) as f32
    }
}

thread_local! {
    /// Memory reused by a thread. For a large map, tens of megabytes, new memory arrives page by page, which takes
    /// three times as long as filling it.
    static SPARE_BLOCKS: Cell<Vec<Block>> = const { Cell::new(Vec::new()) };
    static SPARE_PIXELS: Cell<Vec<Pixels>> = const { Cell::new(Vec::new()) };
}

/// Memory for blocks, with arbitrary content.
pub fn spare_blocks() -> Vec<Block> {
    SPARE_BLOCKS.take()
}

/// Memory for pixels, with arbitrary content.
pub fn spare_pixels() -> Vec<Pixels> {
    SPARE_PIXELS.take()
}

fn give_back<T>(spare: &'static std::thread::LocalKey<Cell<Vec<T>>>, memory: &mut Vec<T>) {
    // at the end of a thread its spare memory may be gone
    let _ = spare.try_with(|spare| {
        let (a, b) = (spare.take(), std::mem::take(memory));
        spare.set(if a.capacity() > b.capacity() { a } else { b });
    });
}

impl Drop for Placement {
    fn drop(&mut self) {
        give_back(&SPARE_BLOCKS, &mut self.blocks);
    }
}

impl Drop for Arrangement {
    fn drop(&mut self) {
        give_back(&SPARE_PIXELS, &mut self.pixels);
    }
}

impl Placement {
    /// Moments of the pixels of an arrangement, block by block.
    pub fn new(arrangement: Arc<Arrangement>, blocks: Vec<Block>) -> Self {
        assert!(blocks.len() == arrangement.pixels.len());
        Placement { arrangement, blocks }
    }

    /// Number of (pixel, observation) pairs.
    pub fn pairs(&self) -> usize {
        self.arrangement.pairs
    }

    /// Arrangement of the pixels.
    pub fn arrangement(&self) -> &Arc<Arrangement> {
        &self.arrangement
    }

    /// The groups of an observation; a cell is counted by the first of its nodes.
    pub fn groups_of(&self, observation: usize) -> impl Iterator<Item = Group<'_>> {
        let Arrangement { groups, groups_each, pixels, .. } = &*self.arrangement;
        groups[observation * groups_each..][..*groups_each].iter().map(|cells| {
            let rows = cells.blocks[0] as usize..cells.blocks[1] as usize;
            Group { cells: &cells.first_nodes, blocks: &self.blocks[rows.clone()], pixels: &pixels[rows] }
        })
    }

    /// Memory (bytes) of all blocks, pixels and groups.
    pub fn bytes(&self) -> usize {
        let Arrangement { groups, pixels, .. } = &*self.arrangement;
        pixels.len() * (size_of::<Block>() + size_of::<Pixels>()) + size_of_val(groups.as_slice())
    }
}
