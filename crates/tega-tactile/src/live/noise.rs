//! Measure a camera's noise from still frames, as the touch reading weighs colours by it.

use ndarray::ArrayView3;
use tega_error::OutOfRange;

use super::cells::{Grid, Planes, Strip, UNITS_PER_COUNT, average};
use super::colour::Field;
use super::mains::Mains;
use super::quantised::quantised;
use crate::error::TactileError;
use crate::frame::{MAX_SIDE, Order};

/// Standard deviation of a cell's mean from frame to frame in counts, blue, green, red: measured on a DIGIT.
const PRIOR: [f32; 3] = [1.32, 0.65, 1.17];
/// A measured noise is kept within these multiples of the prior: a compressed stream repeats its noise and a quiet
/// camera rounds it away, so both seem to have none, and a flickering lamp is no noise.
const LEAST: f32 = 0.4;
const MOST: f32 = 4.0;

/// A few cells, stuck or touched, are left out: one of so many.
const LEFT_OUT: usize = 50;
/// The others' variances, each weighed by itself as the reading weighs energies, count where they are so much more than the median: most cells
/// of a strongly compressed picture repeat exactly, and the rest change by whole steps.
const UNEVEN: f64 = 8.0;
/// Fewer frames do not show how uneven the cells are.
const FEWEST: usize = 10;

/// Noise of a camera's cells: the standard deviation of a cell's mean from frame to frame, per colour.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorNoise {
    /// Counts: blue, green, red.
    pub bgr: [f32; 3],
}

impl Default for SensorNoise {
    /// That of a DIGIT.
    fn default() -> Self {
        Self { bgr: PRIOR }
    }
}

impl SensorNoise {
    /// Takes a given noise, kept within 0.4 and 4 times that of a DIGIT.
    ///
    /// # Errors
    /// [`TactileError::OutOfRange`] for a value that is not finite or is negative.
    pub fn of_counts(bgr: [f64; 3]) -> Result<Self, TactileError> {
        for value in bgr {
            if !(0.0..=255.0).contains(&value) {
                return Err(OutOfRange::new("noise", value, "counts", "0 to 255 for each colour").into());
            }
        }
        Ok(Self { bgr: std::array::from_fn(|c| within(bgr[c] as f32, c)) })
    }

    /// Measures it over frames of an untouched gel: how much each cell varies about its own mean, the median over the cells, so that no cell
    /// that is stuck or touched decides. What all of the picture does together, and so most of a drift, is taken out first, and so are
    /// the bands of mains light. A video that was compressed repeats its noise from frame to frame and changes it slowly; that counts as well.
    /// It is at least the error of the steps in which JPEG has quantised the first frame.
    ///
    /// # Errors
    /// [`TactileError::TooFewFrames`] for fewer than two, [`TactileError::Channels`], [`TactileError::Size`] or
    /// [`TactileError::Mixed`] for frames that cannot be compared.
    pub fn measure(frames: &[ArrayView3<'_, u8>], order: Order) -> Result<Self, TactileError> {
        let Some(first) = frames.first().filter(|_| frames.len() > 1) else {
            return Err(TactileError::TooFewFrames { frames: frames.len(), wanted: 2 });
        };
        let grid = grid_of(first)?;
        let mut strip = Strip::default();
        let mut changes: Vec<Planes> = Vec::with_capacity(frames.len());
        for frame in frames {
            let (h, w, _) = frame.dim();
            if grid_of(frame)? != grid {
                return Err(TactileError::Mixed { h, w, first_h: grid.height, first_w: grid.width });
            }
            let mut now = Planes::default();
            average(frame.view(), &grid, &mut strip, &mut now);
            changes.push(now);
        }
        let middles = medians(&changes);
        let banded = Self { bgr: spread(&changes, &middles, order) };
        // Bands move the medians too.
        let varies = without_bands(&mut changes, &middles, banded.arranged(order), &grid)
            .map_or(banded.bgr, |()| spread(&changes, &medians(&changes), order));
        let steps = quantised(first, order);
        Ok(Self { bgr: std::array::from_fn(|c| within(varies[c].max(steps[c]), c)) })
    }

    /// The noise as the bytes of a pixel lie.
    pub(super) fn arranged(&self, order: Order) -> [f32; 3] {
        let [b, g, r] = self.bgr;
        order.arrange([r, g, b])
    }
}

/// Medians of the cells of each frame.
fn medians(frames: &[Planes]) -> Vec<[i16; 3]> {
    let mut sorted = Vec::new();
    let mut median = |plane: &Vec<i16>| {
        sorted.clone_from(plane);
        *sorted.select_nth_unstable(plane.len() / 2).1
    };
    frames.iter().map(|planes| planes.each_ref().map(&mut median)).collect()
}

/// Standard deviation of cells about their own means, counts: blue, green, red; `middles` are the frames' medians, which are taken out.
fn spread(frames: &[Planes], middles: &[[i16; 3]], order: Order) -> [f32; 3] {
    let n = frames.len() as i64;
    // n (n - 1) times the variance, whole numbers; the median of a sum of squares lies under its mean (Wilson and Hilferty).
    let under = (1.0 - 2.0 / (9.0 * (n - 1) as f64)).powi(3);
    let scale = f64::from(UNITS_PER_COUNT) * f64::from(UNITS_PER_COUNT) * (n * (n - 1)) as f64;
    let stored = order.arrange([2, 1, 0]); // which of blue, green, red a byte is
    let mut bgr = [0.0; 3];
    for (c, colour) in stored.into_iter().enumerate() {
        let mut sums = vec![[0_i64; 2]; frames.first().map_or(0, |planes| planes[c].len())];
        for (planes, middle) in frames.iter().zip(middles) {
            for ([sum, square], mean) in sums.iter_mut().zip(&planes[c]) {
                let value = i64::from(*mean) - i64::from(middle[c]);
                *sum += value;
                *square += value * value;
            }
        }
        let mut spreads: Vec<i64> = sums.iter().map(|[sum, square]| n * square - sum * sum).collect();
        spreads.sort_unstable();
        let middle = spreads.get(spreads.len() / 2).map_or(0.0, |spread| *spread as f64 / under);
        let kept = spreads.get(..spreads.len() - spreads.len() / LEFT_OUT).unwrap_or_default();
        let [sum, squares] = kept.iter().fold([0.0; 2], |[sum, squares], spread| {
            let spread = *spread as f64;
            [sum + spread, squares + spread * spread]
        });
        let weighed = if sum > 0.0 { squares / sum } else { 0.0 };
        let variance =
            if n as usize >= FEWEST && weighed > UNEVEN * middle { weighed } else { middle } / scale;
        bgr[colour] = within(variance.sqrt() as f32, colour);
    }
    bgr
}

/// Takes the bands of mains light out of frames, if there are any.
fn without_bands(frames: &mut [Planes], middles: &[[i16; 3]], noise: [f32; 3], grid: &Grid) -> Option<()> {
    let share = 1.0 / (frames.len() as f32 * UNITS_PER_COUNT);
    let gel: Field = std::array::from_fn(|c| {
        let mut sums = vec![0.0; grid.cells()];
        for planes in frames.iter() {
            sums.iter_mut().zip(&planes[c]).for_each(|(sum, mean)| *sum += f32::from(*mean));
        }
        sums.iter().map(|sum| sum * share).collect()
    });
    let rest = [0, 1, 2].map(|c| middles.iter().map(|m| f32::from(m[c])).sum::<f32>() * share);
    let mut changes: Vec<Field> = frames
        .iter()
        .zip(middles)
        .map(|(planes, middle)| {
            std::array::from_fn(|c| {
                let shift = f32::from(middle[c]) / UNITS_PER_COUNT - rest[c];
                let cells = planes[c].iter().zip(&gel[c]);
                cells.map(|(now, gel)| (f32::from(*now) / UNITS_PER_COUNT - gel - shift) / noise[c]).collect()
            })
        })
        .collect();
    let mut mains = Mains::default();
    for change in &changes {
        let variances = mains.measure(change, &gel, noise, grid);
        mains.learn(variances, 0.0);
    }
    for ((planes, change), middle) in frames.iter_mut().zip(&mut changes).zip(middles) {
        // The median moves with the bands: it is not taken out before they are.
        for (c, change) in change.iter_mut().enumerate() {
            let shift = (f32::from(middle[c]) / UNITS_PER_COUNT - rest[c]) / noise[c];
            for value in change {
                *value += shift;
            }
        }
        let before = change.clone();
        if !mains.correct(change, &gel, noise, grid, None) {
            return None;
        }
        for c in 0..3 {
            for (k, mean) in planes[c].iter_mut().enumerate() {
                let band = (before[c][k] - change[c][k]) * noise[c] * UNITS_PER_COUNT;
                *mean = mean.saturating_sub(band.round() as i16);
            }
        }
    }
    Some(())
}

fn within(value: f32, colour: usize) -> f32 {
    value.clamp(LEAST * PRIOR[colour], MOST * PRIOR[colour])
}

/// The grid of an image after checking its size.
pub(super) fn grid_of(image: &ArrayView3<'_, u8>) -> Result<Grid, TactileError> {
    let (height, width, channels) = image.dim();
    if channels != 3 {
        return Err(TactileError::Channels { name: "frame", channels });
    }
    if height == 0 || width == 0 || height > MAX_SIDE || width > MAX_SIDE {
        return Err(TactileError::Size { height, width, max: MAX_SIDE });
    }
    Ok(Grid::of(height, width))
}

/// Refuses an image of another size than the grid's.
pub(super) fn same_size(grid: &Grid, image: &ArrayView3<'_, u8>) -> Result<(), TactileError> {
    let (frame_h, frame_w, channels) = image.dim();
    if channels != 3 {
        return Err(TactileError::Channels { name: "frame", channels });
    }
    if (frame_h, frame_w) != (grid.height, grid.width) {
        return Err(TactileError::ShapeMismatch {
            frame_h,
            frame_w,
            baseline_h: grid.height,
            baseline_w: grid.width,
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array3;

    fn noisy(n: usize, sd: f32) -> Vec<Array3<u8>> {
        let mut state = 1u64;
        let mut uniform = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1u64 << 24) as f32 - 0.5
        };
        (0..n)
            .map(|_| {
                Array3::from_shape_fn((320, 240, 3), |_| {
                    let sum: f32 = (0..12).map(|_| uniform()).sum();
                    (100.0 + sd * sum).round() as u8
                })
            })
            .collect()
    }

    #[test]
    fn the_noise_of_made_frames_is_found() {
        let frames = noisy(6, 8.0);
        let views: Vec<_> = frames.iter().map(|frame| frame.view()).collect();
        // White noise of 8 counts: one count for the mean of 64 pixels.
        for value in SensorNoise::measure(&views, Order::Bgr).unwrap().bgr {
            assert!((value - 1.0).abs() < 0.06, "{value}");
        }
    }

    #[test]
    fn bands_of_mains_light_are_no_noise() {
        let mut frames = noisy(12, 8.0);
        let plain: Vec<_> = frames.iter().map(|frame| frame.view()).collect();
        let still = SensorNoise::measure(&plain, Order::Bgr).unwrap();
        for (k, frame) in frames.iter_mut().enumerate() {
            for ((row, _, _), value) in frame.indexed_iter_mut() {
                let wave = (0.03 * row as f32 + 1.7 * k as f32).sin();
                *value = (f32::from(*value) * (1.0 + 0.02 * wave)).round() as u8;
            }
        }
        let banded: Vec<_> = frames.iter().map(|frame| frame.view()).collect();
        let found = SensorNoise::measure(&banded, Order::Bgr).unwrap();
        for (found, still) in found.bgr.iter().zip(still.bgr) {
            assert!((found / still - 1.0).abs() < 0.1, "{found} for {still}");
        }
    }

    #[test]
    fn repeated_frames_and_black_ones_have_the_least_noise_that_is_believed() {
        let black = Array3::<u8>::zeros((240, 320, 3));
        let noise = SensorNoise::measure(&[black.view(), black.view()], Order::Rgb).unwrap();
        assert_eq!(noise.bgr, PRIOR.map(|p| LEAST * p));
    }

    #[test]
    fn one_frame_tells_nothing_of_noise() {
        let black = Array3::<u8>::zeros((24, 32, 3));
        let refused = SensorNoise::measure(&[black.view()], Order::Bgr);
        assert!(matches!(refused, Err(TactileError::TooFewFrames { frames: 1, wanted: 2 })));
    }
}
