//! Row kernels on 256-bit vectors: eight pixels a step.
//!
//! A weight `a` is split as `a = 128·high + low` with both halves in the range of a signed byte, so that two byte
//! multiplications give the exact level: `n = Σ low·d + 128·Σ high·d`. With `|low| ≤ 64` and `|high| ≤ 64` no 16-bit sum
//! of two products leaves its range, and a difference of two such sums is right even where it wraps on the way.

#![allow(unsafe_code)]

use std::arch::x86_64::{
    __m256i, _mm_cvtsi128_si32, _mm_loadu_si128, _mm_max_epi32, _mm_min_epi32, _mm_shuffle_epi32,
    _mm256_add_epi32, _mm256_add_epi64, _mm256_castsi256_si128, _mm256_cmpgt_epi32, _mm256_cvtepi32_epi64,
    _mm256_extracti128_si256, _mm256_loadu_si256, _mm256_madd_epi16, _mm256_maddubs_epi16, _mm256_max_epi32,
    _mm256_min_epi32, _mm256_mul_epi32, _mm256_or_si256, _mm256_set_m128i, _mm256_set1_epi16,
    _mm256_set1_epi32, _mm256_setr_epi8, _mm256_setzero_si256, _mm256_shuffle_epi8, _mm256_srli_epi64,
    _mm256_storeu_si256, _mm256_sub_epi16, _mm256_sub_epi32, _mm256_subs_epu8,
};

use super::{ABSOLUTE, Kernel, RECTIFIED, Row, SIGNED, halves};
use crate::frame::Difference;

/// Pixels a step.
const LANES: usize = 8;
/// Bytes a step.
const BYTES: usize = 3 * LANES;

/// The weights' halves, one 4-byte group a pixel.
#[derive(Clone, Copy)]
struct Halves {
    low: __m256i,
    high: __m256i,
}

impl Halves {
    #[target_feature(enable = "avx2")]
    fn of(weights: [i32; 3]) -> Self {
        let group = |bytes: [i32; 3]| {
            let byte = |c: usize| u32::from(bytes[c] as i8 as u8) << (8 * c);
            _mm256_set1_epi32((byte(0) | byte(1) | byte(2)) as i32)
        };
        let (low, high) = halves(weights);
        Self { low: group(low), high: group(high) }
    }
}

/// Eight pixels as they lie: bytes 0 to 15 in the lower half, 8 to 23 in the upper one.
#[target_feature(enable = "avx2")]
#[inline]
fn load(bytes: &[u8; BYTES]) -> __m256i {
    let at = bytes.as_ptr();
    // SAFETY: both unaligned 16-byte loads lie within the 24 bytes.
    unsafe { _mm256_set_m128i(_mm_loadu_si128(at.add(8).cast()), _mm_loadu_si128(at.cast())) }
}

/// One pixel in each 4-byte group, its fourth byte 0.
#[target_feature(enable = "avx2")]
#[inline]
fn spread(pixels: __m256i) -> __m256i {
    let groups = _mm256_setr_epi8(
        0, 1, 2, -1, 3, 4, 5, -1, 6, 7, 8, -1, 9, 10, 11, -1, //
        4, 5, 6, -1, 7, 8, 9, -1, 10, 11, 12, -1, 13, 14, 15, -1,
    );
    _mm256_shuffle_epi8(pixels, groups)
}

/// The levels of eight pixels.
#[target_feature(enable = "avx2")]
#[inline]
fn levels<const DIFFERENCE: u8>(frame: &[u8; BYTES], baseline: &[u8; BYTES], weights: Halves) -> __m256i {
    let (f, b) = (load(frame), load(baseline));
    let (low, high) = if DIFFERENCE == SIGNED {
        let (f, b) = (spread(f), spread(b));
        let part = |half| _mm256_sub_epi16(_mm256_maddubs_epi16(f, half), _mm256_maddubs_epi16(b, half));
        (part(weights.low), part(weights.high))
    } else {
        let rise = _mm256_subs_epu8(f, b);
        let d = if DIFFERENCE == ABSOLUTE { _mm256_or_si256(rise, _mm256_subs_epu8(b, f)) } else { rise };
        let d = spread(d);
        (_mm256_maddubs_epi16(d, weights.low), _mm256_maddubs_epi16(d, weights.high))
    };
    _mm256_add_epi32(
        _mm256_madd_epi16(low, _mm256_set1_epi16(1)),
        _mm256_madd_epi16(high, _mm256_set1_epi16(128)),
    )
}

#[target_feature(enable = "avx2")]
#[inline]
fn lanes_i32(v: __m256i) -> [i32; LANES] {
    let mut out = [0; LANES];
    // SAFETY: `out` is exactly 32 bytes.
    unsafe { _mm256_storeu_si256(out.as_mut_ptr().cast(), v) };
    out
}

#[target_feature(enable = "avx2")]
#[inline]
fn lanes_i64(v: __m256i) -> [i64; LANES / 2] {
    let mut out = [0; LANES / 2];
    // SAFETY: `out` is exactly 32 bytes.
    unsafe { _mm256_storeu_si256(out.as_mut_ptr().cast(), v) };
    out
}

/// Sum, smallest or largest of eight lanes.
macro_rules! fold_lanes {
    ($v:expr, $op:ident) => {{
        let v = $v;
        let half = $op(_mm256_castsi256_si128(v), _mm256_extracti128_si256::<1>(v));
        let pair = $op(half, _mm_shuffle_epi32::<0b01_00_11_10>(half));
        _mm_cvtsi128_si32($op(pair, _mm_shuffle_epi32::<0b10_11_00_01>(pair)))
    }};
}

/// See [`Kernel::rows`].
#[target_feature(enable = "avx2")]
pub(super) fn rows(kernel: &Kernel, frame: &[u8], baseline: &[u8], columns: &mut [i32], rows: &mut Vec<Row>) {
    rows_by_reading!(kernel, rows_of(frame, baseline, columns, rows));
}

#[target_feature(enable = "avx2")]
fn rows_of<const DIFFERENCE: u8, const SQUARES: bool>(
    kernel: &Kernel,
    frame: &[u8],
    baseline: &[u8],
    columns: &mut [i32],
    rows: &mut Vec<Row>,
) {
    let weights = Halves::of(kernel.weights);
    let bytes = 3 * columns.len();
    let (column_steps, columns_rest) = columns.as_chunks_mut::<LANES>();
    for (frame, baseline) in frame.chunks_exact(bytes).zip(baseline.chunks_exact(bytes)) {
        let (steps, rest) = frame.as_chunks::<BYTES>();
        let (baseline_steps, baseline_rest) = baseline.as_chunks::<BYTES>();
        let (mut sum, mut squares) = (_mm256_setzero_si256(), _mm256_setzero_si256());
        let (mut min, mut max) = (_mm256_set1_epi32(i32::MAX), _mm256_set1_epi32(i32::MIN));
        for ((f, b), column) in steps.iter().zip(baseline_steps).zip(column_steps.iter_mut()) {
            let n = levels::<DIFFERENCE>(f, b, weights);
            let at = column.as_mut_ptr().cast();
            // SAFETY: `column` is exactly 32 bytes, borrowed mutably.
            unsafe { _mm256_storeu_si256(at, _mm256_add_epi32(_mm256_loadu_si256(at), n)) };
            sum = _mm256_add_epi32(sum, n);
            if DIFFERENCE == SIGNED {
                min = _mm256_min_epi32(min, n);
            }
            max = _mm256_max_epi32(max, n);
            if SQUARES {
                let odd = _mm256_srli_epi64::<32>(n);
                squares = _mm256_add_epi64(squares, _mm256_mul_epi32(n, n));
                squares = _mm256_add_epi64(squares, _mm256_mul_epi32(odd, odd));
            }
        }
        let tail = kernel.row(rest, baseline_rest, columns_rest);
        let squares = if SQUARES { lanes_i64(squares).iter().sum::<i64>() } else { 0 };
        // The lanes' total may pass `i32`; the eight lanes themselves do not.
        let [low, high] = [_mm256_castsi256_si128(sum), _mm256_extracti128_si256::<1>(sum)];
        let wide = _mm256_add_epi64(_mm256_cvtepi32_epi64(low), _mm256_cvtepi32_epi64(high));
        rows.push(Row {
            sum: tail.sum + lanes_i64(wide).iter().sum::<i64>(),
            squares: tail.squares + squares,
            min: if DIFFERENCE == SIGNED { fold_lanes!(min, _mm_min_epi32).min(tail.min) } else { tail.min },
            max: fold_lanes!(max, _mm_max_epi32).max(tail.max),
        });
    }
}

/// See [`Kernel::count`].
#[target_feature(enable = "avx2")]
pub(super) fn count(kernel: &Kernel, frame: &[u8], baseline: &[u8], first: i32) -> u32 {
    count_by_reading!(kernel, count_of(frame, baseline, first))
}

#[target_feature(enable = "avx2")]
fn count_of<const DIFFERENCE: u8>(kernel: &Kernel, frame: &[u8], baseline: &[u8], first: i32) -> u32 {
    let weights = Halves::of(kernel.weights);
    let (steps, rest) = frame.as_chunks::<BYTES>();
    let (baseline_steps, baseline_rest) = baseline.as_chunks::<BYTES>();
    let border = _mm256_set1_epi32(first);
    let mut below = _mm256_setzero_si256();
    for (f, b) in steps.iter().zip(baseline_steps) {
        // A true comparison is −1, so subtracting it counts.
        below = _mm256_sub_epi32(below, _mm256_cmpgt_epi32(border, levels::<DIFFERENCE>(f, b, weights)));
    }
    let below: i32 = lanes_i32(below).iter().sum();
    (steps.len() * LANES) as u32 - below as u32 + kernel.count_plain(rest, baseline_rest, first)
}
