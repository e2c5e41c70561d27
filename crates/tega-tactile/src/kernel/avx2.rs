//! Row kernels on 256-bit vectors: 32 pixels a step.
//!
//! Where levels are kept, sixteen of them are a vector of words, whose largest says which rows have to be looked at again
//! for the exact one.

#![allow(unsafe_code)]

mod levels;

use std::arch::x86_64::{
    __m256i, _mm_add_epi64, _mm_cvtsi128_si32, _mm_cvtsi128_si64, _mm_max_epi32, _mm_max_epu16,
    _mm_min_epi32, _mm_minpos_epu16, _mm_set1_epi32, _mm_shuffle_epi32, _mm_unpackhi_epi64, _mm_xor_si128,
    _mm256_add_epi32, _mm256_add_epi64, _mm256_castsi256_si128, _mm256_cmpeq_epi16, _mm256_cmpgt_epi32,
    _mm256_cvtepi32_epi64, _mm256_extracti128_si256, _mm256_loadu_si256, _mm256_max_epi32, _mm256_max_epu16,
    _mm256_min_epi32, _mm256_movemask_epi8, _mm256_mul_epi32, _mm256_or_si256, _mm256_packus_epi32,
    _mm256_set1_epi16, _mm256_set1_epi32, _mm256_setzero_si256, _mm256_srli_epi64, _mm256_storeu_si256,
    _mm256_sub_epi32,
};

use levels::{BYTES, GROUPS, LANES, PIXELS, Products, STEP, levels, levels_of_eight};

use super::factors::Factors;
use super::{ABSOLUTE, Kernel, RECTIFIED, Row, SIGNED};
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

    #[target_feature(enable = "avx2")]
    #[inline]
    fn take<const DIFFERENCE: u8, const SQUARES: bool, const KEPT: bool>(&mut self, n: __m256i) {
        self.sum = _mm256_add_epi32(self.sum, n);
        if DIFFERENCE == SIGNED && !KEPT {
            self.min = _mm256_min_epi32(self.min, n);
        }
        if !KEPT {
            self.max = _mm256_max_epi32(self.max, n);
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
pub(super) fn rows(
    kernel: &Kernel,
    frame: &[u8],
    baseline: &[u8],
    columns: &mut [i32],
    rows: &mut [Row],
    kept: &mut [u16],
) {
    order(columns.as_chunks_mut::<PIXELS>().0, true);
    if let Some(factors) = kernel.factors {
        let products = &Products::of([factors]);
        if kept.is_empty() {
            rows_by_reading!(kernel, rows_of::<false, 1>(products, frame, baseline, columns, rows, kept));
        } else {
            rows_by_reading!(kernel, rows_of::<true, 1>(products, frame, baseline, columns, rows, kept));
        }
    } else {
        let products = &Products::of(Factors::both(kernel.weights));
        rows_by_reading!(kernel, rows_of::<false, 2>(products, frame, baseline, columns, rows, kept));
    }
    order(columns.as_chunks_mut::<PIXELS>().0, false);
}

/// Rows whose levels are kept as words where asked for.
#[target_feature(enable = "avx2")]
fn rows_of<const DIFFERENCE: u8, const SQUARES: bool, const KEPT: bool, const SETS: usize>(
    kernel: &Kernel,
    products: &Products<SETS>,
    frame: &[u8],
    baseline: &[u8],
    columns: &mut [i32],
    rows: &mut [Row],
    kept: &mut [u16],
) {
    let (width, least) = (columns.len(), kernel.least());
    let mut kept = kept.chunks_exact_mut(width);
    let images = frame.chunks_exact(3 * width).zip(baseline.chunks_exact(3 * width));
    for ((frame, baseline), row) in images.zip(rows) {
        let kept = kept.next().unwrap_or_default();
        let lanes = steps::<DIFFERENCE, SQUARES, KEPT, SETS>(products, frame, baseline, columns, kept);
        *row = lanes.row::<DIFFERENCE, SQUARES, KEPT>(least);
        // A word of 0 may stand for less, one of 65,535 for more.
        if KEPT && (row.max == i32::from(u16::MAX) || (DIFFERENCE == SIGNED && row.max == 0)) {
            row.max = largest::<DIFFERENCE, SETS>(products, frame, baseline, kept, row.max as u16);
        }
        if !width.is_multiple_of(PIXELS) {
            rest::<DIFFERENCE, SQUARES, KEPT, SETS>(kernel, products, frame, baseline, columns, kept, row);
        }
    }
}

/// The whole steps of a row.
#[target_feature(enable = "avx2")]
#[inline]
fn steps<const DIFFERENCE: u8, const SQUARES: bool, const KEPT: bool, const SETS: usize>(
    products: &Products<SETS>,
    frame: &[u8],
    baseline: &[u8],
    columns: &mut [i32],
    kept: &mut [u16],
) -> Lanes {
    let mut lanes = Lanes::none::<KEPT>();
    let mut kept = kept.as_chunks_mut::<{ 2 * LANES }>().0.iter_mut();
    let pixels = frame.as_chunks::<STEP>().0.iter().zip(baseline.as_chunks::<STEP>().0);
    for ((f, b), columns) in pixels.zip(columns.as_chunks_mut::<PIXELS>().0) {
        let n = levels::<DIFFERENCE, SETS>(f, b, products);
        for (n, columns) in n.iter().zip(columns.as_chunks_mut::<LANES>().0) {
            lanes.take::<DIFFERENCE, SQUARES, KEPT>(*n);
            add(columns, *n);
        }
        if KEPT {
            for n in n.as_chunks::<2>().0 {
                if let Some(kept) = kept.next() {
                    keep(kept, &mut lanes.max, *n);
                }
            }
        }
    }
    lanes
}

/// What a row has beyond its whole steps.
#[target_feature(enable = "avx2")]
#[inline(never)]
fn rest<const DIFFERENCE: u8, const SQUARES: bool, const KEPT: bool, const SETS: usize>(
    kernel: &Kernel,
    products: &Products<SETS>,
    frame: &[u8],
    baseline: &[u8],
    columns: &mut [i32],
    kept: &mut [u16],
    row: &mut Row,
) {
    let whole = columns.len() / PIXELS * PIXELS;
    let (frame, baseline, columns) = (&frame[3 * whole..], &baseline[3 * whole..], &mut columns[whole..]);
    let (f_eights, f) = frame.as_chunks::<BYTES>();
    let (b_eights, b) = baseline.as_chunks::<BYTES>();
    let (eights, last) = columns.as_chunks_mut::<LANES>();
    let mut lanes = Lanes::none::<false>();
    for ((f, b), columns) in f_eights.iter().zip(b_eights).zip(eights) {
        let n = levels_of_eight::<DIFFERENCE, SETS>(f, b, products);
        lanes.take::<DIFFERENCE, SQUARES, false>(n);
        add(columns, n);
    }
    let begun = if whole == 0 { i32::MIN } else { row.max };
    let others = [lanes.row::<DIFFERENCE, SQUARES, false>(row.min), kernel.row(f, b, last)];
    row.max = others.iter().map(|other| other.max).fold(begun, i32::max);
    for other in others {
        row.sum += other.sum;
        row.squares += other.squares;
        row.min = row.min.min(other.min);
    }
    if KEPT {
        kernel.keep_plain(frame, baseline, &mut kept[whole..]);
    }
}

/// The largest level of a row's whole steps, sought where the largest of their words are.
#[target_feature(enable = "avx2")]
#[inline(never)]
fn largest<const DIFFERENCE: u8, const SETS: usize>(
    products: &Products<SETS>,
    frame: &[u8],
    baseline: &[u8],
    kept: &[u16],
    word: u16,
) -> i32 {
    let pixels = frame.as_chunks::<STEP>().0.iter().zip(baseline.as_chunks::<STEP>().0);
    let mut max = _mm256_set1_epi32(i32::MIN);
    for ((f, b), kept) in pixels.zip(kept.as_chunks().0) {
        if holds(kept, word) {
            for n in levels::<DIFFERENCE, SETS>(f, b, products) {
                max = _mm256_max_epi32(max, n);
            }
        }
    }
    fold_lanes!(max, _mm_max_epi32)
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
pub(super) fn count(kernel: &Kernel, frame: &[u8], baseline: &[u8], kept: &[u16], first: i32) -> u32 {
    if let Some(factors) = kernel.factors {
        let products = &Products::of([factors]);
        count_by_reading!(kernel, count_of::<1>(products, frame, baseline, kept, first))
    } else {
        let products = &Products::of(Factors::both(kernel.weights));
        count_by_reading!(kernel, count_of::<2>(products, frame, baseline, kept, first))
    }
}

#[target_feature(enable = "avx2")]
fn count_of<const DIFFERENCE: u8, const SETS: usize>(
    kernel: &Kernel,
    products: &Products<SETS>,
    frame: &[u8],
    baseline: &[u8],
    kept: &[u16],
    first: i32,
) -> u32 {
    let (steps, rest) = frame.as_chunks::<STEP>();
    let (baseline_steps, baseline_rest) = baseline.as_chunks::<STEP>();
    let border = _mm256_set1_epi32(first);
    let mut below = [_mm256_setzero_si256(); GROUPS];
    let mut looked_at = 0;
    let mut kept = kept.as_chunks::<PIXELS>().0.iter();
    for (f, b) in steps.iter().zip(baseline_steps) {
        // Only a word of 65,535 may stand for as much.
        if first > i32::from(u16::MAX) && kept.next().is_some_and(|kept| !holds(kept, u16::MAX)) {
            continue;
        }
        looked_at += 1;
        for (below, n) in below.iter_mut().zip(levels::<DIFFERENCE, SETS>(f, b, products)) {
            // A true comparison is −1, so subtracting it counts.
            *below = _mm256_sub_epi32(*below, _mm256_cmpgt_epi32(border, n));
        }
    }
    let below: i32 = below.iter().flat_map(|lanes| lanes_i32(*lanes)).sum();
    looked_at * PIXELS as u32 - below as u32 + kernel.count_plain(rest, baseline_rest, first)
}
