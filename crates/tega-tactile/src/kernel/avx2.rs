//! Row kernels on 256-bit vectors: 32 pixels a step.
//!
//! Where levels are kept, sixteen of them are a vector of words, whose largest says which rows have to be looked at again
//! for the exact one.

#![allow(unsafe_code)]

mod levels;
mod tail;

use std::arch::x86_64::{
    __m256i, _mm_add_epi64, _mm_cvtsi128_si32, _mm_cvtsi128_si64, _mm_max_epi32, _mm_max_epu16,
    _mm_min_epi32, _mm_minpos_epu16, _mm_set1_epi32, _mm_shuffle_epi32, _mm_unpackhi_epi64, _mm_xor_si128,
    _mm256_add_epi32, _mm256_add_epi64, _mm256_and_si256, _mm256_castsi256_si128, _mm256_cmpeq_epi16,
    _mm256_cmpgt_epi32, _mm256_cvtepi32_epi64, _mm256_extracti128_si256, _mm256_loadu_si256,
    _mm256_max_epi32, _mm256_max_epu16, _mm256_min_epi32, _mm256_movemask_epi8, _mm256_mul_epi32,
    _mm256_or_si256, _mm256_packus_epi32, _mm256_set1_epi16, _mm256_set1_epi32, _mm256_setzero_si256,
    _mm256_srli_epi64, _mm256_storeu_si256, _mm256_sub_epi32,
};

use levels::{GROUPS, LANES, PIXELS, Products, levels, levels_of_eight};

use tail::Tail;

use super::factors::Factors;
use super::{ABSOLUTE, Images, Kernel, RECTIFIED, Row, SIGNED, kept_in_row};
use crate::frame::Difference;

/// Puts each 32 columns into the order of [`levels`], or back into that of the row.
fn order(columns: &mut [[i32; PIXELS]], grouped: bool) {
    for columns in columns {
        let old = *columns;
        for (group, new) in columns.as_chunks_mut::<4>().0.iter_mut().enumerate() {
            // Group 2k is k of the row and group 2k + 1 is k + 4, or the other way round.
            let at = if grouped { group / 2 + 4 * (group % 2) } else { 2 * (group % 4) + group / 4 };
            new.copy_from_slice(&old[4 * at..4 * at + 4]);
        }
    }
}

#[target_feature(enable = "avx2")]
#[inline]
fn lanes_i32(v: __m256i) -> [i32; LANES] {
    let mut out = [0; LANES];
    // SAFETY: `out` is exactly 32 bytes.
    unsafe { _mm256_storeu_si256(out.as_mut_ptr().cast(), v) };
    out
}

/// Sum, smallest or largest of eight lanes.
macro_rules! fold_lanes {
    ($v:expr, $op:ident) => {{
        let v = $v;
        let half = $op(_mm256_castsi256_si128(v), _mm256_extracti128_si256::<1>(v));
        let pair = $op(half, _mm_shuffle_epi32::<0b01_00_11_10>(half));
        _mm_cvtsi128_si32($op(pair, _mm_shuffle_epi32::<0b10_11_00_01>(pair)))
    }};
}

/// What one row's vectors say so far.
#[derive(Clone, Copy)]
struct Lanes {
    sum: __m256i,
    squares: __m256i,
    min: __m256i,
    max: __m256i,
}

impl Lanes {
    #[target_feature(enable = "avx2")]
    fn none<const KEPT: bool>() -> Self {
        let zero = _mm256_setzero_si256();
        let max = if KEPT { zero } else { _mm256_set1_epi32(i32::MIN) };
        Self { sum: zero, squares: zero, min: _mm256_set1_epi32(i32::MAX), max }
    }

    /// Takes eight levels `n`; `range` is the same, whose smallest and largest are looked for.
    #[target_feature(enable = "avx2")]
    #[inline]
    fn take<const DIFFERENCE: u8, const SQUARES: bool, const KEPT: bool>(
        &mut self,
        n: __m256i,
        range: __m256i,
    ) {
        self.sum = _mm256_add_epi32(self.sum, n);
        if DIFFERENCE == SIGNED && !KEPT {
            self.min = _mm256_min_epi32(self.min, range);
        }
        if !KEPT {
            self.max = _mm256_max_epi32(self.max, range);
        }
        if SQUARES {
            let odd = _mm256_srli_epi64::<32>(n);
            self.squares = _mm256_add_epi64(self.squares, _mm256_mul_epi32(n, n));
            self.squares = _mm256_add_epi64(self.squares, _mm256_mul_epi32(odd, odd));
        }
    }

    /// The row. Its largest level is that of the words, where levels are kept.
    #[target_feature(enable = "avx2")]
    #[inline]
    fn row<const DIFFERENCE: u8, const SQUARES: bool, const KEPT: bool>(&self, least: i32) -> Row {
        // The lanes' total may pass `i32`; the eight lanes themselves do not.
        let [low, high] = [_mm256_castsi256_si128(self.sum), _mm256_extracti128_si256::<1>(self.sum)];
        let looked_for = DIFFERENCE == SIGNED && !KEPT;
        Row {
            sum: total(_mm256_add_epi64(_mm256_cvtepi32_epi64(low), _mm256_cvtepi32_epi64(high))),
            squares: if SQUARES { total(self.squares) } else { 0 },
            min: if looked_for { fold_lanes!(self.min, _mm_min_epi32) } else { least },
            max: if KEPT { largest_word(self.max) } else { fold_lanes!(self.max, _mm_max_epi32) },
        }
    }
}

/// Sum of four lanes of 64 bits.
#[target_feature(enable = "avx2")]
#[inline]
fn total(v: __m256i) -> i64 {
    let half = _mm_add_epi64(_mm256_castsi256_si128(v), _mm256_extracti128_si256::<1>(v));
    _mm_cvtsi128_si64(_mm_add_epi64(half, _mm_unpackhi_epi64(half, half)))
}

/// The largest of sixteen words without sign.
#[target_feature(enable = "avx2")]
#[inline]
fn largest_word(v: __m256i) -> i32 {
    let half = _mm_max_epu16(_mm256_castsi256_si128(v), _mm256_extracti128_si256::<1>(v));
    // The processor finds the smallest: that of the complements is the largest of these.
    let least = _mm_cvtsi128_si32(_mm_minpos_epu16(_mm_xor_si128(half, _mm_set1_epi32(-1))));
    0xffff - (least & 0xffff)
}

/// Adds levels to eight columns.
#[target_feature(enable = "avx2")]
#[inline]
fn add(columns: &mut [i32; LANES], n: __m256i) {
    let at = columns.as_mut_ptr().cast();
    // SAFETY: `columns` is exactly 32 bytes, borrowed mutably.
    unsafe { _mm256_storeu_si256(at, _mm256_add_epi32(_mm256_loadu_si256(at), n)) };
}

/// Keeps sixteen levels as words, at most 65,535 each, in any order, and takes their largest.
#[target_feature(enable = "avx2")]
#[inline]
fn keep(kept: &mut [u16; 2 * LANES], largest: &mut __m256i, [low, high]: [__m256i; 2]) {
    let words = _mm256_packus_epi32(low, high);
    *largest = _mm256_max_epu16(*largest, words);
    // SAFETY: `kept` is exactly 32 bytes, borrowed mutably.
    unsafe { _mm256_storeu_si256(kept.as_mut_ptr().cast(), words) };
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
    let width = columns.len();
    let in_row = if KEPT { kept_in_row(width) } else { 0 };
    let mut block = Block::<SETS> {
        products,
        tail: Tail::of(width),
        columns: columns.as_chunks_mut().0,
        last_columns: [[0; LANES]; GROUPS],
        least: kernel.least(),
    };
    order(block.columns, true);
    let mut rest = kept;
    for (row, images) in rows.iter_mut().zip(images) {
        let (kept, others) = rest.split_at_mut(in_row);
        *row = block.sum_up::<DIFFERENCE, SQUARES, KEPT>(&images, kept);
        rest = others;
    }
    order(block.columns, false);
    let (from, last_columns) = (block.tail.from, block.last_columns);
    for (column, sum) in columns[from..].iter_mut().zip(last_columns.as_flattened()) {
        *column += sum;
    }
}

/// What the rows of a picture share.
struct Block<'b, const SETS: usize> {
    products: &'b Products<SETS>,
    tail: Tail,
    /// Columns of the whole steps, in the order of [`levels`].
    columns: &'b mut [[i32; PIXELS]],
    /// Columns of the tail's eights, as they lie.
    last_columns: [[i32; LANES]; GROUPS],
    /// What no level falls below.
    least: i32,
}

impl<const SETS: usize> Block<'_, SETS> {
    /// Sums up a row, and keeps its levels where asked for.
    #[target_feature(enable = "avx2")]
    #[inline]
    fn sum_up<const DIFFERENCE: u8, const SQUARES: bool, const KEPT: bool>(
        &mut self,
        images: &Images<'_>,
        kept: &mut [u16],
    ) -> Row {
        let mut lanes = Lanes::none::<KEPT>();
        self.steps::<DIFFERENCE, SQUARES, KEPT>(images, kept, &mut lanes);
        if self.tail.eights > 0 {
            self.eights::<DIFFERENCE, SQUARES, KEPT>(images, kept, &mut lanes);
        }
        let mut row = lanes.row::<DIFFERENCE, SQUARES, KEPT>(self.least);
        // A word of 0 may stand for less, one of 65,535 for more.
        if KEPT && (row.max == i32::from(u16::MAX) || (DIFFERENCE == SIGNED && row.max == 0)) {
            row.max = self.largest::<DIFFERENCE>(images, kept, row.max as u16);
        }
        row
    }

    /// The whole steps of a row.
    #[target_feature(enable = "avx2")]
    #[inline]
    fn steps<const DIFFERENCE: u8, const SQUARES: bool, const KEPT: bool>(
        &mut self,
        [frame, baseline]: &Images<'_>,
        kept: &mut [u16],
        lanes: &mut Lanes,
    ) {
        let (frame, baseline) = (frame.as_chunks().0, baseline.as_chunks().0);
        let kept = kept.as_chunks_mut::<PIXELS>().0;
        let steps = self.columns.len().min(frame.len()).min(baseline.len());
        for step in 0..if KEPT { steps.min(kept.len()) } else { steps } {
            // SAFETY: neither image has fewer steps, and there are as many columns.
            let (f, b, columns) = unsafe {
                (
                    frame.get_unchecked(step),
                    baseline.get_unchecked(step),
                    self.columns.get_unchecked_mut(step),
                )
            };
            let n = levels::<DIFFERENCE, SETS>(f, b, self.products);
            for (n, columns) in n.iter().zip(columns.as_chunks_mut().0) {
                lanes.take::<DIFFERENCE, SQUARES, KEPT>(*n, *n);
                add(columns, *n);
            }
            if KEPT {
                // SAFETY: nor fewer kept.
                let kept = unsafe { kept.get_unchecked_mut(step) };
                for (n, kept) in n.as_chunks::<2>().0.iter().zip(kept.as_chunks_mut().0) {
                    keep(kept, &mut lanes.max, *n);
                }
            }
        }
    }

    /// What a row has beyond its whole steps: eights up to its end, of which the first overlaps the steps.
    #[target_feature(enable = "avx2")]
    #[inline]
    fn eights<const DIFFERENCE: u8, const SQUARES: bool, const KEPT: bool>(
        &mut self,
        [frame, baseline]: &Images<'_>,
        kept: &mut [u16],
        lanes: &mut Lanes,
    ) {
        let eights = self.tail.of_row(frame).iter().zip(self.tail.of_row(baseline));
        let mut masked = [_mm256_setzero_si256(); GROUPS];
        let mut new = self.tail.not_had();
        for (((f, b), columns), masked) in eights.zip(&mut self.last_columns).zip(&mut masked) {
            let n = levels_of_eight::<DIFFERENCE, SETS>(f, b, self.products);
            *masked = _mm256_and_si256(n, new);
            // Levels of pixels that the steps have had change no largest and no smallest one.
            lanes.take::<DIFFERENCE, SQUARES, KEPT>(*masked, n);
            add(columns, *masked);
            new = _mm256_set1_epi32(-1);
        }
        if KEPT {
            let kept = kept.get_mut(self.tail.whole..).unwrap_or_default();
            for (n, kept) in masked.as_chunks::<2>().0.iter().zip(kept.as_chunks_mut().0) {
                keep(kept, &mut lanes.max, *n);
            }
        }
    }

    /// The largest level of a row, sought where the largest of its words are.
    #[target_feature(enable = "avx2")]
    #[inline(never)]
    fn largest<const DIFFERENCE: u8>(&self, [frame, baseline]: &Images<'_>, kept: &[u16], word: u16) -> i32 {
        let mut max = _mm256_set1_epi32(i32::MIN);
        let steps = frame.as_chunks().0.iter().zip(baseline.as_chunks().0);
        for ((f, b), kept) in steps.zip(kept.as_chunks().0) {
            if holds(kept, word) {
                for n in levels::<DIFFERENCE, SETS>(f, b, self.products) {
                    max = _mm256_max_epi32(max, n);
                }
            }
        }
        for (f, b) in self.tail.of_row(frame).iter().zip(self.tail.of_row(baseline)) {
            max = _mm256_max_epi32(max, levels_of_eight::<DIFFERENCE, SETS>(f, b, self.products));
        }
        fold_lanes!(max, _mm_max_epi32)
    }
}

/// Whether one of a step's words is `word`.
#[target_feature(enable = "avx2")]
#[inline]
fn holds(kept: &[u16; PIXELS], word: u16) -> bool {
    let word = _mm256_set1_epi16(word.cast_signed());
    // SAFETY: both unaligned 32-byte loads lie within the 64 bytes.
    let equal = [0, 2 * LANES]
        .map(|at| unsafe { _mm256_cmpeq_epi16(_mm256_loadu_si256(kept.as_ptr().add(at).cast()), word) });
    _mm256_movemask_epi8(_mm256_or_si256(equal[0], equal[1])) != 0
}

/// See [`Kernel::count_kept`].
#[target_feature(enable = "avx2")]
pub(super) fn count_kept(kept: &[u16], first: u16) -> u32 {
    super::count_words(kept, first)
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
        count_by_reading!(kernel, count_of::<1>(products, images, width, kept, first))
    } else {
        let products = &Products::of(Factors::both(kernel.weights));
        count_by_reading!(kernel, count_of::<2>(products, images, width, kept, first))
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
    let (tail, border) = (Tail::of(width), _mm256_set1_epi32(first.saturating_sub(1)));
    let mut above = [_mm256_setzero_si256(); GROUPS];
    let mut kept = kept.chunks_exact(kept_in_row(width));
    for [frame, baseline] in images {
        let mut kept = kept.next().unwrap_or_default().as_chunks::<PIXELS>().0.iter();
        for (f, b) in frame.as_chunks().0.iter().zip(baseline.as_chunks().0) {
            // Only a word of 65,535 may stand for as much.
            if first > i32::from(u16::MAX) && kept.next().is_some_and(|kept| !holds(kept, u16::MAX)) {
                continue;
            }
            for (above, n) in above.iter_mut().zip(levels::<DIFFERENCE, SETS>(f, b, products)) {
                // A true comparison is −1, so subtracting it counts.
                *above = _mm256_sub_epi32(*above, _mm256_cmpgt_epi32(n, border));
            }
        }
        let mut new = tail.not_had();
        for (f, b) in tail.of_row(frame).iter().zip(tail.of_row(baseline)) {
            let n = levels_of_eight::<DIFFERENCE, SETS>(f, b, products);
            above[0] = _mm256_sub_epi32(above[0], _mm256_and_si256(new, _mm256_cmpgt_epi32(n, border)));
            new = _mm256_set1_epi32(-1);
        }
    }
    let above: i32 = above.iter().flat_map(|lanes| lanes_i32(*lanes)).sum();
    above as u32
}
