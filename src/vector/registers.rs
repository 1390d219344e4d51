//! Numbers side by side, in the registers of each set of instructions.
//!
//! Left out: how a processor's set is found out (`mod`).

use super::{Instructions, Portable};

impl Instructions for Portable {
    type Lanes = [f64; 2];
    type Singles = [f32; 4];
    const LANES: usize = 2;

    #[inline(always)]
    fn multiply_add(self, a: f64, b: f64, c: f64) -> f64 {
        a * b + c
    }

    #[inline(always)]
    fn multiply_add_single(self, a: f32, b: f32, c: f32) -> f32 {
        a * b + c
    }

    #[inline(always)]
    fn splat(self, x: f64) -> Self::Lanes {
        [x; 2]
    }

    #[inline(always)]
    fn widen(self, from: &[f32], first: usize) -> Self::Lanes {
        [f64::from(from[first]), f64::from(from[first + 1])]
    }

    #[inline(always)]
    fn add(self, a: Self::Lanes, b: Self::Lanes) -> Self::Lanes {
        [a[0] + b[0], a[1] + b[1]]
    }

    #[inline(always)]
    fn subtract(self, a: Self::Lanes, b: Self::Lanes) -> Self::Lanes {
        [a[0] - b[0], a[1] - b[1]]
    }

    #[inline(always)]
    fn multiply(self, a: Self::Lanes, b: Self::Lanes) -> Self::Lanes {
        [a[0] * b[0], a[1] * b[1]]
    }

    #[inline(always)]
    fn multiply_add_lanes(self, a: Self::Lanes, b: Self::Lanes, c: Self::Lanes) -> Self::Lanes {
        [a[0] * b[0] + c[0], a[1] * b[1] + c[1]]
    }

    #[inline(always)]
    fn total(self, x: Self::Lanes) -> f64 {
        x[0] + x[1]
    }

    #[inline(always)]
    fn splat_single(self, x: f32) -> Self::Singles {
        [x; 4]
    }

    #[inline(always)]
    fn load_singles(self, from: &[f32], first: usize) -> Self::Singles {
        *from[first..].first_chunk().expect("as many numbers")
    }

    #[inline(always)]
    fn store_singles(self, x: Self::Singles, to: &mut [f32], first: usize) {
        to[first..][..4].copy_from_slice(&x);
    }

    #[inline(always)]
    fn multiply_add_singles(self, a: Self::Singles, b: Self::Singles, c: Self::Singles) -> Self::Singles {
        [a[0] * b[0] + c[0], a[1] * b[1] + c[1], a[2] * b[2] + c[2], a[3] * b[3] + c[3]]
    }

    #[inline(always)]
    #[allow(unsafe_code)]
    unsafe fn pick(self, from: &[f64], places: &[u32], first: usize) -> Self::Lanes {
        [from[places[first] as usize], from[places[first + 1] as usize]]
    }

    #[inline(always)]
    #[allow(unsafe_code)]
    unsafe fn put(self, x: Self::Lanes, to: &mut [f64], places: &[u32], first: usize) {
        to[places[first + 1] as usize] = x[1];
        to[places[first] as usize] = x[0];
    }
}

#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)]
mod x86 {
    use super::super::{Avx2, Avx512};
    use super::Instructions;
    use std::arch::x86_64::*;

    /// What differs between sets of registers by the names of their instructions alone.
    macro_rules! arithmetic {
        (
            doubles: $splat:ident, $add:ident, $subtract:ident, $multiply:ident, $multiply_add:ident;
            $count:literal singles: $splat_single:ident, $load:ident, $store:ident, $multiply_add_singles:ident
        ) => {
            #[inline(always)]
            fn multiply_add(self, a: f64, b: f64, c: f64) -> f64 {
                a.mul_add(b, c)
            }

            #[inline(always)]
            fn multiply_add_single(self, a: f32, b: f32, c: f32) -> f32 {
                a.mul_add(b, c)
            }

            #[inline(always)]
            fn splat(self, x: f64) -> Self::Lanes {
                unsafe { $splat(x) }
            }

            #[inline(always)]
            fn add(self, a: Self::Lanes, b: Self::Lanes) -> Self::Lanes {
                unsafe { $add(a, b) }
            }

            #[inline(always)]
            fn subtract(self, a: Self::Lanes, b: Self::Lanes) -> Self::Lanes {
                unsafe { $subtract(a, b) }
            }

            #[inline(always)]
            fn multiply(self, a: Self::Lanes, b: Self::Lanes) -> Self::Lanes {
                unsafe { $multiply(a, b) }
            }

            #[inline(always)]
            fn multiply_add_lanes(self, a: Self::Lanes, b: Self::Lanes, c: Self::Lanes) -> Self::Lanes {
                unsafe { $multiply_add(a, b, c) }
            }

            #[inline(always)]
            fn splat_single(self, x: f32) -> Self::Singles {
                unsafe { $splat_single(x) }
            }

            #[inline(always)]
            fn load_singles(self, from: &[f32], first: usize) -> Self::Singles {
                let numbers: &[f32; $count] = from[first..].first_chunk().expect("as many numbers");
                unsafe { $load(numbers.as_ptr()) }
            }

            #[inline(always)]
            fn store_singles(self, x: Self::Singles, to: &mut [f32], first: usize) {
                let numbers: &mut [f32; $count] = to[first..].first_chunk_mut().expect("as many numbers");
                unsafe { $store(numbers.as_mut_ptr(), x) }
            }

            #[inline(always)]
            fn multiply_add_singles(self, a: Self::Singles, b: Self::Singles, c: Self::Singles) -> Self::Singles {
                unsafe { $multiply_add_singles(a, b, c) }
            }
        };
    }

    // safe, here and above: `self` proves the instructions
    impl Instructions for Avx2 {
        type Lanes = __m256d;
        type Singles = __m256;
        const LANES: usize = 4;

        arithmetic! {
            doubles: _mm256_set1_pd, _mm256_add_pd, _mm256_sub_pd, _mm256_mul_pd, _mm256_fmadd_pd;
            8 singles: _mm256_set1_ps, _mm256_loadu_ps, _mm256_storeu_ps, _mm256_fmadd_ps
        }

        #[inline(always)]
        fn widen(self, from: &[f32], first: usize) -> Self::Lanes {
            let four: &[f32; 4] = from[first..].first_chunk().expect("as many numbers");
            unsafe { _mm256_cvtps_pd(_mm_loadu_ps(four.as_ptr())) }
        }

        #[inline(always)]
        fn total(self, x: Self::Lanes) -> f64 {
            // safe: four numbers of eight bytes
            let [a, b, c, d] = unsafe { std::mem::transmute::<__m256d, [f64; 4]>(x) };
            (a + b) + (c + d)
        }

        #[inline(always)]
        unsafe fn pick(self, from: &[f64], places: &[u32], first: usize) -> Self::Lanes {
            let places: &[u32; 4] = places[first..].first_chunk().expect("as many places");
            // safe: the caller knows the places
            unsafe { pick_four(from, places) }
        }

        #[inline(always)]
        unsafe fn put(self, x: Self::Lanes, to: &mut [f64], places: &[u32], first: usize) {
            // a copy: nothing that is put changes it
            let places: [u32; 4] = *places[first..].first_chunk().expect("as many places");
            // safe: the caller knows the places
            unsafe {
                put_two(_mm256_extractf128_pd::<1>(x), to, [places[2], places[3]]);
                put_two(_mm256_castpd256_pd128(x), to, [places[0], places[1]]);
            }
        }
    }

    impl Instructions for Avx512 {
        type Lanes = __m512d;
        type Singles = __m512;
        const LANES: usize = 8;

        arithmetic! {
            doubles: _mm512_set1_pd, _mm512_add_pd, _mm512_sub_pd, _mm512_mul_pd, _mm512_fmadd_pd;
            16 singles: _mm512_set1_ps, _mm512_loadu_ps, _mm512_storeu_ps, _mm512_fmadd_ps
        }

        #[inline(always)]
        fn widen(self, from: &[f32], first: usize) -> Self::Lanes {
            let eight: &[f32; 8] = from[first..].first_chunk().expect("as many numbers");
            unsafe { _mm512_cvtps_pd(_mm256_loadu_ps(eight.as_ptr())) }
        }

        #[inline(always)]
        fn total(self, x: Self::Lanes) -> f64 {
            // safe: eight numbers of eight bytes; in the order of two registers of four
            let [a, b, c, d, e, f, g, h] = unsafe { std::mem::transmute::<__m512d, [f64; 8]>(x) };
            ((a + b) + (c + d)) + ((e + f) + (g + h))
        }

        #[inline(always)]
        unsafe fn pick(self, from: &[f64], places: &[u32], first: usize) -> Self::Lanes {
            let places: &[u32; 8] = places[first..].first_chunk().expect("as many places");
            let [low, high] = halves(places);
            // safe: the caller knows the places
            unsafe { _mm512_insertf64x4::<1>(_mm512_castpd256_pd512(pick_four(from, low)), pick_four(from, high)) }
        }

        #[inline(always)]
        unsafe fn put(self, x: Self::Lanes, to: &mut [f64], places: &[u32], first: usize) {
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

    #[inline(always)]
    fn halves(places: &[u32; 8]) -> [&[u32; 4]; 2] {
        let (halves, []) = places.as_chunks() else { unreachable!() };
        [&halves[0], &halves[1]]
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
    /// The places lie within `to`.
    #[inline(always)]
    unsafe fn put_two(x: __m128d, to: &mut [f64], places: [u32; 2]) {
        unsafe {
            _mm_storeh_pd(to.as_mut_ptr().add(places[1] as usize), x);
            _mm_storel_pd(to.as_mut_ptr().add(places[0] as usize), x);
        }
    }
}
