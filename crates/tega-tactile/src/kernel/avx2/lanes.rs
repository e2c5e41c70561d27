//! Sums and range of a row's levels in vectors, and what they come to.

#![allow(unsafe_code)]

use std::arch::x86_64::{
    __m256i, _mm_add_epi64, _mm_cvtsi128_si32, _mm_cvtsi128_si64, _mm_max_epi32, _mm_max_epu16,
    _mm_min_epi32, _mm_minpos_epu16, _mm_set1_epi32, _mm_shuffle_epi32, _mm_unpackhi_epi64, _mm_xor_si128,
    _mm256_add_epi16, _mm256_add_epi32, _mm256_add_epi64, _mm256_and_si256, _mm256_castsi256_si128,
    _mm256_cvtepi32_epi64, _mm256_extracti128_si256, _mm256_madd_epi16, _mm256_max_epi16, _mm256_max_epi32,
    _mm256_min_epi32, _mm256_mul_epi32, _mm256_or_si256, _mm256_packs_epi32, _mm256_set1_epi16,
    _mm256_set1_epi32, _mm256_set1_epi64x, _mm256_setzero_si256, _mm256_srli_epi32, _mm256_srli_epi64,
    _mm256_storeu_si256, _mm256_testz_si256,
};

use super::levels::{GROUPS, LANES};
use crate::kernel::{Row, SIGNED};

/// A level of these bits alone is small: the squares of four add up to less than 2²⁸, and in as many steps to less than 2³¹.
const SMALL: i16 = (1 << 13) - 1;
const SMALL_STEPS: usize = 8;

/// Sum, smallest or largest of eight lanes.
macro_rules! fold_lanes {
    ($v:expr, $op:ident) => {{
        let v = $v;
        let half = $op(_mm256_castsi256_si128(v), _mm256_extracti128_si256::<1>(v));
        let pair = $op(half, _mm_shuffle_epi32::<0b01_00_11_10>(half));
        _mm_cvtsi128_si32($op(pair, _mm_shuffle_epi32::<0b10_11_00_01>(pair)))
    }};
}

#[target_feature(enable = "avx2")]
#[inline]
pub(super) fn lanes_i32(v: __m256i) -> [i32; LANES] {
    let mut out = [0; LANES];
    // SAFETY: `out` is exactly 32 bytes.
    unsafe { _mm256_storeu_si256(out.as_mut_ptr().cast(), v) };
    out
}

/// The largest of eight lanes.
#[target_feature(enable = "avx2")]
#[inline]
pub(super) fn largest(v: __m256i) -> i32 {
    fold_lanes!(v, _mm_max_epi32)
}

/// What one row's vectors say so far.
#[derive(Clone, Copy)]
pub(super) struct Lanes {
    pub sum: __m256i,
    pub squares: __m256i,
    /// Sums of small levels' squares, in 32 bits.
    small: __m256i,
    pub min: __m256i,
    pub max: __m256i,
    /// The largest of small levels, in words.
    small_max: __m256i,
}

impl Lanes {
    #[target_feature(enable = "avx2")]
    pub fn none<const KEPT: bool>() -> Self {
        let zero = _mm256_setzero_si256();
        let max = if KEPT { zero } else { _mm256_set1_epi32(i32::MIN) };
        Self { sum: zero, squares: zero, small: zero, min: _mm256_set1_epi32(i32::MAX), max, small_max: zero }
    }

    /// Takes eight levels `n`; `range` is the same, whose smallest and largest are looked for.
    #[target_feature(enable = "avx2")]
    #[inline]
    pub fn take<const DIFFERENCE: u8, const SQUARES: bool, const KEPT: bool>(
        &mut self,
        n: __m256i,
        range: __m256i,
    ) {
        self.sum = _mm256_add_epi32(self.sum, n);
        if DIFFERENCE == SIGNED && !KEPT {
            self.min = _mm256_min_epi32(self.min, range);
        }
        if !KEPT {
            self.max = _mm256_max_epi32(self.max, range);
        }
        if SQUARES {
            self.squares_of(n);
        }
    }

    #[target_feature(enable = "avx2")]
    #[inline]
    fn squares_of(&mut self, n: __m256i) {
        let odd = _mm256_srli_epi64::<32>(n);
        self.squares = _mm256_add_epi64(self.squares, _mm256_mul_epi32(n, n));
        self.squares = _mm256_add_epi64(self.squares, _mm256_mul_epi32(odd, odd));
    }

    /// Takes a step's levels and their squares; small levels two at a time, where none is `below_zero`.
    #[target_feature(enable = "avx2")]
    #[inline]
    pub fn take_squares<const DIFFERENCE: u8, const KEPT: bool>(
        &mut self,
        n: [__m256i; GROUPS],
        step: usize,
        below_zero: bool,
    ) {
        if DIFFERENCE == SIGNED || below_zero || !self.take_small::<KEPT>(n) {
            for n in n {
                self.take::<DIFFERENCE, true, KEPT>(n, n);
            }
        }
        if step % SMALL_STEPS == SMALL_STEPS - 1 {
            self.widen();
        }
    }

    /// Takes a step's levels if all are small, as most are.
    #[target_feature(enable = "avx2")]
    #[inline]
    fn take_small<const KEPT: bool>(&mut self, [a, b, c, d]: [__m256i; GROUPS]) -> bool {
        let words = [_mm256_packs_epi32(a, b), _mm256_packs_epi32(c, d)];
        if _mm256_testz_si256(_mm256_or_si256(words[0], words[1]), _mm256_set1_epi16(!SMALL)) == 0 {
            return false;
        }
        for words in words {
            self.small = _mm256_add_epi32(self.small, _mm256_madd_epi16(words, words));
        }
        let pairs = _mm256_madd_epi16(_mm256_add_epi16(words[0], words[1]), _mm256_set1_epi16(1));
        self.sum = _mm256_add_epi32(self.sum, pairs);
        if !KEPT {
            self.small_max = _mm256_max_epi16(self.small_max, _mm256_max_epi16(words[0], words[1]));
        }
        true
    }

    /// Moves the squares of small levels to the others before they outgrow 32 bits.
    #[target_feature(enable = "avx2")]
    #[inline]
    fn widen(&mut self) {
        let even = _mm256_and_si256(self.small, _mm256_set1_epi64x(0xffff_ffff));
        let odd = _mm256_srli_epi64::<32>(self.small);
        self.squares = _mm256_add_epi64(self.squares, _mm256_add_epi64(even, odd));
        self.small = _mm256_setzero_si256();
    }

    /// The row. Its largest level is that of the words, where levels are kept.
    #[target_feature(enable = "avx2")]
    #[inline]
    pub fn row<const DIFFERENCE: u8, const SQUARES: bool, const KEPT: bool>(&mut self, least: i32) -> Row {
        if SQUARES {
            self.widen();
        }
        if SQUARES && DIFFERENCE != SIGNED && !KEPT && least == 0 {
            let odd = _mm256_srli_epi32::<16>(self.small_max);
            let even = _mm256_and_si256(self.small_max, _mm256_set1_epi32(0xffff));
            self.max = _mm256_max_epi32(self.max, _mm256_max_epi32(even, odd));
        }
        // The lanes' total may pass `i32`; the eight lanes themselves do not.
        let [low, high] = [_mm256_castsi256_si128(self.sum), _mm256_extracti128_si256::<1>(self.sum)];
        let looked_for = DIFFERENCE == SIGNED && !KEPT;
        Row {
            sum: total(_mm256_add_epi64(_mm256_cvtepi32_epi64(low), _mm256_cvtepi32_epi64(high))),
            squares: if SQUARES { total(self.squares) } else { 0 },
            min: if looked_for { fold_lanes!(self.min, _mm_min_epi32) } else { least },
            max: if KEPT { largest_word(self.max) } else { largest(self.max) },
        }
    }
}

/// Sum of four lanes of 64 bits.
#[target_feature(enable = "avx2")]
#[inline]
fn total(v: __m256i) -> i64 {
    let half = _mm_add_epi64(_mm256_castsi256_si128(v), _mm256_extracti128_si256::<1>(v));
    _mm_cvtsi128_si64(_mm_add_epi64(half, _mm_unpackhi_epi64(half, half)))
}

/// The largest of sixteen words without sign.
#[target_feature(enable = "avx2")]
#[inline]
fn largest_word(v: __m256i) -> i32 {
    let half = _mm_max_epu16(_mm256_castsi256_si128(v), _mm256_extracti128_si256::<1>(v));
    // The processor finds the smallest: that of the complements is the largest of these.
    let least = _mm_cvtsi128_si32(_mm_minpos_epu16(_mm_xor_si128(half, _mm_set1_epi32(-1))));
    0xffff - (least & 0xffff)
}
