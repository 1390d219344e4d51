//! Vectors of numbers in the registers of each set of instructions, in double or single precision.
//!
//! Those of every processor are here.

#[cfg(target_arch = "x86_64")]
mod x86;

use super::{Instructions, Portable, sealed::Sealed};
use std::ops::{Add, Mul, Sub};

/// A number in one of two precisions.
pub trait Number:
    Copy + Default + PartialEq + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Into<f64> + Sealed
{
    /// Whether it has single precision.
    const SINGLE: bool;

    /// Registers of such numbers.
    type Of<I: Instructions>: Scattered<Number = Self>;

    /// The registers that a set of instructions has for them.
    fn registers<I: Instructions>(instructions: I) -> Self::Of<I>;

    /// The nearest number.
    fn of(x: f64) -> Self;

    /// `a b + c`, fused where the processor can.
    fn multiply_add(instructions: impl Instructions, a: Self, b: Self, c: Self) -> Self;
}

/// Arithmetic on vectors of numbers; a value of it proves that the processor has the instructions.
pub trait Registers: Copy + Sealed {
    /// The type of a lane.
    type Number: Number;

    /// A vector of numbers in a register.
    type Lanes: Copy;

    /// How many of them.
    const LANES: usize;

    /// One number in every lane.
    fn splat(self, x: Self::Number) -> Self::Lanes;

    /// The numbers from entry `first` on.
    fn load(self, from: &[f32], first: usize) -> Self::Lanes;

    /// Stores numbers there.
    fn store(self, x: Self::Lanes, to: &mut [Self::Number], first: usize);

    /// `a + b`.
    fn add(self, a: Self::Lanes, b: Self::Lanes) -> Self::Lanes;

    /// `a - b`.
    fn subtract(self, a: Self::Lanes, b: Self::Lanes) -> Self::Lanes;

    /// `a b`.
    fn multiply(self, a: Self::Lanes, b: Self::Lanes) -> Self::Lanes;

    /// `a b + c`, fused where the processor can.
    fn multiply_add(self, a: Self::Lanes, b: Self::Lanes, c: Self::Lanes) -> Self::Lanes;
}

/// Registers whose lanes lie anywhere in memory.
pub trait Scattered: Registers {
    /// The sum over the lanes.
    fn total(self, x: Self::Lanes) -> f64;

    /// The numbers at the places listed from entry `first` on.
    ///
    /// # Safety
    /// The places lie within `from`.
    #[allow(unsafe_code)]
    unsafe fn pick(self, from: &[Self::Number], places: &[u32], first: usize) -> Self::Lanes;

    /// Stores numbers where [`Scattered::pick`] reads them, the first lane last: where two lanes share a place, the
    /// first wins.
    ///
    /// # Safety
    /// The places lie within `to`.
    #[allow(unsafe_code)]
    unsafe fn put(self, x: Self::Lanes, to: &mut [Self::Number], places: &[u32], first: usize);
}

/// Registers for double precision of a set of instructions.
#[derive(Clone, Copy, Debug)]
pub struct Doubles<I>(I);

/// Registers for single precision of a set of instructions.
#[derive(Clone, Copy, Debug)]
pub struct Singles<I>(I);

impl Number for f64 {
    const SINGLE: bool = false;
    type Of<I: Instructions> = I::Doubles;

    #[inline(always)]
    fn registers<I: Instructions>(instructions: I) -> I::Doubles {
        instructions.doubles()
    }

    #[inline(always)]
    fn of(x: f64) -> f64 {
        x
    }

    #[inline(always)]
    fn multiply_add(instructions: impl Instructions, a: f64, b: f64, c: f64) -> f64 {
        instructions.multiply_add(a, b, c)
    }
}

impl Number for f32 {
    const SINGLE: bool = true;
    type Of<I: Instructions> = I::Singles;

    #[inline(always)]
    fn registers<I: Instructions>(instructions: I) -> I::Singles {
        instructions.singles()
    }

    #[inline(always)]
    fn of(x: f64) -> f32 {
        x as f32
    }

    #[inline(always)]
    fn multiply_add(instructions: impl Instructions, a: f32, b: f32, c: f32) -> f32 {
        instructions.multiply_add_single(a, b, c)
    }
}

impl Instructions for Portable {
    type Doubles = Doubles<Portable>;
    type Singles = Singles<Portable>;
    type Broad = Singles<Portable>;

    #[inline(always)]
    fn doubles(self) -> Self::Doubles {
        Doubles(self)
    }

    #[inline(always)]
    fn singles(self) -> Self::Singles {
        Singles(self)
    }

    #[inline(always)]
    fn broad(self) -> Self::Broad {
        Singles(self)
    }

    #[inline(always)]
    fn load_whole(self, from: &[i16], first: usize) -> [f32; 4] {
        let numbers: &[i16; 4] = from[first..].first_chunk().expect("as many numbers");
        numbers.map(f32::from)
    }

    #[inline(always)]
    fn load_bytes(self, from: &[i8], first: usize) -> [f32; 4] {
        let numbers: &[i8; 4] = from[first..].first_chunk().expect("as many numbers");
        numbers.map(f32::from)
    }

    #[inline(always)]
    fn multiply_add(self, a: f64, b: f64, c: f64) -> f64 {
        a * b + c
    }

    #[inline(always)]
    fn multiply_add_single(self, a: f32, b: f32, c: f32) -> f32 {
        a * b + c
    }
}

/// Arrays of so many numbers.
macro_rules! portable {
    ($registers:ident, $number:ident, $count:literal) => {
        impl Registers for $registers<Portable> {
            type Number = $number;
            type Lanes = [$number; $count];
            const LANES: usize = $count;

            #[inline(always)]
            fn splat(self, x: $number) -> Self::Lanes {
                [x; $count]
            }

            #[inline(always)]
            fn load(self, from: &[f32], first: usize) -> Self::Lanes {
                let numbers: &[f32; $count] = from[first..].first_chunk().expect("as many numbers");
                numbers.map(<$number>::from)
            }

            #[inline(always)]
            fn store(self, x: Self::Lanes, to: &mut [$number], first: usize) {
                to[first..][..$count].copy_from_slice(&x);
            }

            #[inline(always)]
            fn add(self, a: Self::Lanes, b: Self::Lanes) -> Self::Lanes {
                std::array::from_fn(|k| a[k] + b[k])
            }

            #[inline(always)]
            fn subtract(self, a: Self::Lanes, b: Self::Lanes) -> Self::Lanes {
                std::array::from_fn(|k| a[k] - b[k])
            }

            #[inline(always)]
            fn multiply(self, a: Self::Lanes, b: Self::Lanes) -> Self::Lanes {
                std::array::from_fn(|k| a[k] * b[k])
            }

            #[inline(always)]
            fn multiply_add(self, a: Self::Lanes, b: Self::Lanes, c: Self::Lanes) -> Self::Lanes {
                std::array::from_fn(|k| a[k] * b[k] + c[k])
            }
        }

        impl Scattered for $registers<Portable> {
            #[inline(always)]
            fn total(self, x: Self::Lanes) -> f64 {
                x.into_iter().map(f64::from).sum()
            }

            #[inline(always)]
            #[allow(unsafe_code)]
            unsafe fn pick(self, from: &[$number], places: &[u32], first: usize) -> Self::Lanes {
                std::array::from_fn(|k| from[places[first + k] as usize])
            }

            #[inline(always)]
            #[allow(unsafe_code)]
            unsafe fn put(self, x: Self::Lanes, to: &mut [$number], places: &[u32], first: usize) {
                for k in (0..$count).rev() {
                    to[places[first + k] as usize] = x[k];
                }
            }
        }
    };
}

portable!(Doubles, f64, 2);
portable!(Singles, f32, 4);
