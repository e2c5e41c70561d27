//! The picture's size, its lit cells, and the smooth fields that its still parts are made of.

use crate::grid::{COLS, MARGIN_COLS, MARGIN_ROWS, ROWS};

/// Rows of a picture.
pub const HEIGHT: usize = 320;
/// Columns of a picture.
pub const WIDTH: usize = 240;
/// Bytes of a picture's row.
pub(crate) const LINE: usize = WIDTH * 3;

/// Cells with a colour change: those of the picture and one more on each side, and across as many more as make the
/// number round.
pub(crate) const LIT_COLS: usize = (COLS - 2 * MARGIN_COLS + 2).next_multiple_of(16);
pub(crate) const LIT_ROWS: usize = ROWS - 2 * MARGIN_ROWS + 2;

pub(crate) fn across(x: f32) -> f32 {
    (x - 120.0) / 120.0
}

pub(crate) fn along(y: f32) -> f32 {
    (y - 160.0) / 160.0
}

pub(crate) fn polynomial(p: &[f32; 6], x: f32, y: f32) -> f32 {
    p[0] + p[1] * x + p[2] * y + p[3] * x * x + p[4] * x * y + p[5] * y * y
}

/// Weights of four knots at a share `t` of the way between the middle two.
pub(crate) fn spline(t: f32) -> [f32; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [
        (1.0 - 3.0 * t + 3.0 * t2 - t3) / 6.0,
        (4.0 - 6.0 * t2 + 3.0 * t3) / 6.0,
        (1.0 + 3.0 * t + 3.0 * t2 - 3.0 * t3) / 6.0,
        t3 / 6.0,
    ]
}

/// The nearest integer, of a number within ±4 million: adding 1.5 · 2²³ leaves it in the last bits. A cast that minds NaN
/// would be done one by one.
#[inline(always)]
pub(crate) fn nearest(value: f32) -> i16 {
    (value + 12_582_912.0).to_bits() as i32 as i16
}
