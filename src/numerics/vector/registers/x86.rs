//! The registers of AVX2 and AVX-512.
#![allow(unsafe_code)]

use super::{Doubles, Registers, Scattered, Singles};
use crate::numerics::vector::{Avx2, Avx512, Instructions};
use std::arch::x86_64::*;

impl Instructions for Avx2 {
    type Doubles = Doubles<Avx2>;
    type Singles = Singles<Avx2>;
    type Broad = Singles<Avx2>;

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
    fn load_whole(self, from: &[i16], first: usize) -> __m256 {
        let eight: &[i16; 8] = from[first..].first_chunk().expect("as many numbers");
        unsafe { _mm256_cvtepi32_ps(_mm256_cvtepi16_epi32(_mm_loadu_si128(eight.as_ptr().cast()))) }
    }

    #[inline(always)]
    fn load_bytes(self, from: &[i8], first: usize) -> __m256 {
        let eight: &[i8; 8] = from[first..].first_chunk().expect("as many numbers");
        unsafe { _mm256_cvtepi32_ps(_mm256_cvtepi8_epi32(_mm_loadl_epi64(eight.as_ptr().cast()))) }
    }

    #[inline(always)]
    fn multiply_add(self, a: f64, b: f64, c: f64) -> f64 {
        a.mul_add(b, c)
    }

    #[inline(always)]
    fn multiply_add_single(self, a: f32, b: f32, c: f32) -> f32 {
        a.mul_add(b, c)
    }
}

impl Instructions for Avx512 {
    type Doubles = Doubles<Avx512>;
    type Singles = Singles<Avx2>;
    type Broad = Singles<Avx512>;

    #[inline(always)]
    fn doubles(self) -> Self::Doubles {
        Doubles(self)
    }

    #[inline(always)]
    fn singles(self) -> Self::Singles {
        // as many numbers as cells stand side by side
        Singles(self.0)
    }

    #[inline(always)]
    fn broad(self) -> Self::Broad {
        Singles(self)
    }

    #[inline(always)]
    fn load_whole(self, from: &[i16], first: usize) -> __m512 {
        let sixteen: &[i16; 16] = from[first..].first_chunk().expect("as many numbers");
        unsafe { _mm512_cvtepi32_ps(_mm512_cvtepi16_epi32(_mm256_loadu_si256(sixteen.as_ptr().cast()))) }
    }

    #[inline(always)]
    fn load_bytes(self, from: &[i8], first: usize) -> __m512 {
        let sixteen: &[i8; 16] = from[first..].first_chunk().expect("as many numbers");
        unsafe { _mm512_cvtepi32_ps(_mm512_cvtepi8_epi32(_mm_loadu_si128(sixteen.as_ptr().cast()))) }
    }

    #[inline(always)]
    fn multiply_add(self, a: f64, b: f64, c: f64) -> f64 {
        a.mul_add(b, c)
    }

    #[inline(always)]
    fn multiply_add_single(self, a: f32, b: f32, c: f32) -> f32 {
        a.mul_add(b, c)
    }
}

/// The parts of sets of registers that differ only in names of instructions.
macro_rules! arithmetic {
    (
        $count:literal $number:ident in $lanes:ident:
        $splat:ident, $store:ident, $add:ident, $subtract:ident, $multiply:ident, $multiply_add:ident
    ) => {
        type Number = $number;
        type Lanes = $lanes;
        const LANES: usize = $count;

        #[inline(always)]
        fn splat(self, x: $number) -> $lanes {
            unsafe { $splat(x) }
        }

        #[inline(always)]
        fn store(self, x: $lanes, to: &mut [$number], first: usize) {
            let numbers: &mut [$number; $count] = to[first..].first_chunk_mut().expect("as many numbers");
            unsafe { $store(numbers.as_mut_ptr(), x) }
        }

        #[inline(always)]
        fn add(self, a: $lanes, b: $lanes) -> $lanes {
            unsafe { $add(a, b) }
        }

        #[inline(always)]
        fn subtract(self, a: $lanes, b: $lanes) -> $lanes {
            unsafe { $subtract(a, b) }
        }

        #[inline(always)]
        fn multiply(self, a: $lanes, b: $lanes) -> $lanes {
            unsafe { $multiply(a, b) }
        }

        #[inline(always)]
        fn multiply_add(self, a: $lanes, b: $lanes, c: $lanes) -> $lanes {
            unsafe { $multiply_add(a, b, c) }
        }
    };
}

// safe, here and above: `self` proves the instructions
impl Registers for Doubles<Avx2> {
    arithmetic! {
        4 f64 in __m256d:
        _mm256_set1_pd, _mm256_storeu_pd, _mm256_add_pd, _mm256_sub_pd, _mm256_mul_pd, _mm256_fmadd_pd
    }

    #[inline(always)]
    fn load(self, from: &[f32], first: usize) -> __m256d {
        let four: &[f32; 4] = from[first..].first_chunk().expect("as many numbers");
        unsafe { _mm256_cvtps_pd(_mm_loadu_ps(four.as_ptr())) }
    }
}

impl Scattered for Doubles<Avx2> {
    #[inline(always)]
    fn total(self, x: __m256d) -> f64 {
        // safe: four numbers of eight bytes
        let [a, b, c, d] = unsafe { std::mem::transmute::<__m256d, [f64; 4]>(x) };
        (a + b) + (c + d)
    }

    #[inline(always)]
    unsafe fn pick(self, from: &[f64], places: &[u32], first: usize) -> __m256d {
        let places: &[u32; 4] = places[first..].first_chunk().expect("as many places");
        // safe: the caller knows the places
        unsafe { pick_four(from, places) }
    }

    #[inline(always)]
    unsafe fn put(self, x: __m256d, to: &mut [f64], places: &[u32], first: usize) {
        // a copy: nothing that is put changes it
        let places: [u32; 4] = *places[first..].first_chunk().expect("as many places");
        // safe: the caller knows the places
        unsafe {
            put_two(_mm256_extractf128_pd::<1>(x), to, [places[2], places[3]]);
            put_two(_mm256_castpd256_pd128(x), to, [places[0], places[1]]);
        }
    }
}

impl Registers for Doubles<Avx512> {
    arithmetic! {
        8 f64 in __m512d:
        _mm512_set1_pd, _mm512_storeu_pd, _mm512_add_pd, _mm512_sub_pd, _mm512_mul_pd, _mm512_fmadd_pd
    }

    #[inline(always)]
    fn load(self, from: &[f32], first: usize) -> __m512d {
        let eight: &[f32; 8] = from[first..].first_chunk().expect("as many numbers");
        unsafe { _mm512_cvtps_pd(_mm256_loadu_ps(eight.as_ptr())) }
    }
}

impl Scattered for Doubles<Avx512> {
    #[inline(always)]
    fn total(self, x: __m512d) -> f64 {
        // safe: eight numbers of eight bytes; in the order of two registers of four
        let [a, b, c, d, e, f, g, h] = unsafe { std::mem::transmute::<__m512d, [f64; 8]>(x) };
        ((a + b) + (c + d)) + ((e + f) + (g + h))
    }

    #[inline(always)]
    unsafe fn pick(self, from: &[f64], places: &[u32], first: usize) -> __m512d {
        let places: &[u32; 8] = places[first..].first_chunk().expect("as many places");
        let (halves, []) = places.as_chunks::<4>() else { unreachable!() };
        // safe: the caller knows the places
        unsafe {
            let [low, high] = [pick_four(from, &halves[0]), pick_four(from, &halves[1])];
            _mm512_insertf64x4::<1>(_mm512_castpd256_pd512(low), high)
        }
    }

    #[inline(always)]
    unsafe fn put(self, x: __m512d, to: &mut [f64], places: &[u32], first: usize) {
        let places: [u32; 8] = *places[first..].first_chunk().expect("as many places");
        // safe: the caller knows the places
        unsafe {
            put_two(_mm512_extractf64x2_pd::<3>(x), to, [places[6], places[7]]);
            put_two(_mm512_extractf64x2_pd::<2>(x), to, [places[4], places[5]]);
            put_two(_mm512_extractf64x2_pd::<1>(x), to, [places[2], places[3]]);
            put_two(_mm512_castpd512_pd128(x), to, [places[0], places[1]]);
        }
    }
}

impl Registers for Singles<Avx2> {
    arithmetic! {
        8 f32 in __m256:
        _mm256_set1_ps, _mm256_storeu_ps, _mm256_add_ps, _mm256_sub_ps, _mm256_mul_ps, _mm256_fmadd_ps
    }

    #[inline(always)]
    fn load(self, from: &[f32], first: usize) -> __m256 {
        let eight: &[f32; 8] = from[first..].first_chunk().expect("as many numbers");
        unsafe { _mm256_loadu_ps(eight.as_ptr()) }
    }
}

impl Scattered for Singles<Avx2> {
    #[inline(always)]
    fn total(self, x: __m256) -> f64 {
        // safe: eight numbers of four bytes
        let [a, b, c, d, e, f, g, h] = unsafe { std::mem::transmute::<__m256, [f32; 8]>(x) };
        f64::from((a + b) + (c + d)) + f64::from((e + f) + (g + h))
    }

    #[inline(always)]
    unsafe fn pick(self, from: &[f32], places: &[u32], first: usize) -> __m256 {
        let places: &[u32; 8] = places[first..].first_chunk().expect("as many places");
        let (halves, []) = places.as_chunks::<4>() else { unreachable!() };
        // safe: the caller knows the places
        unsafe {
            let [low, high] = [pick_four_singles(from, &halves[0]), pick_four_singles(from, &halves[1])];
            _mm256_insertf128_ps::<1>(_mm256_castps128_ps256(low), high)
        }
    }

    #[inline(always)]
    unsafe fn put(self, x: __m256, to: &mut [f32], places: &[u32], first: usize) {
        let places: [u32; 8] = *places[first..].first_chunk().expect("as many places");
        // safe: eight numbers of four bytes; the caller knows the places
        unsafe {
            let x = std::mem::transmute::<__m256, [f32; 8]>(x);
            for lane in (0..8).rev() {
                *to.as_mut_ptr().add(places[lane] as usize) = x[lane];
            }
        }
    }
}

impl Registers for Singles<Avx512> {
    arithmetic! {
        16 f32 in __m512:
        _mm512_set1_ps, _mm512_storeu_ps, _mm512_add_ps, _mm512_sub_ps, _mm512_mul_ps, _mm512_fmadd_ps
    }

    #[inline(always)]
    fn load(self, from: &[f32], first: usize) -> __m512 {
        let sixteen: &[f32; 16] = from[first..].first_chunk().expect("as many numbers");
        unsafe { _mm512_loadu_ps(sixteen.as_ptr()) }
    }
}

/// # Safety
/// The places lie within `from`; the processor has AVX.
#[inline(always)]
unsafe fn pick_four(from: &[f64], places: &[u32; 4]) -> __m256d {
    unsafe {
        let at = |lane: usize| from.as_ptr().add(places[lane] as usize);
        let low = _mm_loadh_pd(_mm_load_sd(at(0)), at(1));
        let high = _mm_loadh_pd(_mm_load_sd(at(2)), at(3));
        _mm256_insertf128_pd::<1>(_mm256_castpd128_pd256(low), high)
    }
}

/// # Safety
/// The places lie within `from`; the processor has AVX.
#[inline(always)]
unsafe fn pick_four_singles(from: &[f32], places: &[u32; 4]) -> __m128 {
    unsafe {
        let at = |lane: usize| from.as_ptr().add(places[lane] as usize);
        let two = _mm_insert_ps::<0x10>(_mm_load_ss(at(0)), _mm_load_ss(at(1)));
        let three = _mm_insert_ps::<0x20>(two, _mm_load_ss(at(2)));
        _mm_insert_ps::<0x30>(three, _mm_load_ss(at(3)))
    }
}

/// # Safety
/// The places lie within `to`.
#[inline(always)]
unsafe fn put_two(x: __m128d, to: &mut [f64], places: [u32; 2]) {
    unsafe {
        _mm_storeh_pd(to.as_mut_ptr().add(places[1] as usize), x);
        _mm_storel_pd(to.as_mut_ptr().add(places[0] as usize), x);
    }
}
