//! Weigh the differences of 32 pixels: the levels of equation 1 on 256-bit vectors.
//!
//! Three vectors hold 32 pixels of three bytes. Each is subtracted as it lies; the differences are then put in groups of
//! four pixels, and two multiplications of 16-bit pairs, blue with green and red alone, give the exact level.

#![allow(unsafe_code)]

use std::arch::x86_64::{
    __m256i, _mm_loadu_si128, _mm256_add_epi32, _mm256_alignr_epi8, _mm256_blend_epi32, _mm256_loadu_si256,
    _mm256_madd_epi16, _mm256_or_si256, _mm256_permute2x128_si256, _mm256_set_m128i, _mm256_set1_epi32,
    _mm256_setr_epi8, _mm256_shuffle_epi8, _mm256_srli_si256, _mm256_sub_epi16, _mm256_subs_epu8,
};
use std::array::from_fn;

use crate::kernel::{ABSOLUTE, SIGNED};

/// Pixels a vector of levels.
pub(super) const LANES: usize = 8;
/// Pixels a step, and its vectors of levels.
pub(super) const PIXELS: usize = 32;
pub(super) const GROUPS: usize = PIXELS / LANES;
/// Bytes a step, and of one vector of levels.
pub(super) const STEP: usize = 3 * PIXELS;
pub(super) const BYTES: usize = 3 * LANES;

/// The weights as 16-bit pairs, one a pixel.
#[derive(Clone, Copy)]
pub(super) struct Pairs {
    blue_green: __m256i,
    red: __m256i,
}

impl Pairs {
    #[target_feature(enable = "avx2")]
    pub(super) fn of(weights: [i32; 3]) -> Self {
        // `MAX_WEIGHT` keeps each in 16 bits.
        let pair = |low: i32, high: i32| _mm256_set1_epi32((low & 0xffff) | (high << 16));
        Self { blue_green: pair(weights[0], weights[1]), red: pair(weights[2], 0) }
    }
}

/// Blue and green, and red, of the four pixels at the beginning of each half, in 16 bits.
#[target_feature(enable = "avx2")]
#[inline]
fn spread(pixels: __m256i) -> (__m256i, __m256i) {
    let blue_green = _mm256_setr_epi8(
        0, -1, 1, -1, 3, -1, 4, -1, 6, -1, 7, -1, 9, -1, 10, -1, //
        0, -1, 1, -1, 3, -1, 4, -1, 6, -1, 7, -1, 9, -1, 10, -1,
    );
    let red = _mm256_setr_epi8(
        2, -1, -1, -1, 5, -1, -1, -1, 8, -1, -1, -1, 11, -1, -1, -1, //
        2, -1, -1, -1, 5, -1, -1, -1, 8, -1, -1, -1, 11, -1, -1, -1,
    );
    (_mm256_shuffle_epi8(pixels, blue_green), _mm256_shuffle_epi8(pixels, red))
}

#[target_feature(enable = "avx2")]
#[inline]
fn weigh((blue_green, red): (__m256i, __m256i), weights: Pairs) -> __m256i {
    _mm256_add_epi32(_mm256_madd_epi16(blue_green, weights.blue_green), _mm256_madd_epi16(red, weights.red))
}

/// The levels of pixels whose bytes lie at the beginning of each half.
#[target_feature(enable = "avx2")]
#[inline]
fn signed(frame: __m256i, baseline: __m256i, weights: Pairs) -> __m256i {
    let ((f, f_red), (b, b_red)) = (spread(frame), spread(baseline));
    weigh((_mm256_sub_epi16(f, b), _mm256_sub_epi16(f_red, b_red)), weights)
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
    // SAFETY: the three unaligned 32-byte loads are the 96 bytes.
    from_fn(|k| unsafe { _mm256_loadu_si256(bytes.as_ptr().add(32 * k).cast()) })
}

/// 32 pixels in groups of four: group k of the first half and group k + 4 begin the halves of vector k.
#[target_feature(enable = "avx2")]
#[inline]
fn grouped([first, second, third]: [__m256i; 3]) -> [__m256i; GROUPS] {
    let begin = _mm256_blend_epi32::<0b1111_0000>(first, second);
    let middle = _mm256_permute2x128_si256::<0x21>(first, third);
    let end = _mm256_blend_epi32::<0b1111_0000>(second, third);
    [
        begin,
        _mm256_alignr_epi8::<12>(middle, begin),
        _mm256_alignr_epi8::<8>(end, middle),
        _mm256_srli_si256::<4>(end),
    ]
}

/// The levels of 32 pixels, as [`grouped`] orders them.
#[target_feature(enable = "avx2")]
#[inline]
pub(super) fn levels<const DIFFERENCE: u8>(
    frame: &[u8; STEP],
    baseline: &[u8; STEP],
    weights: Pairs,
) -> [__m256i; GROUPS] {
    let (f, b) = (load(frame), load(baseline));
    if DIFFERENCE == SIGNED {
        let (f, b) = (grouped(f), grouped(b));
        from_fn(|k| signed(f[k], b[k], weights))
    } else {
        let d = grouped(from_fn(|k| unsigned::<DIFFERENCE>(f[k], b[k])));
        from_fn(|k| weigh(spread(d[k]), weights))
    }
}

/// The levels of eight pixels as they lie: what is left of a row.
#[target_feature(enable = "avx2")]
#[inline]
pub(super) fn levels_of_eight<const DIFFERENCE: u8>(
    frame: &[u8; BYTES],
    baseline: &[u8; BYTES],
    weights: Pairs,
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
        signed(f, b, weights)
    } else {
        weigh(spread(unsigned::<DIFFERENCE>(f, b)), weights)
    }
}
