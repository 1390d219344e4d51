//! Vector instructions: hot loops are compiled for AVX2 with fused multiply-add and for AVX-512 as well, and chosen at run time.
//!
//! A hot loop is a [`Task`]: written once, inlined into an entry compiled for each set of instructions. The compiler makes vectors of
//! most loops by itself; where it does not, they are written in registers. Products are fused with sums in two of the
//! sets, so that results differ in the last digits between processors with and without AVX2, never between runs on one; how
//! wide the registers are does not change the order of a sum. Closures that take instructions are to be kept out of hot
//! loops: where one is not inlined, it is compiled for every processor. Left out: what the loops are.

pub mod elementary;
pub mod linear;
mod registers;

/// Work that is compiled for every set of instructions.
pub trait Task {
    /// What it returns.
    type Output;

    /// Does it; to be marked `#[inline(always)]`.
    fn run<I: Instructions>(self, instructions: I) -> Self::Output;
}

/// A set of instructions; having one at hand proves that the processor has them. There are no others than those of this module.
pub trait Instructions: Copy + sealed::Sealed {
    /// Numbers side by side, in a register.
    type Lanes: Copy;

    /// How many of them.
    const LANES: usize;

    /// The same in single precision: twice as many.
    type Singles: Copy;

    /// `a b + c`, fused where the processor can.
    fn multiply_add(self, a: f64, b: f64, c: f64) -> f64;

    /// The same in single precision.
    fn multiply_add_single(self, a: f32, b: f32, c: f32) -> f32;

    /// One number in every lane.
    fn splat(self, x: f64) -> Self::Lanes;

    /// The numbers from entry `first` on.
    fn widen(self, from: &[f32], first: usize) -> Self::Lanes;

    /// `a + b`.
    fn add(self, a: Self::Lanes, b: Self::Lanes) -> Self::Lanes;

    /// `a - b`.
    fn subtract(self, a: Self::Lanes, b: Self::Lanes) -> Self::Lanes;

    /// `a b`.
    fn multiply(self, a: Self::Lanes, b: Self::Lanes) -> Self::Lanes;

    /// `a b + c`, fused where the processor can.
    fn multiply_add_lanes(self, a: Self::Lanes, b: Self::Lanes, c: Self::Lanes) -> Self::Lanes;

    /// The sum over the lanes.
    fn total(self, x: Self::Lanes) -> f64;

    /// One number in every lane.
    fn splat_single(self, x: f32) -> Self::Singles;

    /// The numbers from entry `first` on.
    fn load_singles(self, from: &[f32], first: usize) -> Self::Singles;

    /// Puts numbers there.
    fn store_singles(self, x: Self::Singles, to: &mut [f32], first: usize);

    /// `a b + c`, fused where the processor can.
    fn multiply_add_singles(self, a: Self::Singles, b: Self::Singles, c: Self::Singles) -> Self::Singles;

    /// The numbers at the places that are listed from entry `first` on.
    ///
    /// # Safety
    /// The places lie within `from`.
    #[allow(unsafe_code)]
    unsafe fn pick(self, from: &[f64], places: &[u32], first: usize) -> Self::Lanes;

    /// Puts numbers where [`Instructions::pick`] takes them from, the first lane last: where two have one place, the first is it.
    ///
    /// # Safety
    /// The places lie within `to`.
    #[allow(unsafe_code)]
    unsafe fn put(self, x: Self::Lanes, to: &mut [f64], places: &[u32], first: usize);
}

/// What every processor has.
#[derive(Clone, Copy, Debug)]
pub struct Portable;

/// AVX2 and fused multiply-add.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy, Debug)]
pub struct Avx2(());

/// AVX-512 with its instructions for single and double precision.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy, Debug)]
pub struct Avx512(());

/// What unsafe code relies on, out of reach for anybody else.
mod sealed {
    pub trait Sealed {}
    impl Sealed for super::Portable {}
    #[cfg(target_arch = "x86_64")]
    impl Sealed for super::Avx2 {}
    #[cfg(target_arch = "x86_64")]
    impl Sealed for super::Avx512 {}
}

/// Runs `task` with the best instructions of this processor.
pub fn run<T: Task>(task: T) -> T::Output {
    #[cfg(target_arch = "x86_64")]
    {
        // safe: they are there
        #[allow(unsafe_code)]
        if has_avx512() {
            return unsafe { run_avx512(task) };
        } else if has_avx2() {
            return unsafe { run_avx2(task) };
        }
    }
    task.run(Portable)
}

/// What each set of instructions that this processor has makes of a task, the portable one first.
#[cfg(test)]
pub fn by_each<T: Task>(mut task: impl FnMut() -> T) -> Vec<T::Output> {
    #[cfg_attr(not(target_arch = "x86_64"), allow(unused_mut))]
    let mut outputs = vec![task().run(Portable)];
    #[cfg(target_arch = "x86_64")]
    {
        // safe: they are there
        #[allow(unsafe_code)]
        if has_avx2() {
            outputs.push(unsafe { run_avx2(task()) });
        }
        #[allow(unsafe_code)]
        if has_avx512() {
            outputs.push(unsafe { run_avx512(task()) });
        }
    }
    outputs
}

#[cfg(target_arch = "x86_64")]
fn has_avx2() -> bool {
    std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma")
}

#[cfg(target_arch = "x86_64")]
fn has_avx512() -> bool {
    use std::arch::is_x86_feature_detected as has;
    has_avx2() && has!("avx512f") && has!("avx512dq") && has!("avx512vl")
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn run_avx2<T: Task>(task: T) -> T::Output {
    task.run(Avx2(()))
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,avx512f,avx512dq,avx512vl")]
fn run_avx512<T: Task>(task: T) -> T::Output {
    task.run(Avx512(()))
}
