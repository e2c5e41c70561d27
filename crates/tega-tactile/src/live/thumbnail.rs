//! Frames reduced to cells, to be compared with each other.

use ndarray::ArrayView3;

use super::cells::{self, Grid, Planes, Strip, UNITS_PER_COUNT as UNITS};
use super::noise::grid_of;
use crate::error::TactileError;

/// Noise of one pixel in counts that differences are given in; measured on a DIGIT.
const NOISE: [f32; 3] = [3.17, 1.65, 2.74];

/// One frame's cell means and what they say of it alone.
#[derive(Debug, Clone, Default)]
pub(crate) struct Thumbnail {
    planes: Planes,
    /// Mean over the picture, in counts.
    pub brightness: f64,
    /// Mean difference of neighbouring cells, in noise units (blue first; it is compared among like frames only).
    pub roughness: f64,
}

/// Makes and compares thumbnails of frames of one size.
#[derive(Debug, Default)]
pub(crate) struct Thumbnails {
    grid: Option<Grid>,
    strip: Strip,
}

impl Thumbnails {
    /// The thumbnail of a frame; all frames must be of the first one's size.
    pub fn of(&mut self, frame: ArrayView3<'_, u8>) -> Result<Thumbnail, TactileError> {
        let grid = grid_of(&frame)?;
        let first = *self.grid.get_or_insert(grid);
        if first != grid {
            return Err(TactileError::Mixed {
                h: grid.height,
                w: grid.width,
                first_h: first.height,
                first_w: first.width,
            });
        }
        let mut planes = Planes::default();
        cells::average(frame, &grid, &mut self.strip, &mut planes);
        Ok(self.judge(planes))
    }

    fn judge(&self, planes: Planes) -> Thumbnail {
        let cols = self.grid.map_or(1, |grid| grid.cols);
        let cells = planes[0].len().max(1) as f64;
        let total: i64 = planes.iter().flatten().map(|&v| i64::from(v)).sum();
        let steps = |plane: &[i16]| {
            let across = plane.chunks_exact(cols).flat_map(|row| row.iter().zip(row.iter().skip(1)));
            let down = plane.iter().zip(plane.iter().skip(cols));
            across.chain(down).map(|(a, b)| i64::from((a - b).unsigned_abs())).sum::<i64>()
        };
        let rough: f64 = planes.iter().zip(NOISE).map(|(plane, s)| steps(plane) as f64 / f64::from(s)).sum();
        Thumbnail {
            planes,
            brightness: total as f64 / cells / 3.0 / f64::from(UNITS),
            roughness: rough / cells / f64::from(UNITS),
        }
    }

    /// Largest and mean difference over the cells, in noise units, after each channel's median is taken out.
    pub fn distance(a: &Thumbnail, b: &Thumbnail) -> (f32, f32) {
        let mut difference = Vec::new();
        let mut square = vec![0f32; a.planes[0].len()];
        for (c, noise) in NOISE.iter().enumerate() {
            difference.clear();
            difference.extend(a.planes[c].iter().zip(&b.planes[c]).map(|(a, b)| a - b));
            let middle = match difference.len() {
                0 => 0,
                n => *difference.clone().select_nth_unstable((n - 1) / 2).1,
            };
            for (square, d) in square.iter_mut().zip(&difference) {
                *square += (f32::from(d - middle) / (UNITS * noise)).powi(2);
            }
        }
        let length = square.into_iter().map(f32::sqrt).collect::<Vec<_>>();
        let largest = length.iter().fold(0f32, |a, &b| a.max(b));
        (largest, length.iter().sum::<f32>() / length.len().max(1) as f32)
    }

    /// Per cell the median of several.
    pub fn median(&self, of: &[&Thumbnail]) -> Thumbnail {
        let cells = self.grid.map_or(0, |grid| grid.cells());
        let mut column = Vec::with_capacity(of.len());
        self.judge(std::array::from_fn(|c| {
            (0..cells)
                .map(|cell| {
                    column.clear();
                    column.extend(of.iter().filter_map(|thumbnail| thumbnail.planes[c].get(cell)));
                    let middle = column.len() / 2;
                    if column.is_empty() { 0 } else { *column.select_nth_unstable(middle).1 }
                })
                .collect()
        }))
    }
}
