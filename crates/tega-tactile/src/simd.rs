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

use tega_simd::{Level, dispatched, level};

use crate::dent;
use crate::levels::{Kernel, Row};
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
    match level() {
        // SAFETY: `level` reports a set only after the processor itself said that it has it.
        Level::Avx512 => return unsafe { avx512::rows(kernel, frame, baseline, columns, rows) },
        // SAFETY: as above.
        Level::Avx2 => return unsafe { avx2::rows(kernel, frame, baseline, columns, rows) },
        Level::Baseline => {}
    }
    #[cfg(target_arch = "aarch64")]
    if level() == Level::Neon {
        return neon::rows(kernel, frame, baseline, columns, rows);
    }
    kernel.rows(frame, baseline, columns, rows);
}

/// See [`Kernel::count`].
pub(crate) fn count(kernel: &Kernel, frame: &[u8], baseline: &[u8], first: i32) -> u32 {
    #[cfg(target_arch = "x86_64")]
    match level() {
        // SAFETY: as above.
        Level::Avx512 => return unsafe { avx512::count(kernel, frame, baseline, first) },
        // SAFETY: as above.
        Level::Avx2 => return unsafe { avx2::count(kernel, frame, baseline, first) },
        Level::Baseline => {}
    }
    #[cfg(target_arch = "aarch64")]
    if level() == Level::Neon {
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
    /// See [`dent::add_difference`].
    add_difference = dent::add_difference, (sums: &mut [i16], frame: &[u8], baseline: &[u8]) -> ()
}

dispatched! {
    /// See [`dent::add_row`].
    add_row = dent::add_row, (sums: &mut [i16], row: &[u8]) -> ()
}

dispatched! {
    /// See [`dent::add_four_differences`].
    add_four_differences = dent::add_four_differences, (sums: &mut [i16], frame: &[u8], baseline: &[u8]) -> ()
}

dispatched! {
    /// See [`dent::add_four_rows`].
    add_four_rows = dent::add_four_rows, (sums: &mut [i16], rows: &[u8]) -> ()
}

dispatched! {
    /// See [`dent::fold_octets`].
    fold_octets = dent::fold_octets, (sums: &[i16], shift: u32, folded: &mut [i16]) -> ()
}

dispatched! {
    /// See [`dent::smooth`].
    smooth = dent::smooth, (plane: &[i16], cols: usize, middle: i32, scale: f32, column: &mut [i16], out: &mut [f32]) -> ()
}

dispatched! {
    /// See [`dent::median`].
    median = dent::median, (plane: &[i16]) -> i16
}

dispatched! {
    /// See [`dent::lengths`].
    lengths = dent::lengths, (a: &[f32], b: &[f32], c: &[f32], out: &mut [f32]) -> ()
}

dispatched! {
    /// See [`dent::quiet_lanes`].
    quiet_lanes = dent::quiet_lanes, (quiet: &[f32], base: &[f32], white: &[f32]) -> [[f32; dent::LANES]; 5]
}

dispatched! {
    /// See [`dent::close`].
    close = dent::close, (plane: &[i16], cols: usize, across: &mut [i16], dilated: &mut [i16], out: &mut [i16]) -> ()
}

dispatched! {
    /// See [`dent::take_out`].
    take_out = dent::take_out, (offset: f32, gain: f32, base: &[f32], white: &mut [f32]) -> ()
}

dispatched! {
    /// See [`dent::count_above`].
    count_above = dent::count_above, (level: f32, values: &[f32]) -> u32
}

dispatched! {
    /// See [`dent::mark_quiet`].
    mark_quiet = dent::mark_quiet, (level: f32, length: &[f32], quiet: &mut [f32]) -> ()
}

dispatched! {
    /// See [`dent::medians_of_seven`].
    medians_of_seven = dent::medians_of_seven, (values: &[f32], medians: &mut [f32]) -> ()
}

dispatched! {
    /// See [`dent::own`].
    own = dent::own, (index: u8, response: &[f32], owners: &[u8], out: &mut [f32]) -> ()
}

dispatched! {
    /// See [`dent::sort_keys`].
    sort_keys = dent::sort_keys, (length: &[f32], keys: &mut [u16]) -> ()
}

dispatched! {
    /// See [`dent::walk`].
    walk = dent::walk, (walk: &dent::Walk, stride: i32, places: [&mut [[i32; dent::BUNDLE]]; 3]) -> ()
}

dispatched! {
    /// See [`dent::between`].
    between = dent::between, (x: &[i32], y: &[i32], corners: &[Vec<f32>; 4], samples: &mut [f32]) -> ()
}

dispatched! {
    /// See [`dent::crossing`].
    crossing = dent::crossing, (samples: &[[f32; dent::BUNDLE]], share: f32) -> dent::Crossing
}
