//! Vector instructions: hot loops are compiled for AVX2 with fused multiply-add and for AVX-512 as well, and chosen at
//! run time.
//!
//! A hot loop is a [`Task`]: written once, inlined into an entry compiled for each set of instructions. The compiler
//! vectorises most loops by itself; others are written with registers. Products are fused with sums in two of the sets,
//! so that results differ in the last digits between processors with and without AVX2, never between runs on one; the
//! width of the registers does not change the order of a sum. Closures that take instructions must not be used in hot
//! loops: where one is not inlined, it is compiled for every processor.

pub mod elementary;
pub mod linear;
mod registers;

pub use registers::{Number, Registers, Scattered};

/// Work that is compiled for every set of instructions.
pub trait Task {
    /// What it returns.
    type Output;

    /// Does it; to be marked `#[inline(always)]`. Its loops take numbers or one iterator each: pairs (`zip`) and arrays
    /// by value are calls in a build of several codegen units, and `init` takes a third longer.
    fn run<I: Instructions>(self, instructions: I) -> Self::Output;
}

/// A set of instructions; a value of it proves that the processor has them. Only this module creates them.
pub trait Instructions: Copy + sealed::Sealed {
    /// Its registers for numbers in double precision.
    type Doubles: Scattered<Number = f64>;

    /// Those for numbers in single precision, of up to eight numbers.
    type Singles: Scattered<Number = f32>;

    /// The widest for numbers in single precision.
    type Broad: Registers<Number = f32>;

    /// The registers for double precision.
    fn doubles(self) -> Self::Doubles;

    /// Those for single precision.
    fn singles(self) -> Self::Singles;

    /// The widest for single precision.
    fn broad(self) -> Self::Broad;

    /// The whole numbers from entry `first` on.
    fn load_whole(self, from: &[i16], first: usize) -> <Self::Broad as Registers>::Lanes;

    /// The same of bytes.
    fn load_bytes(self, from: &[i8], first: usize) -> <Self::Broad as Registers>::Lanes;

    /// `a b + c`, fused where the processor can.
    fn multiply_add(self, a: f64, b: f64, c: f64) -> f64;

    /// The same in single precision.
    fn multiply_add_single(self, a: f32, b: f32, c: f32) -> f32;
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
pub struct Avx512(Avx2);

/// Guarantees for unsafe code, private to this module.
mod sealed {
    pub trait Sealed {}
    impl Sealed for super::Portable {}
    #[cfg(target_arch = "x86_64")]
    impl Sealed for super::Avx2 {}
    #[cfg(target_arch = "x86_64")]
    impl Sealed for super::Avx512 {}
    impl<I: Sealed> Sealed for super::registers::Doubles<I> {}
    impl<I: Sealed> Sealed for super::registers::Singles<I> {}
    impl Sealed for f64 {}
    impl Sealed for f32 {}
}

/// Runs `task` with the best instructions of this processor.
pub fn run<T: Task>(task: T) -> T::Output {
    #[cfg(target_arch = "x86_64")]
    {
        // safe: the processor has them
        #[allow(unsafe_code)]
        if has_avx512() {
            return unsafe { run_avx512(task) };
        } else if has_avx2() {
            return unsafe { run_avx2(task) };
        }
    }
    task.run(Portable)
}

/// Prefetches the entry `distance` entries ahead, which need not exist: it speeds up reading long rows.
#[inline(always)]
pub fn fetch_ahead<T>(entry: &T, distance: usize) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        let start = std::ptr::from_ref(entry).wrapping_add(distance).cast::<i8>();
        for line in (0..size_of::<T>()).step_by(CACHE_LINE) {
            // safe: a hint, which never fails and never changes anything
            #[allow(unsafe_code)]
            unsafe {
                _mm_prefetch::<_MM_HINT_T0>(start.wrapping_add(line));
            }
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (entry, distance);
}

/// Bytes per cache line.
#[cfg(target_arch = "x86_64")]
const CACHE_LINE: usize = 64;

/// The result of a task with each set of instructions of this processor, the portable one first.
#[cfg(test)]
pub fn by_each<T: Task>(mut task: impl FnMut() -> T) -> Vec<T::Output> {
    #[cfg_attr(not(target_arch = "x86_64"), allow(unused_mut))]
    let mut outputs = vec![task().run(Portable)];
    #[cfg(target_arch = "x86_64")]
    {
        // safe: the processor has them
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

/// Whether products and sums are rounded once, as vector instructions do: results differ in their last digits.
pub fn is_fused() -> bool {
    #[cfg(target_arch = "x86_64")]
    return has_avx2();
    #[cfg(not(target_arch = "x86_64"))]
    cfg!(target_arch = "aarch64")
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
    task.run(Avx512(Avx2(())))
}
