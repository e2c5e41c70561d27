//! What a baseline says by itself: found anew with every pair of images, or once for all frames of a session.

use ndarray::{Array3, ArrayView3};

use super::cells::{self, Grid, Planes, Source, Strip};
use super::dots::Closing;
use super::{LiveScratch, Outline, read_with, response};
use crate::error::TactileError;
use crate::frame::{Order, Pair};
use crate::metrics::ContactMetrics;

/// A baseline's cells.
#[derive(Debug, Clone, Default)]
pub(super) struct Known {
    /// Mean of each cell.
    pub means: Planes,
    /// The same, smoothed, without dots, in counts.
    pub smooth: [Vec<f32>; 3],
    /// Sum over each cell where a reading is to start from that; none of them else.
    sums: Planes,
    dotless: Planes,
    has_dots: bool,
    column_sums: Vec<i16>,
}

impl Known {
    /// Finds it out; the frame of the pair is not looked at.
    pub fn find(
        &mut self,
        pair: &Pair<'_>,
        grid: &Grid,
        order: Order,
        strip: &mut Strip,
        closing: &mut Closing,
    ) {
        cells::average(pair, grid, Source::Baseline, strip, &mut self.means);
        self.has_dots = closing.baseline_has_dots(&self.means, grid, &mut self.dotless);
        let baseline = if self.has_dots { &self.dotless } else { &self.means };
        response::smooth_counts(baseline, grid, order, &mut self.column_sums, &mut self.smooth);
    }

    /// The means without dots, where there are any.
    pub fn dotless(&self) -> Option<&Planes> {
        self.has_dots.then_some(&self.dotless)
    }

    /// How a frame's difference is averaged.
    pub fn difference(&self) -> Source<'_> {
        if self.sums[0].is_empty() { Source::Difference } else { Source::Since(&self.sums) }
    }
}

/// A baseline that many frames are read against: what can be found out from it alone is found out once.
#[derive(Debug, Clone)]
pub struct LiveBaseline {
    image: Array3<u8>,
    order: Order,
    known: Known,
}

impl LiveBaseline {
    /// Copies a baseline.
    ///
    /// # Errors
    /// [`TactileError::Channels`] or [`TactileError::Size`].
    pub fn new(baseline: ArrayView3<'_, u8>, order: Order) -> Result<Self, TactileError> {
        let image = baseline.as_standard_layout().into_owned();
        let pair = Pair::new(image.view(), image.view())?;
        let grid = Grid::of(pair.height(), pair.width());
        let (mut known, mut strip) = (Known::default(), Strip::default());
        known.find(&pair, &grid, order, &mut strip, &mut Closing::default());
        cells::average(&pair, &grid, Source::BaselineSums, &mut strip, &mut known.sums);
        Ok(Self { image, order, known })
    }

    /// As [`super::read_live`] reads the frame against this baseline, to the last bit.
    ///
    /// # Errors
    /// [`TactileError::Channels`], [`TactileError::Size`] or [`TactileError::ShapeMismatch`].
    pub fn read(
        &self,
        frame: ArrayView3<'_, u8>,
        outline: Outline,
        scratch: &mut LiveScratch,
    ) -> Result<ContactMetrics, TactileError> {
        let pair = Pair::new(frame, self.image.view())?;
        Ok(read_with(&pair, self.order, outline, Some(&self.known), scratch))
    }
}
