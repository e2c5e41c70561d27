//! The kernels, each for the instruction set in use.
//!
//! Most are written once, in plain Rust that the compiler vectorises, and compiled several times: for AVX-512,
//! for AVX2 and for the target's baseline (SSE2 on x86-64, NEON on arm64). Those that sum rows of pixels are written
//! for each set by hand. All compute on integers, or on floats in one fixed order without fused operations, so that
//! every path gives the same bits.
#![allow(unsafe_code)]

/// A kernel's difference as a constant of the row kernels.
const SIGNED: u8 = 0;
const RECTIFIED: u8 = 1;
const ABSOLUTE: u8 = 2;

/// Calls the row kernel made for a kernel's difference and squares.
macro_rules! rows_by_reading {
    ($kernel:ident, $rows_of:ident($($arg:ident),*)) => {
        match ($kernel.difference, $kernel.squares) {
            (Difference::Signed, false) => $rows_of::<SIGNED, false>($kernel, $($arg),*),
            (Difference::Signed, true) => $rows_of::<SIGNED, true>($kernel, $($arg),*),
            (Difference::Rectified, false) => $rows_of::<RECTIFIED, false>($kernel, $($arg),*),
            (Difference::Rectified, true) => $rows_of::<RECTIFIED, true>($kernel, $($arg),*),
            (Difference::Absolute, false) => $rows_of::<ABSOLUTE, false>($kernel, $($arg),*),
            (Difference::Absolute, true) => $rows_of::<ABSOLUTE, true>($kernel, $($arg),*),
        }
    };
}

/// Calls the counting kernel made for a kernel's difference.
macro_rules! count_by_reading {
    ($kernel:ident, $count_of:ident($($arg:ident),*)) => {
        match $kernel.difference {
            Difference::Signed => $count_of::<SIGNED>($kernel, $($arg),*),
            Difference::Rectified => $count_of::<RECTIFIED>($kernel, $($arg),*),
            Difference::Absolute => $count_of::<ABSOLUTE>($kernel, $($arg),*),
        }
    };
}

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
#[cfg(target_arch = "aarch64")]
mod neon;

use tega_simd::{Isa, dispatched, isa};

use crate::levels::{Kernel, Row};
use crate::live;
use crate::paper::{self, PaperScratch};

/// Weights as `128·high + low`, for the byte multiplications of the vector forms: returns (low, high).
#[cfg(target_arch = "x86_64")]
fn halves(weights: [i32; 3]) -> ([i32; 3], [i32; 3]) {
    // Rounding the high half keeps the low one within −64..=63.
    let high = weights.map(|weight| (weight + 64).div_euclid(128));
    ([0, 1, 2].map(|c| weights[c] - 128 * high[c]), high)
}

/// See [`Kernel::rows`].
pub(crate) fn rows(kernel: &Kernel, frame: &[u8], baseline: &[u8], columns: &mut [i32], rows: &mut Vec<Row>) {
    #[cfg(target_arch = "x86_64")]
    match isa() {
        // SAFETY: `level` reports a set only after the processor itself said that it has it.
        Isa::Avx512 => return unsafe { avx512::rows(kernel, frame, baseline, columns, rows) },
        // SAFETY: as above.
        Isa::Avx2 => return unsafe { avx2::rows(kernel, frame, baseline, columns, rows) },
        Isa::Baseline => {}
    }
    #[cfg(target_arch = "aarch64")]
    if isa() == Isa::Neon {
        return neon::rows(kernel, frame, baseline, columns, rows);
    }
    kernel.rows(frame, baseline, columns, rows);
}

/// See [`Kernel::count`].
pub(crate) fn count(kernel: &Kernel, frame: &[u8], baseline: &[u8], first: i32) -> u32 {
    #[cfg(target_arch = "x86_64")]
    match isa() {
        // SAFETY: as above.
        Isa::Avx512 => return unsafe { avx512::count(kernel, frame, baseline, first) },
        // SAFETY: as above.
        Isa::Avx2 => return unsafe { avx2::count(kernel, frame, baseline, first) },
        Isa::Baseline => {}
    }
    #[cfg(target_arch = "aarch64")]
    if isa() == Isa::Neon {
        return neon::count(kernel, frame, baseline, first);
    }
    kernel.count(frame, baseline, first)
}

dispatched! {
    /// See [`paper::blur_and_weigh`].
    blur_and_weigh = paper::blur_and_weigh,
    (width: usize, height: usize, weights: [i32; 3], scratch: &mut PaperScratch) -> ()
}

dispatched! {
    /// See [`paper::mask_row`].
    mask_row = paper::mask_row, (levels: &mut [i32], columns: &mut [i32]) -> (Row, u32)
}

dispatched! {
    /// See [`paper::count_from`].
    count_from = paper::count_from, (levels: &[i32], first: i32) -> u32
}

dispatched! {
    /// See [`live::add_row`].
    add_row = live::add_row, (sums: &mut [i16], row: &[u8]) -> ()
}

dispatched! {
    /// See [`live::sum_eight_rows`].
    sum_eight_rows = live::sum_eight_rows, (sums: &mut [i16], rows: &[u8]) -> ()
}

dispatched! {
    /// See [`live::fold_octets`].
    fold_octets = live::fold_octets, (sums: &[i16], shift: u32, folded: &mut [i16]) -> ()
}

dispatched! {
    /// See [`live::whiten`].
    whiten = live::whiten, (means: &[i16], gel: &[f32], scale: f32, per_noise: f32, out: &mut [f32]) -> ()
}

dispatched! {
    /// See [`live::follow`].
    follow = live::follow, (gel: &mut [f32], means: &[i16], scale: f32, share: f32) -> ()
}

dispatched! {
    /// See [`live::plane_sums`].
    plane_sums = live::plane_sums, (z: &[f32], x: &[f32], y: &[f32]) -> [[f32; live::LANES]; 3]
}

dispatched! {
    /// See [`live::without_plane`].
    without_plane = live::without_plane, (z: &[f32], x: &[f32], y: &[f32], plane: [f32; 3], out: &mut [f32]) -> ()
}

dispatched! {
    /// See [`live::without_fit`].
    without_fit = live::without_fit, (z: &[f32], places: [&[f32]; 3], fit: [f32; 4], out: &mut [f32]) -> ()
}

dispatched! {
    /// See [`live::trust`].
    trust = live::trust, (white: [&[f32]; 3], weights: &mut [f32]) -> ()
}

dispatched! {
    /// See [`live::fit_sums`].
    fit_sums = live::fit_sums, (weights: &[f32], places: [&[f32]; 3], z: &[f32]) -> [[f32; live::LANES]; live::SUMS]
}

dispatched! {
    /// See [`live::energy_sums`].
    energy_sums = live::energy_sums, (white: [&[f32]; 3]) -> [[f32; live::LANES]; 3]
}

dispatched! {
    /// See [`live::energy`].
    energy = live::energy, (white: [&[f32]; 3], out: &mut [f32]) -> ()
}

dispatched! {
    /// See [`live::one_two_one`].
    one_two_one = live::one_two_one, (a: &[f32], b: &[f32], c: &[f32], out: &mut [f32]) -> ()
}

dispatched! {
    /// See [`live::largest`].
    largest = live::largest, (values: &[f32]) -> [f32; 8]
}

dispatched! {
    /// See [`live::power_sums`].
    power_sums = live::power_sums, (values: &[f32], scale: f32) -> [[f32; 8]; 2]
}

dispatched! {
    /// See [`live::untouched_sums`].
    untouched_sums = live::untouched_sums, (depth: &[f32], change: &[f32], scale: f32) -> [[f32; 8]; 2]
}

dispatched! {
    /// See [`live::weigh_three`].
    weigh_three = live::weigh_three, (white: [&[f32]; 3], weights: [&[f32]; 3], out: &mut [f32]) -> ()
}

dispatched! {
    /// See [`live::multiply`].
    multiply = live::multiply, (a: &[f32], b: &[f32], k: usize, strides: [usize; 2], out: &mut [f32]) -> ()
}

dispatched! {
    /// See [`live::multiply_each`].
    multiply_each = live::multiply_each, (values: &mut [f32], by: &[f32]) -> ()
}

dispatched! {
    /// See [`live::half_difference`].
    half_difference = live::half_difference, (a: &[f32], b: &[f32], out: &mut [f32]) -> ()
}

dispatched! {
    /// See [`live::add_half_difference`].
    add_half_difference = live::add_half_difference, (a: &[f32], b: &[f32], out: &mut [f32]) -> ()
}
