//! The response along a bundle of rays: where the samples of each lie, and what the field is there.

use crate::simd;

/// Rays that are followed side by side; a divisor of [`RAYS`](super::outline::RAYS) and of its half.
pub(crate) const BUNDLE: usize = 8;
/// Samples of the longest ray: images are at most 4096 pixels a side, about 50 cells across.
pub(super) const SAMPLES: usize = 80;

/// Samples of a bundle of rays, sample by sample.
#[derive(Debug, Default)]
pub(super) struct Samples {
    /// Columns, rows, cells; see [`walk`].
    places: [Vec<[i32; BUNDLE]>; 3],
    corners: [Vec<f32>; 4],
    values: Vec<[f32; BUNDLE]>,
}

impl Samples {
    /// Samples the field along the rays; 0 past a ray's end.
    pub fn take(&mut self, along: &Walk, field: &[f32], stride: usize) -> &[[f32; BUNDLE]] {
        let most = along.start[2].into_iter().fold(0, i32::max) as usize;
        self.values.reserve(SAMPLES.saturating_sub(self.values.len()));
        self.places.iter_mut().for_each(|buffer| buffer.reserve(SAMPLES.saturating_sub(buffer.len())));
        self.corners
            .iter_mut()
            .for_each(|buffer| buffer.reserve((BUNDLE * SAMPLES).saturating_sub(buffer.len())));
        self.places.iter_mut().for_each(|buffer| buffer.resize(most, [0; BUNDLE]));
        self.corners.iter_mut().for_each(|buffer| buffer.resize(BUNDLE * most, 0.0));
        self.values.resize(most, [0.0; BUNDLE]);
        simd::walk(along, stride as i32, self.places.each_mut().map(|buffer| &mut buffer[..]));
        let [xs, ys, cells] = self.places.each_ref().map(|buffer| buffer.as_flattened());
        gather(field, stride, cells, &mut self.corners);
        simd::between(xs, ys, &self.corners, self.values.as_flattened_mut());
        &self.values
    }
}

/// Fixed point: a 65,536th of a cell.
pub(super) fn fixed(v: f32) -> i32 {
    (v * 65536.0) as i32
}

/// A bundle of rays: column and row of the first sample in fixed point and the number of samples, and what is added
/// from sample to sample. The field's first cell is one further on for its border.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Walk {
    pub start: [[i32; BUNDLE]; 3],
    pub step: [[i32; BUNDLE]; 3],
}

/// Column and row of every sample in fixed point, and as an index into the field the cell above and to the left; -1
/// past a ray's end.
#[inline(always)]
pub(crate) fn walk(walk: &Walk, stride: i32, [xs, ys, cells]: [&mut [[i32; BUNDLE]]; 3]) {
    for ((start, step), line) in walk.start.iter().zip(&walk.step).zip([&mut *xs, &mut *ys, &mut *cells]) {
        for (k, values) in (0..).zip(line) {
            for i in 0..BUNDLE {
                values[i] = start[i] + k * step[i];
            }
        }
    }
    // So far the samples that are left, this one included.
    let places = xs.as_flattened().iter().zip(ys.as_flattened());
    for (cell, (x, y)) in cells.as_flattened_mut().iter_mut().zip(places) {
        let past = (*cell - 1) >> 31;
        *cell = past | ((y >> 16).max(0) * stride + (x >> 16).max(0));
    }
}

/// The four cells around every sample: 0 outside the field.
fn gather(field: &[f32], stride: usize, cells: &[i32], [a, b, c, d]: &mut [Vec<f32>; 4]) {
    let below = field.get(stride..).unwrap_or_default();
    let pair = |row: &[f32], at: usize| match row.get(at..at + 2) {
        Some(&[left, right]) => (left, right),
        _ => (0.0, 0.0),
    };
    for ((((cell, a), b), c), d) in cells.iter().zip(a).zip(b).zip(c).zip(d) {
        let at = *cell as u32 as usize;
        (*a, *b) = pair(field, at);
        (*c, *d) = pair(below, at);
    }
}

/// The field between the four cells around every sample.
#[inline(always)]
pub(crate) fn between(x: &[i32], y: &[i32], corners: &[Vec<f32>; 4], samples: &mut [f32]) {
    let part = |v: &i32| (v & 0xffff) as f32 * (1.0 / 65536.0);
    let [a, b, c, d] = corners;
    let places = x.iter().zip(y).zip(a).zip(b).zip(c).zip(d);
    for (sample, (((((x, y), a), b), c), d)) in samples.iter_mut().zip(places) {
        let (above, below) = (a + (b - a) * part(x), c + (d - c) * part(x));
        *sample = above + (below - above) * part(y);
    }
}
