//! What a tracker reports of the last picture: the contact's numbers, its mask and its depth.

use super::TouchTracker;
use crate::live::cells::Grid;
use crate::live::course::{Held, State};
use crate::live::law::Sums;
use crate::live::touch::Touch;

/// Shares of the threshold at which the strength is 0 and 1.
const STRENGTH_FROM: f64 = 0.6;
const STRENGTH_FULL: f64 = 2.0;

impl TouchTracker {
    /// What the last picture shows, by its smoothed S.
    pub(super) fn touch(&mut self, s: f64, threshold: f64, dt_s: f64) -> Touch {
        let mut touch = Touch { difference: s, threshold, ..Touch::default() };
        self.dent = None;
        // Where the rest has just been taken again, S is still that against the old one.
        if matches!(self.state, State::Released(_)) || self.smooth.is_none() {
            self.filter.clear();
            return touch;
        }
        let sure = (s / threshold - STRENGTH_FROM) / (STRENGTH_FULL - STRENGTH_FROM);
        touch.strength = sure.clamp(0.0, 1.0);
        if !matches!(self.state, State::Contact(_)) {
            self.filter.clear();
            return touch;
        }
        let dent = self.cells.steady_dent(self.options.outline, &mut self.filter, self.rest, dt_s);
        let grid = &self.cells.grid;
        let area = dent.moments.area as f64;
        self.dent = Some(dent);
        if area == 0.0 {
            return touch;
        }
        touch.in_contact = true;
        touch.eda = u32::try_from(dent.moments.area).unwrap_or(u32::MAX);
        let (height, mm_per_unit) = (dent.height(grid), self.cells.reader.mm_per_unit);
        touch.broad = area / (grid.height * grid.width) as f64;
        let sums = Sums {
            shaded_mm: dent.shaded_mm,
            volume_mm3: dent.volume_mm3,
            height_mm: height * mm_per_unit,
            difference_mm: s * mm_per_unit,
            broad: touch.broad,
        };
        touch.peak = height * self.cells.counts_per_unit();
        touch.cci = touch.peak / area.sqrt();
        touch.depth_mm = sums.depth_mm();
        self.deeper = if dent.shaded_mm > 0.0 { touch.depth_mm / dent.shaded_mm } else { 0.0 };
        touch.force_n = sums.volume_mm3() * self.options.light.stiffness_n_mm3;
        touch.mass = dent.mass * self.cells.counts_per_unit();
        touch.centroid_xy = dent.middle;
        touch.spread = dent.moments.spread();
        touch
    }

    fn touches(&self) -> bool {
        self.dent.is_some_and(|dent| dent.moments.area > 0)
    }

    /// Whether the last frame showed a contact that may bear a load: one that has not just fallen.
    pub fn bears_load(&self) -> bool {
        matches!(self.state, State::Contact(Held { fallen: None, .. }))
    }

    /// Amplitude of the bands that mains light makes at rest, as a share of the light; 0 where there are none.
    pub fn banding(&self) -> f64 {
        self.mains.amplitude()
    }

    /// The last frame's mask, row by row, and its height and width; nothing without contact.
    pub fn mask(&self) -> (Vec<bool>, [usize; 2]) {
        let Grid { height, width, .. } = self.cells.grid;
        let mut mask = vec![false; height * width];
        if self.touches() {
            self.cells.paint(self.options.outline, |y, first, end| {
                if let Some(run) = mask.get_mut(y * width + first..y * width + end) {
                    run.fill(true);
                }
            });
        }
        (mask, [height, width])
    }

    /// The last frame's depth by shading, scaled so that its largest is the contact's, millimetres, a value a cell, and the numbers of rows and
    /// columns; 0 without contact.
    pub fn depth_map(&self) -> (Vec<f32>, [usize; 2]) {
        let Grid { rows, cols, .. } = self.cells.grid;
        let by = self.deeper as f32;
        let depth = if self.touches() {
            self.cells.reader.depth_mm.iter().map(|shaded| by * shaded).collect()
        } else {
            vec![0.0; rows * cols]
        };
        (depth, [rows, cols])
    }
}
