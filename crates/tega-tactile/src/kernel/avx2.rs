//! Row kernels on 256-bit vectors: eight pixels each, 32 a step.
//!
//! Where levels are kept, sixteen of them are a vector of words, whose largest says which rows have to be looked at again
//! for the exact one.

#![allow(unsafe_code)]

mod lanes;
mod levels;
mod parts;

use std::arch::x86_64::{
    __m256i, _mm256_add_epi32, _mm256_and_si256, _mm256_cmpeq_epi16, _mm256_cmpeq_epi32, _mm256_cmpgt_epi32,
    _mm256_loadu_si256, _mm256_madd_epi16, _mm256_max_epi32, _mm256_max_epu16, _mm256_movemask_epi8,
    _mm256_or_si256, _mm256_packus_epi32, _mm256_set1_epi16, _mm256_set1_epi32, _mm256_setzero_si256,
    _mm256_storeu_si256, _mm256_sub_epi16, _mm256_sub_epi32,
};

use lanes::{Lanes, lanes_i32};
use levels::{GROUPS, LANES, Products, STEP};
use parts::{AHEAD, MOST_LAST, Parts, RowParts, fetch};

use super::factors::Factors;
use super::{ABSOLUTE, Images, Kernel, RECTIFIED, Row, SIGNED};
use crate::frame::Difference;

/// Kept levels a cache line.
const LINE: usize = 32;

/// Adds levels to eight columns.
#[target_feature(enable = "avx2")]
#[inline]
fn add(columns: &mut [i32], at: usize, n: __m256i) {
    if let Some(columns) = columns.get_mut(at..at + LANES) {
        let at = columns.as_mut_ptr().cast();
        // SAFETY: `columns` is exactly 32 bytes, borrowed mutably.
        unsafe { _mm256_storeu_si256(at, _mm256_add_epi32(_mm256_loadu_si256(at), n)) };
    }
}

/// Keeps sixteen levels as words, at most 65,535 each, in any order, and takes their largest.
#[target_feature(enable = "avx2")]
#[inline]
fn keep(kept: &mut [u16], at: usize, largest: &mut __m256i, [low, high]: [__m256i; 2]) {
    let words = _mm256_packus_epi32(low, high);
    *largest = _mm256_max_epu16(*largest, words);
    if let Some(kept) = kept.get_mut(at..at + 2 * LANES) {
        // SAFETY: `kept` is exactly 32 bytes, borrowed mutably.
        unsafe { _mm256_storeu_si256(kept.as_mut_ptr().cast(), words) };
    }
}

/// Runs over a row's eights, but for steps that are not looked at: their levels, which of them no eight before has had,
/// and their first pixel.
macro_rules! each_eight {
    ($block:ident, $difference:ident, $images:ident, $looked_at:expr, |$n:pat_param, $new:pat_param, $from:pat_param| $body:expr) => {
        let (parts, all) = ($block.parts, _mm256_set1_epi32(-1));
        {
            let ($n, $new, $from) = ($block.products.of_eight::<$difference>($images.first()), all, 0);
            $body;
        }
        let looked_at = $looked_at;
        for step in (0..parts.steps).filter(|step| looked_at(*step)) {
            for k in 0..GROUPS {
                // SAFETY: it is one of the steps.
                let n = $block.products.of_step::<$difference>(k, unsafe { $images.step(step) });
                let ($n, $new, $from) = (n, all, LANES + STEP * step + LANES * k);
                $body;
            }
        }
        for eight in 0..parts.last {
            // SAFETY: it is one of the last.
            let n = $block.products.of_eight::<$difference>(unsafe { $images.last(eight) });
            let new = if eight == 0 { $block.not_in_steps } else { all };
            let ($n, $new, $from) = (n, new, parts.from + LANES * eight);
            $body;
        }
    };
}

/// See [`Kernel::rows`].
#[target_feature(enable = "avx2")]
pub(super) fn rows<'r>(
    kernel: &Kernel,
    images: &mut impl Iterator<Item = Images<'r>>,
    columns: &mut [i32],
    rows: &mut [Row],
    kept: &mut [u16],
) {
    if let Some(factors) = kernel.factors {
        let products = &Products::of([factors]);
        if kept.is_empty() {
            rows_by_reading!(kernel, rows_of::<false, 1>(products, images, columns, rows, kept));
        } else {
            rows_by_reading!(kernel, rows_of::<true, 1>(products, images, columns, rows, kept));
        }
    } else {
        let products = &Products::of(Factors::both(kernel.weights));
        rows_by_reading!(kernel, rows_of::<false, 2>(products, images, columns, rows, kept));
    }
}

/// Rows whose levels are kept as words where asked for.
#[target_feature(enable = "avx2")]
fn rows_of<'r, const DIFFERENCE: u8, const SQUARES: bool, const KEPT: bool, const SETS: usize>(
    kernel: &Kernel,
    products: &Products<SETS>,
    images: &mut impl Iterator<Item = Images<'r>>,
    columns: &mut [i32],
    rows: &mut [Row],
    kept: &mut [u16],
) {
    let (block, least) = (Block::of(products, columns.len()), kernel.least());
    let parts = block.parts;
    let (in_row, mut rest) = (if KEPT { parts.kept() } else { 0 }, kept);
    for (row, images) in rows.iter_mut().zip(images) {
        let (kept, others) = rest.split_at_mut(in_row);
        rest = others;
        if let Some(images) = parts.of_row(images) {
            *row = block.sum_up::<DIFFERENCE, SQUARES, KEPT>(images, least, columns, kept);
        }
    }
}

/// What the rows of a picture share.
struct Block<'b, const SETS: usize> {
    products: &'b Products<SETS>,
    parts: Parts,
    not_in_steps: __m256i,
}

impl<'b, const SETS: usize> Block<'b, SETS> {
    #[target_feature(enable = "avx2")]
    fn of(products: &'b Products<SETS>, width: usize) -> Self {
        let parts = Parts::of(width);
        Self { products, parts, not_in_steps: parts.not_in_steps() }
    }

    /// Sums up a row, and keeps its levels where asked for.
    #[target_feature(enable = "avx2")]
    #[inline]
    fn sum_up<const DIFFERENCE: u8, const SQUARES: bool, const KEPT: bool>(
        &self,
        images: RowParts<'_>,
        least: i32,
        columns: &mut [i32],
        kept: &mut [u16],
    ) -> Row {
        let mut lanes = Lanes::none::<KEPT>();
        let first = self.products.of_eight::<DIFFERENCE>(images.first());
        lanes.take::<DIFFERENCE, SQUARES, KEPT>(first, first);
        add(columns, 0, first);
        let of_steps = if KEPT { STEP * self.parts.steps } else { 0 };
        let (kept_steps, kept_others) = kept.split_at_mut(of_steps);
        let columns_of_steps = columns.get_mut(LANES..).unwrap_or_default().as_chunks_mut::<STEP>().0;
        let kept_steps = kept_steps.as_chunks_mut::<STEP>().0;
        // The least of all, which leaves no bound to check within the loop.
        let there = if KEPT { kept_steps.len() } else { self.parts.steps };
        for step in 0..self.parts.steps.min(columns_of_steps.len()).min(there) {
            images.fetch_ahead(step);
            let mut n = [first; GROUPS];
            for (k, n) in n.iter_mut().enumerate() {
                // SAFETY: it is one of the steps.
                *n = self.products.of_step::<DIFFERENCE>(k, unsafe { images.step(step) });
                if !SQUARES {
                    lanes.take::<DIFFERENCE, false, KEPT>(*n, *n);
                }
                add(&mut columns_of_steps[step], LANES * k, *n);
            }
            if SQUARES {
                lanes.take_squares::<DIFFERENCE, KEPT>(n, step, least < 0);
            }
            if KEPT {
                let [a, b, c, d] = n;
                fetch(kept_steps[step].as_ptr().cast::<u8>().wrapping_add(AHEAD));
                keep(&mut kept_steps[step], 0, &mut lanes.max, [a, b]);
                keep(&mut kept_steps[step], 2 * LANES, &mut lanes.max, [c, d]);
            }
        }
        self.last_eights::<DIFFERENCE, SQUARES, KEPT>(first, images, columns, kept_others, &mut lanes);
        let mut row = lanes.row::<DIFFERENCE, SQUARES, KEPT>(least);
        // A word of 0 may stand for less, one of 65,535 for more.
        if KEPT && (row.max == i32::from(u16::MAX) || (DIFFERENCE == SIGNED && row.max == 0)) {
            row.max = self.largest::<DIFFERENCE>(images.frame, images.baseline, kept, row.max as u16);
        }
        row
    }

    /// What a row has behind its steps. The first eight is kept beside the first of these.
    #[target_feature(enable = "avx2")]
    #[inline]
    fn last_eights<const DIFFERENCE: u8, const SQUARES: bool, const KEPT: bool>(
        &self,
        first: __m256i,
        images: RowParts<'_>,
        columns: &mut [i32],
        kept: &mut [u16],
        lanes: &mut Lanes,
    ) {
        let zero = _mm256_setzero_si256();
        let (mut beside, mut new) = (first, self.not_in_steps);
        let columns = columns.get_mut(self.parts.from..).unwrap_or_default();
        // Counted to the most, so that the loop is unrolled.
        for eight in 0..MOST_LAST {
            if eight == self.parts.last {
                break;
            }
            // SAFETY: it is one of the last.
            let n = self.products.of_eight::<DIFFERENCE>(unsafe { images.last(eight) });
            let masked = _mm256_and_si256(n, new);
            // Levels of pixels that the steps have had change no largest and no smallest one.
            lanes.take::<DIFFERENCE, SQUARES, KEPT>(masked, n);
            add(columns, LANES * eight, masked);
            if KEPT && eight.is_multiple_of(2) {
                keep(kept, LANES * eight, &mut lanes.max, [beside, masked]);
            }
            (beside, new) = (masked, _mm256_set1_epi32(-1));
        }
        if KEPT && self.parts.last.is_multiple_of(2) {
            keep(kept, LANES * self.parts.last, &mut lanes.max, [beside, zero]);
        }
    }

    /// The largest level of a row, sought where the largest of its words are.
    #[target_feature(enable = "avx2")]
    #[inline(never)]
    fn largest<const DIFFERENCE: u8>(&self, frame: &[u8], baseline: &[u8], kept: &[u16], word: u16) -> i32 {
        let Some(images) = self.parts.of_row([frame, baseline]) else { return i32::MIN };
        let mut max = _mm256_set1_epi32(i32::MIN);
        let holds = |step: usize| kept.as_chunks().0.get(step).is_some_and(|kept| holds(kept, word));
        each_eight!(self, DIFFERENCE, images, holds, |n, _new, _from| max = _mm256_max_epi32(max, n));
        lanes::largest(max)
    }

    /// Number of a row's levels above a border, in lanes whose −1 count one each.
    #[target_feature(enable = "avx2")]
    #[inline]
    fn above<const DIFFERENCE: u8>(
        &self,
        images: RowParts<'_>,
        kept: &[u16],
        border: __m256i,
        skip: bool,
    ) -> __m256i {
        let mut above = _mm256_setzero_si256();
        // Only a word of 65,535 may stand for as much.
        let looked_at =
            |step: usize| !skip || kept.as_chunks().0.get(step).is_none_or(|kept| holds(kept, u16::MAX));
        each_eight!(self, DIFFERENCE, images, looked_at, |n, new, _from| {
            above = _mm256_add_epi32(above, _mm256_and_si256(new, _mm256_cmpgt_epi32(n, border)));
        });
        above
    }

    /// Where a row first has a level.
    #[target_feature(enable = "avx2")]
    fn first_place<const DIFFERENCE: u8>(&self, images: RowParts<'_>, level: i32) -> Option<usize> {
        let level = _mm256_set1_epi32(level);
        each_eight!(self, DIFFERENCE, images, |_| true, |n, _new, from| {
            let equal = _mm256_movemask_epi8(_mm256_cmpeq_epi32(n, level));
            if equal != 0 {
                return Some(from + equal.trailing_zeros() as usize / 4);
            }
        });
        None
    }
}

/// Whether one of a step's words is `word`.
#[target_feature(enable = "avx2")]
#[inline]
fn holds(kept: &[u16; STEP], word: u16) -> bool {
    let word = _mm256_set1_epi16(word.cast_signed());
    let [low, high] = halves(kept).map(|words| _mm256_cmpeq_epi16(words, word));
    _mm256_movemask_epi8(_mm256_or_si256(low, high)) != 0
}

/// See [`Kernel::count_kept`].
#[target_feature(enable = "avx2")]
pub(super) fn count_kept(kept: &[u16], first: u16) -> u32 {
    /// Lines whose two vectors a word counts without reaching its sign.
    const LINES: usize = 1 << 13;
    let (lines, rest) = kept.as_chunks::<LINE>();
    let (border, one) = (_mm256_set1_epi16(first.cast_signed()), _mm256_set1_epi16(1));
    let mut count = super::count_words(rest, first);
    for lines in lines.chunks(LINES) {
        let mut above = _mm256_setzero_si256();
        for line in lines {
            fetch(line.as_ptr().cast::<u8>().wrapping_add(AHEAD));
            for words in halves(line) {
                above = _mm256_sub_epi16(above, _mm256_cmpeq_epi16(_mm256_max_epu16(words, border), words));
            }
        }
        count += lanes_i32(_mm256_madd_epi16(above, one)).iter().sum::<i32>() as u32;
    }
    count
}

/// A line's words as vectors.
#[target_feature(enable = "avx2")]
#[inline]
fn halves(line: &[u16; LINE]) -> [__m256i; 2] {
    // SAFETY: both unaligned 32-byte loads lie within the 64 bytes.
    [0, LINE / 2].map(|at| unsafe { _mm256_loadu_si256(line.as_ptr().add(at).cast()) })
}

/// See [`Kernel::kept_in_row`].
pub(super) fn kept_in_row(width: usize) -> usize {
    Parts::of(width).kept()
}

/// See [`Kernel::count`].
#[target_feature(enable = "avx2")]
pub(super) fn count<'r>(
    kernel: &Kernel,
    images: impl Iterator<Item = Images<'r>>,
    width: usize,
    kept: &[u16],
    first: i32,
) -> u32 {
    if let Some(factors) = kernel.factors {
        let products = &Products::of([factors]);
        by_reading!(kernel, count_of::<1>(products, images, width, kept, first))
    } else {
        let products = &Products::of(Factors::both(kernel.weights));
        by_reading!(kernel, count_of::<2>(products, images, width, kept, first))
    }
}

#[target_feature(enable = "avx2")]
fn count_of<'r, const DIFFERENCE: u8, const SETS: usize>(
    products: &Products<SETS>,
    images: impl Iterator<Item = Images<'r>>,
    width: usize,
    kept: &[u16],
    first: i32,
) -> u32 {
    let block = Block::of(products, width);
    let border = _mm256_set1_epi32(first.saturating_sub(1));
    let skip = first > i32::from(u16::MAX);
    let mut above = _mm256_setzero_si256();
    let mut kept = kept.chunks_exact(block.parts.kept());
    for images in images.filter_map(|images| block.parts.of_row(images)) {
        let kept = kept.next().unwrap_or_default();
        above = _mm256_sub_epi32(above, block.above::<DIFFERENCE>(images, kept, border, skip));
    }
    lanes_i32(above).iter().sum::<i32>() as u32
}

/// See [`Kernel::first_place`].
#[target_feature(enable = "avx2")]
pub(super) fn first_place(kernel: &Kernel, images: Images<'_>, width: usize, level: i32) -> Option<usize> {
    // Every kernel has both, and one row takes no time.
    let products = &Products::of(Factors::both(kernel.weights));
    by_reading!(kernel, first_place_of::<2>(products, images, width, level))
}

#[target_feature(enable = "avx2")]
fn first_place_of<const DIFFERENCE: u8, const SETS: usize>(
    products: &Products<SETS>,
    images: Images<'_>,
    width: usize,
    level: i32,
) -> Option<usize> {
    let block = Block::of(products, width);
    block.first_place::<DIFFERENCE>(block.parts.of_row(images)?, level)
}
