//! What a row has beyond its whole steps of 32 pixels.

use std::arch::x86_64::{__m256i, _mm256_cmpgt_epi32, _mm256_set1_epi32, _mm256_setr_epi32};

use super::levels::{BYTES, LANES, PIXELS};

/// What a row has beyond its whole steps: eights that end where it ends.
#[derive(Clone, Copy)]
pub(super) struct Tail {
    /// Pixels of the whole steps.
    pub whole: usize,
    pub eights: usize,
    /// The eights' first pixel.
    pub from: usize,
}

impl Tail {
    /// Of a row of a step or more.
    pub fn of(width: usize) -> Self {
        let whole = width / PIXELS * PIXELS;
        let eights = (width - whole).div_ceil(LANES);
        Self { whole, eights, from: width - LANES * eights }
    }

    /// The eights of a row.
    #[inline]
    pub fn of_row<'r>(&self, row: &'r [u8]) -> &'r [[u8; BYTES]] {
        row.get(3 * self.from..).unwrap_or_default().as_chunks().0
    }

    /// Which pixels of the first eight the whole steps have not had: all bits or none.
    #[target_feature(enable = "avx2")]
    #[inline]
    pub fn not_had(&self) -> __m256i {
        let had = (self.whole - self.from.min(self.whole)) as i32;
        _mm256_cmpgt_epi32(_mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7), _mm256_set1_epi32(had - 1))
    }
}
