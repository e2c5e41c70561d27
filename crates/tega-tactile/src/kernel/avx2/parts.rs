//! Divide a row into eights: a first one, steps of four, and the last ones, which end where the row ends.
//!
//! An eight within a row is loaded from four bytes before it to four bytes behind it, so that each half of a vector holds
//! four pixels. The first and the last have no such bytes and are loaded by halves.

use std::arch::x86_64::{
    __m256i, _MM_HINT_T0, _mm_prefetch, _mm256_cmpgt_epi32, _mm256_set1_epi32, _mm256_setr_epi32,
};

use super::levels::{BYTES, LANES, STEP, STEP_BYTES};
use crate::kernel::Images;

/// Bytes from a step to what is fetched while it is summed up, of the images and of kept levels: half of all loads cross
/// cache lines, and loads and stores that miss the first cache hold the others up.
pub(super) const AHEAD: usize = 2048;
/// Most eights behind the steps: of up to 33 pixels.
pub(super) const MOST_LAST: usize = 5;

/// The parts of every row of one width.
#[derive(Clone, Copy)]
pub(super) struct Parts {
    pub width: usize,
    /// Steps, from the ninth pixel on.
    pub steps: usize,
    /// Eights behind them, of which the first may overlap the steps.
    pub last: usize,
    /// The first pixel of those.
    pub from: usize,
}

impl Parts {
    /// Of rows of at least a step.
    pub fn of(width: usize) -> Self {
        // Two pixels or more are left, since the last step needs four bytes behind it.
        let steps = width.saturating_sub(LANES + 2) / STEP;
        let last = (width - LANES - steps * STEP).div_ceil(LANES);
        Self { width, steps, last, from: width - last * LANES }
    }

    /// Words that a row's levels are kept in: those of the steps, then pairs of the other eights.
    pub fn kept(&self) -> usize {
        self.steps * STEP + (self.last / 2 + 1) * 2 * LANES
    }

    /// Which pixels of the first of the last eights are not in the steps: all bits or none.
    #[target_feature(enable = "avx2")]
    #[inline]
    pub fn not_in_steps(&self) -> __m256i {
        let overlap = (LANES + self.steps * STEP - self.from) as i32;
        _mm256_cmpgt_epi32(_mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7), _mm256_set1_epi32(overlap - 1))
    }

    /// The bytes of a row of frame and baseline; none if it has another width.
    pub fn of_row(self, [frame, baseline]: Images<'_>) -> Option<RowParts<'_>> {
        let whole = frame.len() == 3 * self.width && baseline.len() == frame.len();
        whole.then_some(RowParts { parts: self, frame, baseline })
    }
}

/// The bytes of a row of frame and baseline.
#[derive(Clone, Copy)]
pub(super) struct RowParts<'r> {
    parts: Parts,
    pub frame: &'r [u8],
    pub baseline: &'r [u8],
}

impl<'r> RowParts<'r> {
    /// The first eight.
    #[inline]
    pub fn first(&self) -> [&'r [u8; BYTES]; 2] {
        // SAFETY: a row has at least the pixels of a step.
        unsafe { self.chunks(0) }
    }

    /// A step.
    ///
    /// # Safety
    /// It is one of the parts' steps.
    #[inline]
    pub unsafe fn step(&self, step: usize) -> [&'r [u8; STEP_BYTES]; 2] {
        debug_assert!(step < self.parts.steps);
        // SAFETY: 3 · width ≥ 3 · (8 + 32 · steps + 2) is more than where the last step ends.
        unsafe { self.chunks(BYTES - 4 + 3 * STEP * step) }
    }

    /// Fetches what as many bytes as a step has, [`AHEAD`] of it, lie on: of rows to come, or of nothing.
    #[target_feature(enable = "avx2")]
    #[inline]
    pub fn fetch_ahead(&self, step: usize) {
        for image in [self.frame, self.baseline] {
            let from = image.as_ptr().wrapping_add(3 * STEP * step + AHEAD);
            fetch(from);
            fetch(from.wrapping_add(3 * STEP / 2));
        }
    }

    /// One of the last eights.
    ///
    /// # Safety
    /// It is one of the parts' last.
    #[inline]
    pub unsafe fn last(&self, eight: usize) -> [&'r [u8; BYTES]; 2] {
        debug_assert!(eight < self.parts.last);
        // SAFETY: the last of them ends where the row ends.
        unsafe { self.chunks(3 * (self.parts.from + LANES * eight)) }
    }

    /// So many bytes of both images.
    ///
    /// # Safety
    /// They lie within the row.
    #[inline]
    unsafe fn chunks<const N: usize>(&self, from: usize) -> [&'r [u8; N]; 2] {
        debug_assert!(from + N <= self.frame.len());
        // SAFETY: as the caller says; both rows are of one length.
        unsafe { [&*self.frame.as_ptr().add(from).cast(), &*self.baseline.as_ptr().add(from).cast()] }
    }
}

/// Has the processor fetch the cache line of a byte.
#[target_feature(enable = "avx2")]
#[inline]
#[allow(unused_unsafe, reason = "newer compilers hold that a prefetch is safe")]
pub(super) fn fetch(byte: *const u8) {
    // SAFETY: it reads nothing, and may name any address.
    unsafe { _mm_prefetch::<_MM_HINT_T0>(byte.cast()) };
}
