//! How coarsely JPEG has quantised a picture, found in the picture itself.
//!
//! JPEG keeps the mean luma of each 8 x 8 pixels as a whole multiple of one step. A still picture that was compressed strongly repeats exactly, so its
//! cells do not vary, but the next change moves them by that step.

use ndarray::ArrayView3;

use crate::frame::Order;

/// Pixels of a block's side.
const SIDE: usize = 8;
/// Steps that are looked for, in eighths of a count, as JPEG's tables have them: those of quality 85 and better are less than the noise of a DIGIT.
const STEPS: std::ops::RangeInclusive<i32> = 6..=64;
/// Root mean square distance of the blocks to their nearest multiple, as a share of the step: rounding to bytes leaves less, and no step leaves 0.29.
const NEAR: f32 = 0.12;
/// Blocks differ by this many steps, root mean square, so that their multiples are many.
const DIFFER: f32 = 2.0;
/// Chromas have half of the resolution, so four blocks of 8 x 8 pixels err together, as if each erred by twice as much.
const CHROMA: f32 = 2.0;

/// Root mean square error of cells in counts, blue, green, red, by the quantised means of luma and, with a step as large, of both chromas; zeros where no
/// step is seen.
pub(super) fn quantised(image: &ArrayView3<'_, u8>, order: Order) -> [f32; 3] {
    let luma = block_means(image, order);
    let n = luma.len() as f32;
    let mean = luma.iter().sum::<f32>() / n;
    let spread = (luma.iter().map(|m| (m - mean) * (m - mean)).sum::<f32>() / n).sqrt();
    let near = |step: f32| {
        let off = luma.iter().map(|m| m - step * (m / step).round());
        (off.map(|off| off * off).sum::<f32>() / n).sqrt() < NEAR * step
    };
    let steps = STEPS.rev().map(|step| step as f32);
    let step = steps.filter(|step| spread >= DIFFER * step).find(|step| near(*step)).unwrap_or(0.0);
    // A uniform error of one step; blue, green and red of luma and chromas (JFIF).
    let error = step / 8.0 / 12f32.sqrt();
    [[1.0, CHROMA * 1.772, 0.0], [1.0, CHROMA * 0.344, CHROMA * 0.714], [1.0, 0.0, CHROMA * 1.402]]
        .map(|parts| error * parts.iter().map(|part: &f32| part * part).sum::<f32>().sqrt())
}

/// Mean luma of whole blocks over middle grey, eighths of a count: what JPEG quantises.
fn block_means(image: &ArrayView3<'_, u8>, order: Order) -> Vec<f32> {
    let weights = order.arrange([299, 587, 114]);
    let blocks = image.exact_chunks((SIDE, SIDE, 3)).into_iter();
    let sums = blocks
        .map(|block| block.indexed_iter().map(|((_, _, c), v)| weights[c] * i32::from(*v)).sum::<i32>());
    sums.map(|sum| sum as f32 / 8000.0 - 1024.0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array3;

    /// Blocks of many means, multiples of a step in eighths of a count, and of one colour.
    fn picture(step: f32) -> Array3<u8> {
        Array3::from_shape_fn((240, 320, 3), |(y, x, _)| {
            let block = (y / 8 * 7 + x / 8 * 5) % 23;
            let mean = 128.0 + step * block as f32 / 8.0;
            // Evenly over one count, so that a block's mean survives the rounding to bytes.
            (mean + ((x % 8 * 8 + y % 8) as f32 + 0.5) / 64.0 - 0.5).round() as u8
        })
    }

    #[test]
    fn the_step_of_a_picture_is_found_and_none_where_there_is_none() {
        for step in [6, 10, 20, 33] {
            let [_, _, red] = quantised(&picture(step as f32).view(), Order::Bgr);
            let wanted = step as f32 / 8.0 / 12f32.sqrt() * (1.0 + (CHROMA * 1.402).powi(2)).sqrt();
            assert!((red / wanted - 1.0).abs() < 1e-3, "{step}: {red} for {wanted}");
        }
        let mut fine = picture(10.0);
        fine.indexed_iter_mut().for_each(|((y, x, _), v)| *v += ((y / 8 * 13 + x / 8 * 11) % 7) as u8);
        let level = Array3::from_elem((240, 320, 3), 100u8);
        for none in [fine, level, Array3::zeros((7, 7, 3))] {
            assert_eq!(quantised(&none.view(), Order::Rgb), [0.0; 3]);
        }
    }
}
