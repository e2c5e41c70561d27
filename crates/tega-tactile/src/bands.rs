//! Read two images in bands of rows with AVX2: the fast way for differences without sign.
//!
//! The first pass takes no pixel's grey value at all. It sums the bytes, as the moments ask for no more, and keeps the largest
//! byte of each place of a band, which bounds the band's grey values. The peak is then looked for where a bound reaches it,
//! and the threshold count leaves out the bands under the threshold and takes the others by 16-bit sums (`coarse`).

#![allow(unsafe_code)]

use std::ops::Range;

use tega_simd::{Isa, isa};

use crate::coarse::Coarse;
use crate::frame::{Difference, Pair};
use crate::kernel::Kernel;
use crate::kernel::avx2::bands::{self, Band, MOST_ROWS, STEP, Sums, Words};
use crate::kernel::avx2::highest;

/// Buffers that are reused from frame to frame.
#[derive(Debug, Default)]
pub(crate) struct BandScratch {
    /// Sums of the columns of whole steps since the last flush, and of the pixels behind them.
    columns: Vec<Words>,
    rest: Vec<i32>,
    /// Sums of the rows.
    rows: Vec<i64>,
    bands: Vec<Band>,
    /// Coarse weights, and the weights that they were made for.
    coarse: Option<([i32; 3], Option<Coarse>)>,
}

/// What one reading yields; the column sums went to the caller's totals.
pub(crate) struct Bands<'s> {
    rows: &'s [i64],
    bands: &'s mut [Band],
    coarse: Option<Coarse>,
}

impl BandScratch {
    /// Whether this is a way to read these images.
    pub(crate) fn suits(kernel: &Kernel, pair: &Pair<'_>) -> bool {
        isa() == Isa::Avx2
            && kernel.difference != Difference::Signed
            && !kernel.squares
            && 3 * pair.width() >= STEP
            && pair.contiguous().is_some()
    }

    /// Reads both images once; `totals` become the sums of the columns. The images have to suit.
    pub(crate) fn read(&mut self, kernel: &Kernel, pair: &Pair<'_>, totals: &mut Vec<i64>) -> Bands<'_> {
        let Self { columns, rest, rows, bands, coarse } = self;
        let width = pair.width();
        let bytes = 3 * width;
        let steps = bytes / STEP;
        columns.clear();
        columns.resize(3 * steps, Words::NONE);
        rest.clear();
        rest.resize(width - STEP / 3 * steps, 0);
        rows.clear();
        bands.clear();
        totals.clear();
        totals.resize(width, 0);
        let (frame, baseline) = pair.contiguous().unwrap_or_default();
        for (f, b) in frame.chunks(MOST_ROWS * bytes).zip(baseline.chunks(MOST_ROWS * bytes)) {
            let mut sums = Sums { columns, rest, rows, bands };
            // SAFETY: `suits` said that the processor has AVX2.
            unsafe { bands::sum(kernel, f, b, bytes, &mut sums) };
            take_columns(kernel, columns, rest, totals);
        }
        if coarse.is_none_or(|(weights, _)| weights != kernel.weights) {
            *coarse = Some((kernel.weights, Coarse::of(kernel.weights)));
        }
        Bands { rows, bands, coarse: coarse.and_then(|(_, coarse)| coarse) }
    }
}

/// Adds the columns' sums, weighed, to the totals, and starts them again from 0.
fn take_columns(kernel: &Kernel, columns: &mut [Words], rest: &mut [i32], totals: &mut [i64]) {
    let weights = kernel.weights.map(i64::from);
    let (steps, totals_rest) = totals.split_at_mut(columns.len() / 3 * (STEP / 3));
    for (step, totals) in columns.as_chunks_mut::<3>().0.iter_mut().zip(steps.chunks_exact_mut(STEP / 3)) {
        let bytes = step.each_mut().map(Words::take);
        for (total, sums) in totals.iter_mut().zip(bytes.as_flattened().as_chunks::<3>().0) {
            *total += (0..3).map(|c| weights[c] * i64::from(sums[c])).sum::<i64>();
        }
    }
    for (total, sum) in totals_rest.iter_mut().zip(rest) {
        *total += i64::from(std::mem::take(sum));
    }
}

impl Bands<'_> {
    /// Sums of the rows.
    pub(crate) fn rows(&self) -> impl ExactSizeIterator<Item = i64> {
        self.rows.iter().copied()
    }

    /// Largest grey value and its first place in row order; bands that were looked through get the bound that they reach.
    pub(crate) fn peak(&mut self, kernel: &Kernel, pair: &Pair<'_>) -> (i32, (usize, usize)) {
        let (frame, baseline) = pair.contiguous().unwrap_or_default();
        let bytes = 3 * pair.width();
        let look = |ys: Range<usize>| {
            let at = ys.start * bytes..ys.end * bytes;
            // SAFETY: `suits` said that the processor has AVX2.
            unsafe { highest(kernel, &frame[at.clone()], &baseline[at]) }
        };
        // The band with the largest bound is the likeliest to have the peak, and leaves few others to look through.
        let mut peak = i32::MIN;
        let mut seen = usize::MAX;
        if let Some(band) = self.bands.iter_mut().max_by_key(|band| band.bound) {
            band.bound = look(band.ys());
            (peak, seen) = (band.bound, band.y);
        }
        for band in self.bands.iter_mut().filter(|band| band.y != seen) {
            if band.bound >= peak {
                band.bound = look(band.ys());
                peak = peak.max(band.bound);
            }
        }
        let band = self.bands.iter().find(|band| band.bound == peak);
        let y = band.and_then(|band| band.ys().find(|y| look(*y..y + 1) == peak)).unwrap_or_default();
        let at = y * bytes..(y + 1) * bytes;
        (peak, (kernel.first_of(&frame[at.clone()], &baseline[at], peak), y))
    }

    /// Number of pixels at or above grey value `first`.
    pub(crate) fn count_from(&self, pair: &Pair<'_>, kernel: &Kernel, first: i32) -> u32 {
        let (frame, baseline) = pair.contiguous().unwrap_or_default();
        if kernel.least() >= first {
            return (frame.len() / 3) as u32;
        }
        let border = self.coarse.and_then(|coarse| Some((coarse.bytes(), coarse.border(first)?)));
        let reaches = |band: &Band| band.bound >= first;
        let mut count = 0;
        for run in self.bands.chunk_by(|a, b| reaches(a) == reaches(b)) {
            if let [top, ..] = run
                && let [.., bottom] = run
                && reaches(top)
            {
                let at = 3 * pair.width() * top.y..3 * pair.width() * (bottom.y + bottom.rows);
                let (frame, baseline) = (&frame[at.clone()], &baseline[at]);
                let (coarse, counted) = border.map_or((0, 0), |(weights, border)| {
                    // SAFETY: `suits` said that the processor has AVX2.
                    unsafe { bands::count(kernel.difference, weights, frame, baseline, border) }
                });
                count += coarse + kernel.count(&frame[counted..], &baseline[counted..], first);
            }
        }
        count
    }
}
