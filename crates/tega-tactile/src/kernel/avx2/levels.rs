//! Weigh the differences of eight pixels: the levels of equation 1 on a 256-bit vector, in the order of the row.
//!
//! Each half of a vector holds the three bytes of four pixels and four bytes more. They are subtracted as they lie, where
//! differences have no sign, and [`Factors`] weigh them: a multiplication of bytes, one of words.

#![allow(unsafe_code)]

use std::arch::x86_64::{
    __m256i, _mm_loadu_si128, _mm256_add_epi32, _mm256_loadu_si256, _mm256_madd_epi16, _mm256_maddubs_epi16,
    _mm256_or_si256, _mm256_set_m128i, _mm256_set1_epi32, _mm256_shuffle_epi8, _mm256_sub_epi16,
    _mm256_subs_epu8,
};
use std::array::from_fn;

use crate::kernel::factors::Factors;
use crate::kernel::{ABSOLUTE, SIGNED};

/// Pixels a vector of levels, their bytes, and vectors a step.
pub(super) const LANES: usize = 8;
pub(super) const GROUPS: usize = 4;
pub(super) const BYTES: usize = 3 * LANES;
/// Pixels of a step.
pub(super) const STEP: usize = GROUPS * LANES;
/// Bytes that a step is loaded from.
pub(super) const STEP_BYTES: usize = 3 * STEP + 8;

/// [`Factors`] as vectors: one set, or two of the same channels whose products are added.
#[derive(Clone, Copy)]
pub(super) struct Products<const SETS: usize> {
    /// Where each pixel's four bytes are in its half, where the four bytes more come first in the lower half and last in
    /// the upper one, and the other way round.
    within: __m256i,
    at_edge: __m256i,
    bytes: [__m256i; SETS],
    words: [__m256i; SETS],
}

impl<const SETS: usize> Products<SETS> {
    #[target_feature(enable = "avx2")]
    pub(super) fn of(sets: [Factors; SETS]) -> Self {
        let at = |more: u8| {
            let at: [u8; 16] = from_fn(|k| more + 3 * (k as u8 / 4) + sets[0].channels[k % 4]);
            // SAFETY: an unaligned 16-byte load of 16 bytes.
            unsafe { _mm_loadu_si128(at.as_ptr().cast()) }
        };
        let words = |[low, high]: [i16; 2]| (i32::from(low) & 0xffff) | (i32::from(high) << 16);
        Self {
            within: _mm256_set_m128i(at(0), at(4)),
            at_edge: _mm256_set_m128i(at(4), at(0)),
            bytes: sets.map(|set| _mm256_set1_epi32(i32::from_le_bytes(set.bytes.map(i8::cast_unsigned)))),
            words: sets.map(|set| _mm256_set1_epi32(words(set.words))),
        }
    }

    /// Sum over the sets of what `pairs` says of a set's byte factors, times its word factors.
    #[target_feature(enable = "avx2")]
    #[inline]
    fn weigh(&self, pairs: impl Fn(__m256i) -> __m256i) -> __m256i {
        let mut level = _mm256_madd_epi16(pairs(self.bytes[0]), self.words[0]);
        for set in 1..SETS {
            level = _mm256_add_epi32(level, _mm256_madd_epi16(pairs(self.bytes[set]), self.words[set]));
        }
        level
    }

    /// The levels of eight pixels whose bytes are `at` these places; signed differences are taken of products, of which
    /// no sum of a pair leaves 16 bits, nor does that of the pair's differences.
    #[target_feature(enable = "avx2")]
    #[inline]
    fn levels<const DIFFERENCE: u8>(&self, at: __m256i, f: __m256i, b: __m256i) -> __m256i {
        if DIFFERENCE == SIGNED {
            let (f, b) = (_mm256_shuffle_epi8(f, at), _mm256_shuffle_epi8(b, at));
            return self.weigh(|bytes| {
                _mm256_sub_epi16(_mm256_maddubs_epi16(f, bytes), _mm256_maddubs_epi16(b, bytes))
            });
        }
        let rise = _mm256_subs_epu8(f, b);
        let d = if DIFFERENCE == ABSOLUTE { _mm256_or_si256(rise, _mm256_subs_epu8(b, f)) } else { rise };
        let pixels = _mm256_shuffle_epi8(d, at);
        self.weigh(|bytes| _mm256_maddubs_epi16(pixels, bytes))
    }

    /// The levels of a step's eight `k`; its bytes begin four before the first pixel.
    #[target_feature(enable = "avx2")]
    #[inline]
    pub(super) fn of_step<const DIFFERENCE: u8>(
        &self,
        k: usize,
        [frame, baseline]: [&[u8; STEP_BYTES]; 2],
    ) -> __m256i {
        let load = |bytes: &[u8; STEP_BYTES]| {
            let bytes: &[u8] = &bytes[BYTES * k..BYTES * k + 32];
            // SAFETY: an unaligned 32-byte load of 32 bytes.
            unsafe { _mm256_loadu_si256(bytes.as_ptr().cast()) }
        };
        self.levels::<DIFFERENCE>(self.within, load(frame), load(baseline))
    }

    /// The levels of eight pixels of which no byte before or behind them may be read.
    #[target_feature(enable = "avx2")]
    #[inline]
    pub(super) fn of_eight<const DIFFERENCE: u8>(&self, [frame, baseline]: [&[u8; BYTES]; 2]) -> __m256i {
        // Bytes 0 to 15, and 8 to 23.
        let load = |bytes: &[u8; BYTES]| {
            let at = bytes.as_ptr();
            // SAFETY: both unaligned 16-byte loads lie within the 24 bytes.
            unsafe { _mm256_set_m128i(_mm_loadu_si128(at.add(8).cast()), _mm_loadu_si128(at.cast())) }
        };
        self.levels::<DIFFERENCE>(self.at_edge, load(frame), load(baseline))
    }
}
