//! Pairs of a visible pixel and an observation as the hot path reads them: a pixel of each of several cells side by side.
//!
//! Left out: what is made of them (`kernel`), which stand side by side (`placement`).

/// Cells side by side: as many as the widest registers hold in double precision.
pub const LANES: usize = 8;

/// A visible pixel of each cell; a cell that has no pixel left has one of weight 0, and the cells after it have none either.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub struct Block {
    /// Projected area times limb darkening.
    pub weight: [f32; LANES],
    /// Distance of the mean velocity from the middle of the cell over the grid's step.
    pub position: [f32; LANES],
    /// Variance of the velocity over twice the squared step.
    pub spread: [f32; LANES],
    /// Index of the pixel.
    pub pixel: [u32; LANES],
}

/// A lane of a block.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(16))]
pub struct Pixel {
    /// As in a block.
    pub weight: f32,
    /// As in a block.
    pub position: f32,
    /// As in a block.
    pub spread: f32,
    /// As in a block.
    pub pixel: u32,
}

impl Block {
    /// Of a pixel for each lane.
    #[inline(always)]
    pub fn of(pixels: [&Pixel; LANES]) -> Self {
        #[cfg(target_arch = "x86_64")]
        return sse::block_of(pixels);
        #[cfg(not(target_arch = "x86_64"))]
        Block {
            weight: pixels.map(|p| p.weight),
            position: pixels.map(|p| p.position),
            spread: pixels.map(|p| p.spread),
            pixel: pixels.map(|p| p.pixel),
        }
    }

    /// Copies the pixel of every lane to a place of its own.
    ///
    /// # Safety
    /// Every place lies within `to`.
    #[inline(always)]
    #[allow(unsafe_code)]
    pub unsafe fn deal(&self, places: [usize; LANES], to: &mut [Pixel]) {
        debug_assert!(places.iter().all(|place| *place < to.len()));
        // safe: the caller knows the places
        #[cfg(target_arch = "x86_64")]
        unsafe {
            sse::deal(self, places, to);
        }
        #[cfg(not(target_arch = "x86_64"))]
        for (lane, place) in places.into_iter().enumerate() {
            let (weight, position) = (self.weight[lane], self.position[lane]);
            to[place] = Pixel { weight, position, spread: self.spread[lane], pixel: self.pixel[lane] };
        }
    }
}

/// Blocks of pixels and pixels of blocks in registers; the compiler takes one number after another through memory.
#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)]
mod sse {
    use super::{Block, LANES, Pixel};
    use std::arch::x86_64::*;
    use std::mem::transmute;

    /// What a block has of each number, in two halves.
    type Rows = [[__m128; 2]; 4];

    #[inline(always)]
    pub(super) fn block_of(pixels: [&Pixel; LANES]) -> Block {
        // safe: a pixel is four numbers of four bytes, a row of a block twice as many
        let four = |first: usize| {
            let pixels = [0, 1, 2, 3].map(|lane| unsafe { transmute::<Pixel, __m128>(*pixels[first + lane]) });
            transposed(pixels)
        };
        let (low, high) = (four(0), four(LANES / 2));
        unsafe { transmute::<Rows, Block>([0, 1, 2, 3].map(|row| [low[row], high[row]])) }
    }

    /// # Safety
    /// As that of the block.
    #[inline(always)]
    pub(super) unsafe fn deal(block: &Block, places: [usize; LANES], to: &mut [Pixel]) {
        // safe: as above
        let rows = unsafe { transmute::<Block, Rows>(*block) };
        for (half, places) in places.chunks(LANES / 2).enumerate() {
            let lanes = transposed(rows.map(|row| row[half]));
            for (place, lane) in places.iter().zip(lanes) {
                // safe: as above, and the caller knows the places
                unsafe { *to.get_unchecked_mut(*place) = transmute::<__m128, Pixel>(lane) };
            }
        }
    }

    /// Rows as columns.
    #[inline(always)]
    fn transposed([a, b, c, d]: [__m128; 4]) -> [__m128; 4] {
        // safe: every processor of this kind has these instructions
        unsafe {
            let (low, low_2) = (_mm_unpacklo_ps(a, b), _mm_unpacklo_ps(c, d));
            let (high, high_2) = (_mm_unpackhi_ps(a, b), _mm_unpackhi_ps(c, d));
            [
                _mm_movelh_ps(low, low_2),
                _mm_movehl_ps(low_2, low),
                _mm_movelh_ps(high, high_2),
                _mm_movehl_ps(high_2, high),
            ]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_dealt_and_collected() {
        let row = |first: usize| std::array::from_fn(|lane| (first + lane) as f32 * 0.37);
        let pixel = std::array::from_fn(|lane| 40 + lane as u32);
        let block = Block { weight: row(0), position: row(10), spread: row(20), pixel };
        let places = [4, 1, 8, 2, 11, 0, 6, 9];
        let mut pixels = [Pixel::default(); 12];
        // safe: there are twelve
        #[allow(unsafe_code)]
        unsafe {
            block.deal(places, &mut pixels);
        }
        for (lane, place) in places.into_iter().enumerate() {
            let (weight, position) = (block.weight[lane], block.position[lane]);
            let expected = Pixel { weight, position, spread: block.spread[lane], pixel: block.pixel[lane] };
            assert_eq!(pixels[place], expected);
        }
        let again = Block::of(places.map(|place| &pixels[place]));
        assert_eq!(format!("{again:?}"), format!("{block:?}"));
    }
}
