//! The kernels, each for the instruction set in use.
//!
//! A kernel is written once, over a kind of [`Lanes`], and compiled twice: on AVX2 vectors and on plain numbers. Neither
//! fuses multiplications with additions nor reorders them, so both give the same bits.
#![allow(unsafe_code)]

use crate::bank::BiquadBank;
use crate::block_mean::BlockSum;
use crate::lanes::LANES;

/// Calls `$generic` on the widest vectors that this processor has.
macro_rules! dispatched {
    ($(#[$doc:meta])* $name:ident = $($generic:ident)::+, ($($arg:ident: $type:ty),*) -> $result:ty) => {
        $(#[$doc])*
        pub(crate) fn $name($($arg: $type),*) -> $result {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                fn avx2($($arg: $type),*) -> $result {
                    $($generic)::+::<avx2::Four>($($arg),*)
                }
                if tega_simd::level() >= tega_simd::Level::Avx2 {
                    // SAFETY: `level` reports a set only after the processor itself said that it has it.
                    return unsafe { avx2($($arg),*) };
                }
            }
            $($generic)::+::<[f64; LANES]>($($arg),*)
        }
    };
}

dispatched! {
    /// See [`BiquadBank::filter`].
    filter = BiquadBank::filter, (bank: &mut BiquadBank, rows: &[f64], out: &mut [f64]) -> ()
}

dispatched! {
    /// See [`BlockSum::add_rows`].
    add = BlockSum::add_rows, (sum: &mut BlockSum, rows: &[f64]) -> ()
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use std::arch::x86_64::{
        __m256d, _CMP_LT_OQ, _mm256_add_pd, _mm256_andnot_pd, _mm256_cmp_pd, _mm256_loadu_pd, _mm256_mul_pd,
        _mm256_set1_pd, _mm256_storeu_pd, _mm256_sub_pd,
    };

    use crate::lanes::{LANES, Lanes};

    /// Four numbers in one register. Made only by kernels that [`super`] calls when AVX2 is there.
    #[derive(Clone, Copy)]
    pub(super) struct Four(__m256d);

    // SAFETY of every block below: a `Four` is worked with only where AVX2 is there; loads and stores need no
    // alignment and lie within the four numbers borrowed.
    impl Lanes for Four {
        #[inline(always)]
        fn all(x: f64) -> Self {
            Self(unsafe { _mm256_set1_pd(x) })
        }

        #[inline(always)]
        fn load(from: &[f64; LANES]) -> Self {
            Self(unsafe { _mm256_loadu_pd(from.as_ptr()) })
        }

        #[inline(always)]
        fn store(self, to: &mut [f64; LANES]) {
            unsafe { _mm256_storeu_pd(to.as_mut_ptr(), self.0) }
        }

        #[inline(always)]
        fn plus(self, other: Self) -> Self {
            Self(unsafe { _mm256_add_pd(self.0, other.0) })
        }

        #[inline(always)]
        fn minus(self, other: Self) -> Self {
            Self(unsafe { _mm256_sub_pd(self.0, other.0) })
        }

        #[inline(always)]
        fn times(self, other: Self) -> Self {
            Self(unsafe { _mm256_mul_pd(self.0, other.0) })
        }

        #[inline(always)]
        fn without(self, limit: f64) -> Self {
            unsafe {
                let magnitude = _mm256_andnot_pd(_mm256_set1_pd(-0.0), self.0);
                let small = _mm256_cmp_pd::<_CMP_LT_OQ>(magnitude, _mm256_set1_pd(limit));
                Self(_mm256_andnot_pd(small, self.0))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::bank::MARGIN;
    use crate::{EmgError, Sos};

    fn sample() -> impl Strategy<Value = f64> {
        prop_oneof![8 => -1e4..1e4, 1 => Just(0.0), 1 => -1e-249..1e-249, 1 => -1e300..1e300]
    }

    fn bits(values: &[f64]) -> Vec<u64> {
        values.iter().map(|x| x.to_bits()).collect()
    }

    proptest! {
        #[test]
        fn every_path_filters_to_the_same_bits(
            (channels, samples) in (1..=9usize)
                .prop_flat_map(|n| (Just(n), prop::collection::vec(prop::collection::vec(sample(), n), 0..150))),
            order in 1..=8usize,
            cut in 0..150usize,
        ) {
            let run = |filter: fn(&mut BiquadBank, &[f64], &mut [f64])| -> Result<Vec<u64>, EmgError> {
                let mut bank = BiquadBank::new(&Sos::lowpass(200.0, 50.0, order)?, channels);
                let mut all = Vec::new();
                for part in [&samples[..cut.min(samples.len())], &samples[cut.min(samples.len())..]] {
                    let rows = part.concat();
                    let mut out = vec![0.0; rows.len() + MARGIN];
                    filter(&mut bank, &rows, &mut out);
                    all.extend(bits(&out[..rows.len()]));
                }
                Ok(all)
            };
            prop_assert_eq!(run(filter)?, run(BiquadBank::filter::<[f64; LANES]>)?);
        }

        #[test]
        fn every_path_sums_to_the_same_bits(
            (channels, samples) in (1..=9usize)
                .prop_flat_map(|n| (Just(n), prop::collection::vec(prop::collection::vec(sample(), n), 1..100))),
        ) {
            let run = |add: fn(&mut BlockSum, &[f64])| -> Result<Vec<u64>, EmgError> {
                let (mut sum, mut means) = (BlockSum::new(samples.len(), channels)?, Vec::new());
                add(&mut sum, &samples.concat());
                sum.finish(&mut means);
                Ok(bits(&means))
            };
            prop_assert_eq!(run(add)?, run(BlockSum::add_rows::<[f64; LANES]>)?);
        }
    }
}
