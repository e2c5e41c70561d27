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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polynomial_has_each_of_its_terms() {
        let terms = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0];
        let (x, y) = (3.0f32, 5.0f32);
        let powers = [1.0, x, y, x * x, x * y, y * y];
        for (k, power) in powers.into_iter().enumerate() {
            let alone = std::array::from_fn(|i| if i == k { terms[k] } else { 0.0 });
            assert_eq!(polynomial(&alone, x, y), terms[k] * power);
        }
        assert_eq!(polynomial(&terms, x, y), terms.iter().zip(powers).map(|(a, b)| a * b).sum::<f32>());
    }

    #[test]
    fn the_middle_of_the_picture_is_the_origin() {
        assert_eq!([across(0.0), across(120.0), across(240.0)], [-1.0, 0.0, 1.0]);
        assert_eq!([along(0.0), along(160.0), along(320.0)], [-1.0, 0.0, 1.0]);
    }

    #[test]
    fn weights_of_a_spline_are_one_together_and_mirrored() {
        for t in [0.0f32, 0.1, 0.5, 0.9, 1.0] {
            let (weights, mirrored) = (spline(t), spline(1.0 - t));
            assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1e-6);
            for (a, b) in weights.iter().zip(mirrored.iter().rev()) {
                assert!((a - b).abs() < 1e-6 && *a >= 0.0);
            }
        }
        let wanted = [1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0, 0.0];
        assert!(spline(0.0).into_iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-6));
    }

    #[test]
    fn nearest_is_the_nearest_integer() {
        for (value, wanted) in [(0.0, 0), (0.4, 0), (0.6, 1), (-0.6, -1), (127.4, 127), (-300.2, -300)] {
            assert_eq!(nearest(value), wanted);
        }
    }
}
