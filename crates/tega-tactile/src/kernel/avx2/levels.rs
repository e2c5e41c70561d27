//! Weigh the differences of 32 pixels: the levels of equation 1 on 256-bit vectors.
//!
//! Three vectors hold 32 pixels of three bytes. Each is subtracted as it lies, where differences have no sign; the bytes
//! are then put in groups of four pixels, and [`Factors`] weigh them: a multiplication of bytes, one of words.

#![allow(unsafe_code)]

use std::arch::x86_64::{
    __m256i, _mm_loadu_si128, _mm256_add_epi32, _mm256_blend_epi32, _mm256_loadu_si256, _mm256_madd_epi16,
    _mm256_maddubs_epi16, _mm256_or_si256, _mm256_permute2x128_si256, _mm256_set_m128i, _mm256_set1_epi32,
    _mm256_shuffle_epi8, _mm256_srli_si256, _mm256_sub_epi16, _mm256_subs_epu8,
};
use std::array::from_fn;

use crate::kernel::factors::Factors;
use crate::kernel::{ABSOLUTE, SIGNED};

/// Pixels a vector of levels.
pub(super) const LANES: usize = 8;
/// Pixels a step, and its vectors of levels.
pub(super) const PIXELS: usize = 32;
pub(super) const GROUPS: usize = PIXELS / LANES;
/// Bytes a step, and of one vector of levels.
pub(super) const STEP: usize = 3 * PIXELS;
pub(super) const BYTES: usize = 3 * LANES;

/// [`Factors`] as vectors: one set, or two of the same channels whose products are added.
#[derive(Clone, Copy)]
pub(super) struct Products<const SETS: usize> {
    /// Where the four bytes of each pixel of group k are, in a half of what [`grouped`] makes of it.
    at: [__m256i; GROUPS],
    bytes: [__m256i; SETS],
    words: [__m256i; SETS],
}

impl<const SETS: usize> Products<SETS> {
    #[target_feature(enable = "avx2")]
    pub(super) fn of(sets: [Factors; SETS]) -> Self {
        let at = from_fn(|group| {
            let at: [u8; 16] =
                from_fn(|k| (12 * group as u8 + 3 * (k as u8 / 4) + sets[0].channels[k % 4]) % 16);
            // SAFETY: an unaligned 16-byte load of 16 bytes.
            let at = unsafe { _mm_loadu_si128(at.as_ptr().cast()) };
            _mm256_set_m128i(at, at)
        });
        let words = |[low, high]: [i16; 2]| (i32::from(low) & 0xffff) | (i32::from(high) << 16);
        Self {
            at,
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

    /// The levels of group `k`'s differences.
    #[target_feature(enable = "avx2")]
    #[inline]
    fn of_differences(&self, k: usize, differences: __m256i) -> __m256i {
        let pixels = _mm256_shuffle_epi8(differences, self.at[k]);
        self.weigh(|bytes| _mm256_maddubs_epi16(pixels, bytes))
    }

    /// The signed levels of group `k`. No sum of a pair leaves 16 bits, nor does that of the pair's differences.
    #[target_feature(enable = "avx2")]
    #[inline]
    fn of_both(&self, k: usize, frame: __m256i, baseline: __m256i) -> __m256i {
        let (f, b) = (_mm256_shuffle_epi8(frame, self.at[k]), _mm256_shuffle_epi8(baseline, self.at[k]));
        self.weigh(|bytes| _mm256_sub_epi16(_mm256_maddubs_epi16(f, bytes), _mm256_maddubs_epi16(b, bytes)))
    }
}

/// |f − b|, or what f rises above b.
#[target_feature(enable = "avx2")]
#[inline]
fn unsigned<const DIFFERENCE: u8>(f: __m256i, b: __m256i) -> __m256i {
    let rise = _mm256_subs_epu8(f, b);
    if DIFFERENCE == ABSOLUTE { _mm256_or_si256(rise, _mm256_subs_epu8(b, f)) } else { rise }
}

/// 32 pixels as they lie.
#[target_feature(enable = "avx2")]
#[inline]
fn load(bytes: &[u8; STEP]) -> [__m256i; 3] {
    let [first, second, third] = [0, 32, 64].map(|at| bytes[at..].as_ptr().cast());
    // SAFETY: the three unaligned 32-byte loads are the 96 bytes.
    unsafe { [_mm256_loadu_si256(first), _mm256_loadu_si256(second), _mm256_loadu_si256(third)] }
}

/// 32 pixels in groups of four: group k of the first half is somewhere in the low half of vector k, and group k + 4 in
/// the high one. Its twelve bytes begin at byte 12 k, counted round the half's sixteen.
#[target_feature(enable = "avx2")]
#[inline]
fn grouped([first, second, third]: [__m256i; 3]) -> [__m256i; GROUPS] {
    let begin = _mm256_blend_epi32::<0b1111_0000>(first, second);
    let middle = _mm256_permute2x128_si256::<0x21>(first, third);
    let end = _mm256_blend_epi32::<0b1111_0000>(second, third);
    [
        begin,
        _mm256_blend_epi32::<0b1000_1000>(middle, begin),
        _mm256_blend_epi32::<0b1100_1100>(end, middle),
        end,
    ]
}

/// The levels of 32 pixels, as [`grouped`] orders them.
#[target_feature(enable = "avx2")]
#[inline]
pub(super) fn levels<const DIFFERENCE: u8, const SETS: usize>(
    frame: &[u8; STEP],
    baseline: &[u8; STEP],
    products: &Products<SETS>,
) -> [__m256i; GROUPS] {
    let (f, b) = (load(frame), load(baseline));
    if DIFFERENCE == SIGNED {
        let (f, b) = (grouped(f), grouped(b));
        let n = |k: usize| products.of_both(k, f[k], b[k]);
        [n(0), n(1), n(2), n(3)]
    } else {
        let d = |k: usize| unsigned::<DIFFERENCE>(f[k], b[k]);
        let d = grouped([d(0), d(1), d(2)]);
        let n = |k: usize| products.of_differences(k, d[k]);
        [n(0), n(1), n(2), n(3)]
    }
}

/// The levels of eight pixels as they lie: what is left of a row.
#[target_feature(enable = "avx2")]
#[inline]
pub(super) fn levels_of_eight<const DIFFERENCE: u8, const SETS: usize>(
    frame: &[u8; BYTES],
    baseline: &[u8; BYTES],
    products: &Products<SETS>,
) -> __m256i {
    // Bytes 0 to 15, and 8 to 23 moved down by 4.
    let load = |bytes: &[u8; BYTES]| {
        let at = bytes.as_ptr();
        // SAFETY: both unaligned 16-byte loads lie within the 24 bytes.
        let pixels =
            unsafe { _mm256_set_m128i(_mm_loadu_si128(at.add(8).cast()), _mm_loadu_si128(at.cast())) };
        _mm256_blend_epi32::<0b1111_0000>(pixels, _mm256_srli_si256::<4>(pixels))
    };
    let (f, b) = (load(frame), load(baseline));
    if DIFFERENCE == SIGNED {
        products.of_both(0, f, b)
    } else {
        products.of_differences(0, unsigned::<DIFFERENCE>(f, b))
    }
}
