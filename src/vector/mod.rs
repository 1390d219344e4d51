//! Vector instructions: hot loops are compiled for AVX2 with fused multiply-add as well, and chosen at run time.
//!
//! A hot loop is a [`Task`]: written once, inlined into an entry compiled for either set of instructions. Products are fused
//! with sums in one of them, and the innermost loops (`star::kernel`) sum in another order too: results differ in the last
//! digits between processors with and without AVX2, never between runs on one.

pub mod elementary;

/// Work that is compiled for every set of instructions.
pub trait Task {
    /// What it returns.
    type Output;

    /// Does it; to be marked `#[inline(always)]`.
    fn run<I: Instructions>(self, instructions: I) -> Self::Output;
}

/// A set of instructions; having one at hand proves that the processor has them. There are no others than those of this file.
pub trait Instructions: Copy + sealed::Sealed {
    /// Whether AVX2 and FMA are there.
    const AVX2: bool;

    /// `a b + c`, fused where the processor can.
    fn multiply_add(self, a: f64, b: f64, c: f64) -> f64;

    /// The same in single precision.
    fn multiply_add_single(self, a: f32, b: f32, c: f32) -> f32;
}

/// What every processor has.
#[derive(Clone, Copy, Debug)]
pub struct Portable;

/// AVX2 and fused multiply-add.
#[derive(Clone, Copy, Debug)]
pub struct Avx2(());

/// What unsafe code relies on, out of reach for anybody else.
mod sealed {
    pub trait Sealed {}
    impl Sealed for super::Portable {}
    impl Sealed for super::Avx2 {}
}

impl Instructions for Portable {
    const AVX2: bool = false;

    #[inline(always)]
    fn multiply_add(self, a: f64, b: f64, c: f64) -> f64 {
        a * b + c
    }

    #[inline(always)]
    fn multiply_add_single(self, a: f32, b: f32, c: f32) -> f32 {
        a * b + c
    }
}

impl Instructions for Avx2 {
    const AVX2: bool = true;

    #[inline(always)]
    fn multiply_add(self, a: f64, b: f64, c: f64) -> f64 {
        a.mul_add(b, c)
    }

    #[inline(always)]
    fn multiply_add_single(self, a: f32, b: f32, c: f32) -> f32 {
        a.mul_add(b, c)
    }
}

/// Runs `task` with the best instructions of this processor.
pub fn run<T: Task>(task: T) -> T::Output {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma") {
        // safe: they are there
        #[allow(unsafe_code)]
        return unsafe { run_avx2(task) };
    }
    task.run(Portable)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn run_avx2<T: Task>(task: T) -> T::Output {
    task.run(Avx2(()))
}
