//! Row kernels on 512-bit vectors: sixteen pixels a step.
//!
//! As on 256 bits a level is put together from the halves of its weights, `n = 128·Σ high·d + Σ low·d`; here each sum is
//! one multiplication of bytes that adds on in 32 bits (VNNI), and a signed difference is that of frame and baseline.

#![allow(unsafe_code)]

use std::arch::x86_64::{
    __m512i, _mm256_storeu_si256, _mm512_add_epi32, _mm512_add_epi64, _mm512_castsi512_si256,
    _mm512_cmplt_epi32_mask, _mm512_dpbusd_epi32, _mm512_loadu_si512, _mm512_maskz_loadu_epi8,
    _mm512_maskz_permutexvar_epi8, _mm512_maskz_set1_epi32, _mm512_max_epi32, _mm512_min_epi32,
    _mm512_mul_epi32, _mm512_or_si512, _mm512_reduce_add_epi32, _mm512_set1_epi32, _mm512_setzero_si512,
    _mm512_shuffle_i64x2, _mm512_slli_epi32, _mm512_slli_epi64, _mm512_srai_epi64, _mm512_srli_epi64,
    _mm512_storeu_si512, _mm512_subs_epu8, _mm512_unpackhi_epi32, _mm512_unpackhi_epi64,
    _mm512_unpacklo_epi32, _mm512_unpacklo_epi64,
};

use super::{ABSOLUTE, Kernel, RECTIFIED, Row, SIGNED, halves};
use crate::frame::Difference;

/// Pixels a step.
const LANES: usize = 16;
/// Bytes a step.
const BYTES: usize = 3 * LANES;
/// Bytes of a vector.
const VECTOR: usize = 64;

/// Where each byte of a vector comes from: one pixel to each group of four, whose last byte is left 0.
const GROUPS: [u8; VECTOR] = {
    let mut from = [0; VECTOR];
    let mut at = 0;
    while at < VECTOR {
        from[at] = (3 * (at / 4) + at % 4) as u8;
        at += 1;
    }
    from
};
const PIXELS: u64 = 0x7777_7777_7777_7777;

/// What the steps of one call share.
#[derive(Clone, Copy)]
struct Constants {
    groups: __m512i,
    low: __m512i,
    high: __m512i,
    minus_low: __m512i,
    minus_high: __m512i,
}

impl Constants {
    #[target_feature(enable = "avx512f")]
    fn of(weights: [i32; 3]) -> Self {
        let (low, high) = halves(weights);
        let group = |bytes: [i32; 3]| {
            let byte = |c: usize| u32::from(bytes[c] as i8 as u8) << (8 * c);
            _mm512_set1_epi32((byte(0) | byte(1) | byte(2)) as i32)
        };
        Self {
            // SAFETY: the table is as long as a vector.
            groups: unsafe { _mm512_loadu_si512(GROUPS.as_ptr().cast()) },
            low: group(low),
            high: group(high),
            minus_low: group(low.map(|half| -half)),
            minus_high: group(high.map(|half| -half)),
        }
    }
}

/// Sixteen pixels at `at`, and whatever follows them.
///
/// # Safety
/// 64 bytes must be readable from `at`, or 48 where `LAST`.
#[target_feature(enable = "avx512f,avx512bw")]
#[inline]
unsafe fn load<const LAST: bool>(at: *const u8) -> __m512i {
    if LAST {
        // SAFETY: the mask keeps the load within the 48 bytes that the caller vouches for.
        unsafe { _mm512_maskz_loadu_epi8((1 << BYTES) - 1, at.cast()) }
    } else {
        // SAFETY: vouched for by the caller.
        unsafe { _mm512_loadu_si512(at.cast()) }
    }
}

/// The levels of sixteen pixels.
///
/// # Safety
/// As for [`load`], of both images.
#[target_feature(enable = "avx512f,avx512bw,avx512vbmi,avx512vnni")]
#[inline]
unsafe fn levels<const DIFFERENCE: u8, const LAST: bool>(
    frame: *const u8,
    baseline: *const u8,
    k: &Constants,
) -> __m512i {
    // SAFETY: vouched for by the caller.
    let (f, b) = unsafe { (load::<LAST>(frame), load::<LAST>(baseline)) };
    let groups = |v| _mm512_maskz_permutexvar_epi8(PIXELS, k.groups, v);
    let zero = _mm512_setzero_si512();
    if DIFFERENCE == SIGNED {
        let (f, b) = (groups(f), groups(b));
        let high = _mm512_dpbusd_epi32(_mm512_dpbusd_epi32(zero, f, k.high), b, k.minus_high);
        let high = _mm512_slli_epi32::<7>(high);
        _mm512_dpbusd_epi32(_mm512_dpbusd_epi32(high, f, k.low), b, k.minus_low)
    } else {
        let rise = _mm512_subs_epu8(f, b);
        let d = if DIFFERENCE == ABSOLUTE { _mm512_or_si512(rise, _mm512_subs_epu8(b, f)) } else { rise };
        let d = groups(d);
        let high = _mm512_slli_epi32::<7>(_mm512_dpbusd_epi32(zero, d, k.high));
        _mm512_dpbusd_epi32(high, d, k.low)
    }
}

/// How many of a row's steps may be loaded whole: those with 64 bytes left in the slice behind them.
fn whole_steps(steps: usize, bytes_left: usize) -> usize {
    if bytes_left < VECTOR { 0 } else { steps.min((bytes_left - VECTOR) / BYTES + 1) }
}

/// See [`Kernel::rows`].
#[target_feature(enable = "avx512f,avx512bw,avx512vbmi,avx512vnni")]
pub(super) fn rows(kernel: &Kernel, frame: &[u8], baseline: &[u8], columns: &mut [i32], rows: &mut Vec<Row>) {
    rows_by_reading!(kernel, rows_of(frame, baseline, columns, rows));
}

/// Rows whose lanes are added up together.
const BLOCK: usize = 8;

/// Lanes of the rows of a block, filled one row after the other.
struct Block {
    sum: [__m512i; BLOCK],
    squares: [__m512i; BLOCK],
    min: [__m512i; BLOCK],
    max: [__m512i; BLOCK],
}

/// The sums of eight rows of eight 64-bit lanes.
#[target_feature(enable = "avx512f")]
fn sums(rows: &[__m512i; BLOCK]) -> [i64; BLOCK] {
    let pair = |a, b| _mm512_add_epi64(_mm512_unpacklo_epi64(a, b), _mm512_unpackhi_epi64(a, b));
    let halves = |a, b| {
        let (even, odd) = (_mm512_shuffle_i64x2::<EVEN>(a, b), _mm512_shuffle_i64x2::<ODD>(a, b));
        _mm512_add_epi64(even, odd)
    };
    let [a, b, c, d, e, f, g, h] = *rows;
    let all = halves(halves(pair(a, b), pair(c, d)), halves(pair(e, f), pair(g, h)));
    let mut out = [0; BLOCK];
    // SAFETY: `out` is exactly 64 bytes.
    unsafe { _mm512_storeu_si512(out.as_mut_ptr().cast(), all) };
    out
}

/// 128-bit quarters 0 and 2 of both operands, and 1 and 3.
const EVEN: i32 = 0b10_00_10_00;
const ODD: i32 = 0b11_01_11_01;

/// Largest or smallest lane of each of eight rows of sixteen 32-bit lanes.
macro_rules! extremes {
    ($rows:expr, $op:ident) => {{
        let [a, b, c, d, e, f, g, h] = $rows;
        let pair = |a, b| $op(_mm512_unpacklo_epi32(a, b), _mm512_unpackhi_epi32(a, b));
        let four = |a, b| $op(_mm512_unpacklo_epi64(a, b), _mm512_unpackhi_epi64(a, b));
        let (low, high) = (four(pair(a, b), pair(c, d)), four(pair(e, f), pair(g, h)));
        let halves = $op(_mm512_shuffle_i64x2::<EVEN>(low, high), _mm512_shuffle_i64x2::<ODD>(low, high));
        let all =
            $op(_mm512_shuffle_i64x2::<EVEN>(halves, halves), _mm512_shuffle_i64x2::<ODD>(halves, halves));
        let mut out = [0; BLOCK];
        // SAFETY: `out` is exactly the 32 bytes of the lower half.
        unsafe { _mm256_storeu_si256(out.as_mut_ptr().cast(), _mm512_castsi512_si256(all)) };
        out
    }};
}

#[target_feature(enable = "avx512f,avx512bw,avx512vbmi,avx512vnni")]
fn rows_of<const DIFFERENCE: u8, const SQUARES: bool>(
    kernel: &Kernel,
    frame: &[u8],
    baseline: &[u8],
    columns: &mut [i32],
    rows: &mut Vec<Row>,
) {
    let k = Constants::of(kernel.weights);
    let zero = _mm512_setzero_si512();
    let bytes = 3 * columns.len();
    let steps = columns.len() / LANES;
    let total = frame.len().min(baseline.len());
    let mut block =
        Block { sum: [zero; BLOCK], squares: [zero; BLOCK], min: [zero; BLOCK], max: [zero; BLOCK] };
    for first in (0..total).step_by(BLOCK * bytes) {
        let height = BLOCK.min((total - first) / bytes);
        for row in 0..height {
            let start = first + row * bytes;
            let whole = whole_steps(steps, total - start);
            let (mut sum, mut squares) = (zero, zero);
            let (mut min, mut max) = (_mm512_set1_epi32(i32::MAX), _mm512_set1_epi32(i32::MIN));
            let mut add = |n: __m512i, step: usize| {
                // SAFETY: `step` is below `steps`, so that sixteen columns follow.
                unsafe {
                    let column = columns.as_mut_ptr().add(LANES * step).cast();
                    _mm512_storeu_si512(column, _mm512_add_epi32(_mm512_loadu_si512(column), n));
                }
                sum = _mm512_add_epi32(sum, n);
                max = _mm512_max_epi32(max, n);
                if DIFFERENCE == SIGNED {
                    min = _mm512_min_epi32(min, n);
                }
                if SQUARES {
                    let odd = _mm512_srli_epi64::<32>(n);
                    squares = _mm512_add_epi64(squares, _mm512_mul_epi32(n, n));
                    squares = _mm512_add_epi64(squares, _mm512_mul_epi32(odd, odd));
                }
            };
            for step in 0..whole {
                let at = start + BYTES * step;
                // SAFETY: `whole_steps` leaves 64 bytes behind `at` in both slices.
                add(
                    unsafe {
                        levels::<DIFFERENCE, false>(frame.as_ptr().add(at), baseline.as_ptr().add(at), &k)
                    },
                    step,
                );
            }
            for step in whole..steps {
                let at = start + BYTES * step;
                // SAFETY: a step is 48 bytes of the row.
                add(
                    unsafe {
                        levels::<DIFFERENCE, true>(frame.as_ptr().add(at), baseline.as_ptr().add(at), &k)
                    },
                    step,
                );
            }
            // A row's total may pass `i32`; its sixteen lanes do not.
            let even = _mm512_srai_epi64::<32>(_mm512_slli_epi64::<32>(sum));
            block.sum[row] = _mm512_add_epi64(even, _mm512_srai_epi64::<32>(sum));
            block.squares[row] = squares;
            block.min[row] = min;
            block.max[row] = max;
        }
        let sum = sums(&block.sum);
        let squares = if SQUARES { sums(&block.squares) } else { [0; BLOCK] };
        let max: [i32; BLOCK] = extremes!(block.max, _mm512_max_epi32);
        let min: [i32; BLOCK] = if DIFFERENCE == SIGNED {
            extremes!(block.min, _mm512_min_epi32)
        } else {
            [kernel.least(); BLOCK]
        };
        for row in 0..height {
            rows.push(Row { sum: sum[row], squares: squares[row], min: min[row], max: max[row] });
        }
        if !columns.len().is_multiple_of(LANES) {
            for (row, sums) in rows.iter_mut().rev().take(height).rev().enumerate() {
                let start = first + row * bytes;
                let rest = start + BYTES * steps..start + bytes;
                sums.merge(kernel.row(&frame[rest.clone()], &baseline[rest], &mut columns[LANES * steps..]));
            }
        }
    }
}

/// See [`Kernel::count`].
#[target_feature(enable = "avx512f,avx512bw,avx512vbmi,avx512vnni")]
pub(super) fn count(kernel: &Kernel, frame: &[u8], baseline: &[u8], first: i32) -> u32 {
    count_by_reading!(kernel, count_of(frame, baseline, first))
}

#[target_feature(enable = "avx512f,avx512bw,avx512vbmi,avx512vnni")]
fn count_of<const DIFFERENCE: u8>(kernel: &Kernel, frame: &[u8], baseline: &[u8], first: i32) -> u32 {
    let border = _mm512_set1_epi32(first);
    let k = Constants::of(kernel.weights);
    let total = frame.len().min(baseline.len());
    let steps = total / BYTES;
    let whole = whole_steps(steps, total);
    let mut below = _mm512_setzero_si512();
    let mut add = |n| {
        let one = _mm512_maskz_set1_epi32(_mm512_cmplt_epi32_mask(n, border), 1);
        below = _mm512_add_epi32(below, one);
    };
    for step in 0..whole {
        let at = BYTES * step;
        // SAFETY: `whole_steps` leaves 64 bytes behind `at` in both slices.
        add(unsafe { levels::<DIFFERENCE, false>(frame.as_ptr().add(at), baseline.as_ptr().add(at), &k) });
    }
    for step in whole..steps {
        let at = BYTES * step;
        // SAFETY: a step is 48 bytes of both slices.
        add(unsafe { levels::<DIFFERENCE, true>(frame.as_ptr().add(at), baseline.as_ptr().add(at), &k) });
    }
    let rest = BYTES * steps..total;
    (steps * LANES) as u32 - _mm512_reduce_add_epi32(below) as u32
        + kernel.count_plain(&frame[rest.clone()], &baseline[rest], first)
}
