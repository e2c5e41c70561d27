//! Row kernels for arm64: sixteen pixels a step, each channel in a vector of its own.
//!
//! The load that takes interleaved bytes apart gives the three channels; each is widened to 16 bits and multiplied on to
//! 32-bit sums. Every arm64 processor has these instructions, so nothing need be asked.

#![allow(unsafe_code)]

use std::arch::aarch64::{
    int16x8_t, int32x4_t, uint8x16_t, vabdq_u8, vaddlvq_s32, vaddq_s32, vaddq_s64, vaddvq_s64, vaddvq_u32,
    vcgeq_s32, vdupq_n_s32, vdupq_n_s64, vdupq_n_u32, vget_high_s16, vget_high_u8, vget_low_s16,
    vget_low_s32, vget_low_u8, vld1q_s32, vld3q_u8, vmaxq_s32, vmaxvq_s32, vminq_s32, vminvq_s32,
    vmlal_high_s32, vmlal_n_s16, vmlal_s32, vmovl_u8, vqsubq_u8, vreinterpretq_s16_u16, vst1q_s32, vsubl_u8,
    vsubq_u32,
};

use super::{ABSOLUTE, Kernel, RECTIFIED, Row, SIGNED};
use crate::frame::Difference;

/// Pixels a step.
const LANES: usize = 16;
/// Bytes a step.
const BYTES: usize = 3 * LANES;

/// The levels of sixteen pixels.
#[inline(always)]
fn levels<const DIFFERENCE: u8>(
    frame: &[u8; BYTES],
    baseline: &[u8; BYTES],
    weights: [i16; 3],
) -> [int32x4_t; 4] {
    // SAFETY: both loads take exactly the 48 bytes; the rest computes on registers, and NEON is part of arm64.
    unsafe {
        let (f, b) = (vld3q_u8(frame.as_ptr()), vld3q_u8(baseline.as_ptr()));
        let mut n = [vdupq_n_s32(0); 4];
        for (f, b, weight) in [(f.0, b.0, weights[0]), (f.1, b.1, weights[1]), (f.2, b.2, weights[2])] {
            for (half, d) in difference::<DIFFERENCE>(f, b).into_iter().enumerate() {
                n[2 * half] = vmlal_n_s16(n[2 * half], vget_low_s16(d), weight);
                n[2 * half + 1] = vmlal_n_s16(n[2 * half + 1], vget_high_s16(d), weight);
            }
        }
        n
    }
}

/// One channel's differences as words: the first eight pixels and the others.
#[inline(always)]
unsafe fn difference<const DIFFERENCE: u8>(f: uint8x16_t, b: uint8x16_t) -> [int16x8_t; 2] {
    // SAFETY: computes on registers only.
    unsafe {
        let words = if DIFFERENCE == SIGNED {
            [vsubl_u8(vget_low_u8(f), vget_low_u8(b)), vsubl_u8(vget_high_u8(f), vget_high_u8(b))]
        } else {
            let d = if DIFFERENCE == ABSOLUTE { vabdq_u8(f, b) } else { vqsubq_u8(f, b) };
            [vmovl_u8(vget_low_u8(d)), vmovl_u8(vget_high_u8(d))]
        };
        words.map(|half| vreinterpretq_s16_u16(half))
    }
}

/// See [`Kernel::rows`].
pub(super) fn rows(kernel: &Kernel, frame: &[u8], baseline: &[u8], columns: &mut [i32], rows: &mut [Row]) {
    rows_by_reading!(kernel, rows_of(frame, baseline, columns, rows));
}

fn rows_of<const DIFFERENCE: u8, const SQUARES: bool>(
    kernel: &Kernel,
    frame: &[u8],
    baseline: &[u8],
    columns: &mut [i32],
    rows: &mut [Row],
) {
    // Weights of this path fit 14 bits.
    let weights = kernel.weights.map(|weight| weight as i16);
    let bytes = 3 * columns.len();
    let (column_steps, columns_rest) = columns.as_chunks_mut::<LANES>();
    let images = frame.chunks_exact(bytes).zip(baseline.chunks_exact(bytes));
    for ((frame, baseline), row) in images.zip(rows) {
        let (steps, rest) = frame.as_chunks::<BYTES>();
        let (baseline_steps, baseline_rest) = baseline.as_chunks::<BYTES>();
        let tail = kernel.row(rest, baseline_rest, columns_rest);
        // SAFETY: loads and stores stay within the sixteen columns of a step; the rest computes on registers.
        *row = unsafe {
            let mut sums = [vdupq_n_s32(0); 4];
            let mut squares = vdupq_n_s64(0);
            let (mut min, mut max) = (vdupq_n_s32(i32::MAX), vdupq_n_s32(i32::MIN));
            for ((f, b), column) in steps.iter().zip(baseline_steps).zip(column_steps.iter_mut()) {
                let n = levels::<DIFFERENCE>(f, b, weights);
                for (quarter, (n, column)) in n.into_iter().zip(column.as_chunks_mut::<4>().0).enumerate() {
                    vst1q_s32(column.as_mut_ptr(), vaddq_s32(vld1q_s32(column.as_ptr()), n));
                    sums[quarter] = vaddq_s32(sums[quarter], n);
                    max = vmaxq_s32(max, n);
                    if DIFFERENCE == SIGNED {
                        min = vminq_s32(min, n);
                    }
                    if SQUARES {
                        let low = vmlal_s32(vdupq_n_s64(0), vget_low_s32(n), vget_low_s32(n));
                        squares = vaddq_s64(squares, vmlal_high_s32(low, n, n));
                    }
                }
            }
            let least = if DIFFERENCE == SIGNED { vminvq_s32(min) } else { kernel.least() };
            Row {
                // The lanes' total may pass `i32`; the lanes themselves do not.
                sum: tail.sum + sums.into_iter().map(|lanes| vaddlvq_s32(lanes)).sum::<i64>(),
                squares: tail.squares + vaddvq_s64(squares),
                min: least.min(tail.min),
                max: vmaxvq_s32(max).max(tail.max),
            }
        };
    }
}

/// See [`Kernel::count`].
pub(super) fn count(kernel: &Kernel, frame: &[u8], baseline: &[u8], first: i32) -> u32 {
    count_by_reading!(kernel, count_of(frame, baseline, first))
}

fn count_of<const DIFFERENCE: u8>(kernel: &Kernel, frame: &[u8], baseline: &[u8], first: i32) -> u32 {
    let weights = kernel.weights.map(|weight| weight as i16);
    let (steps, rest) = frame.as_chunks::<BYTES>();
    let (baseline_steps, baseline_rest) = baseline.as_chunks::<BYTES>();
    // SAFETY: computes on registers only.
    let above = unsafe {
        let border = vdupq_n_s32(first);
        let mut above = vdupq_n_u32(0);
        for (f, b) in steps.iter().zip(baseline_steps) {
            for n in levels::<DIFFERENCE>(f, b, weights) {
                // A true comparison is −1, so subtracting it counts.
                above = vsubq_u32(above, vcgeq_s32(n, border));
            }
        }
        vaddvq_u32(above)
    };
    above + kernel.count_plain(rest, baseline_rest, first)
}
