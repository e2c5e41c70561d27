//! Row kernels for arm64: sixteen pixels a step, each channel in a vector of its own.
//!
//! The load that takes interleaved bytes apart gives the three channels; each is widened to 16 bits and multiplied on to
//! 32-bit sums. A row's last step overlaps the one before it, where its pixels are not a multiple of sixteen. Every arm64 processor has these instructions, so nothing need be asked.

#![allow(unsafe_code)]

use std::arch::aarch64::{
    int16x8_t, int32x4_t, int64x2_t, uint8x16_t, vabdq_u8, vaddlvq_s32, vaddq_s32, vaddq_s64, vaddvq_s64,
    vaddvq_u32, vandq_s32, vandq_u32, vcgeq_s32, vdupq_n_s32, vdupq_n_s64, vdupq_n_u32, vget_high_s16,
    vget_high_u8, vget_low_s16, vget_low_s32, vget_low_u8, vld1q_s32, vld3q_u8, vmaxq_s32, vmaxvq_s32,
    vminq_s32, vminvq_s32, vmlal_high_s32, vmlal_n_s16, vmlal_s32, vmovl_u8, vqsubq_u8,
    vreinterpretq_s16_u16, vreinterpretq_u32_s32, vst1q_s32, vsubl_u8, vsubq_u32,
};

use super::{ABSOLUTE, Images, Kernel, RECTIFIED, Row, SIGNED};
use crate::frame::Difference;

/// Pixels a step.
pub(super) const LANES: usize = 16;
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
pub(super) fn rows<'r>(
    kernel: &Kernel,
    images: &mut impl Iterator<Item = Images<'r>>,
    columns: &mut [i32],
    rows: &mut [Row],
) {
    rows_by_reading!(kernel, rows_of(images, columns, rows));
}

/// Sums and range of a row's levels.
#[derive(Clone, Copy)]
struct Lanes {
    sums: [int32x4_t; 4],
    squares: int64x2_t,
    min: int32x4_t,
    max: int32x4_t,
}

impl Lanes {
    fn none() -> Self {
        // SAFETY: computes on registers only.
        unsafe {
            let zero = vdupq_n_s32(0);
            let (min, max) = (vdupq_n_s32(i32::MAX), vdupq_n_s32(i32::MIN));
            Self { sums: [zero; 4], squares: vdupq_n_s64(0), min, max }
        }
    }

    /// Takes sixteen levels; those whose pixels are not `new` are in the sums already.
    #[inline(always)]
    fn take<const DIFFERENCE: u8, const SQUARES: bool>(
        &mut self,
        levels: [int32x4_t; 4],
        new: [int32x4_t; 4],
        columns: &mut [i32; LANES],
    ) {
        let quarters = self.sums.iter_mut().zip(columns.as_chunks_mut::<4>().0);
        for ((n, new), (sum, column)) in levels.into_iter().zip(new).zip(quarters) {
            // SAFETY: loads and stores stay within the four columns; the rest computes on registers.
            unsafe {
                self.max = vmaxq_s32(self.max, n);
                if DIFFERENCE == SIGNED {
                    self.min = vminq_s32(self.min, n);
                }
                let n = vandq_s32(n, new);
                vst1q_s32(column.as_mut_ptr(), vaddq_s32(vld1q_s32(column.as_ptr()), n));
                *sum = vaddq_s32(*sum, n);
                if SQUARES {
                    let low = vmlal_s32(vdupq_n_s64(0), vget_low_s32(n), vget_low_s32(n));
                    self.squares = vaddq_s64(self.squares, vmlal_high_s32(low, n, n));
                }
            }
        }
    }

    #[inline(always)]
    fn row<const DIFFERENCE: u8>(&self, least: i32) -> Row {
        // SAFETY: computes on registers only.
        unsafe {
            Row {
                // The lanes' total may pass `i32`; the lanes themselves do not.
                sum: self.sums.into_iter().map(|lanes| vaddlvq_s32(lanes)).sum::<i64>(),
                squares: vaddvq_s64(self.squares),
                min: if DIFFERENCE == SIGNED { vminvq_s32(self.min) } else { least },
                max: vmaxvq_s32(self.max),
            }
        }
    }
}

fn rows_of<'r, const DIFFERENCE: u8, const SQUARES: bool>(
    kernel: &Kernel,
    images: &mut impl Iterator<Item = Images<'r>>,
    columns: &mut [i32],
    rows: &mut [Row],
) {
    // Weights of this path fit 14 bits.
    let (weights, least) = (kernel.weights.map(|weight| weight as i16), kernel.least());
    let overlaps = !columns.len().is_multiple_of(LANES);
    let (all, new) = (lanes(&[-1; LANES]), lanes(&new_of(columns.len())));
    for (row, images) in rows.iter_mut().zip(images) {
        let mut lanes = Lanes::none();
        let [f, b] = images.map(|row| row.as_chunks::<BYTES>().0.iter());
        for ((f, b), columns) in f.zip(b).zip(columns.as_chunks_mut().0) {
            lanes.take::<DIFFERENCE, SQUARES>(levels::<DIFFERENCE>(f, b, weights), all, columns);
        }
        let last = (images[0].last_chunk(), images[1].last_chunk(), columns.last_chunk_mut());
        if let (true, (Some(f), Some(b), Some(columns))) = (overlaps, last) {
            lanes.take::<DIFFERENCE, SQUARES>(levels::<DIFFERENCE>(f, b, weights), new, columns);
        }
        *row = lanes.row::<DIFFERENCE>(least);
    }
}

/// Which of a row's last sixteen pixels its whole steps have not had: all bits or none.
fn new_of(width: usize) -> [i32; LANES] {
    let left = width % LANES;
    std::array::from_fn(|pixel| if pixel + left >= LANES { -1 } else { 0 })
}

/// Sixteen numbers as vectors.
fn lanes(numbers: &[i32; LANES]) -> [int32x4_t; 4] {
    // SAFETY: each load is four of the sixteen.
    [0, 4, 8, 12].map(|at| unsafe { vld1q_s32(numbers[at..].as_ptr()) })
}

/// See [`Kernel::count`].
pub(super) fn count<'r>(
    kernel: &Kernel,
    images: impl Iterator<Item = Images<'r>>,
    width: usize,
    first: i32,
) -> u32 {
    let weights = kernel.weights.map(|weight| weight as i16);
    let new = lanes(&new_of(width));
    by_reading!(kernel, count_of(images, weights, new, first))
}

fn count_of<'r, const DIFFERENCE: u8>(
    images: impl Iterator<Item = Images<'r>>,
    weights: [i16; 3],
    new: [int32x4_t; 4],
    first: i32,
) -> u32 {
    // SAFETY: computes on registers only.
    unsafe {
        let border = vdupq_n_s32(first);
        let mut above = vdupq_n_u32(0);
        for images in images {
            let [f, b] = images.map(|row| row.as_chunks::<BYTES>().0.iter());
            for (f, b) in f.zip(b) {
                for n in levels::<DIFFERENCE>(f, b, weights) {
                    // A true comparison is −1, so subtracting it counts.
                    above = vsubq_u32(above, vcgeq_s32(n, border));
                }
            }
            if let (Some(f), Some(b)) = (images[0].last_chunk(), images[1].last_chunk()) {
                for (n, new) in levels::<DIFFERENCE>(f, b, weights).into_iter().zip(new) {
                    let counted = vandq_u32(vcgeq_s32(n, border), vreinterpretq_u32_s32(new));
                    above = vsubq_u32(above, counted);
                }
            }
        }
        vaddvq_u32(above)
    }
}
