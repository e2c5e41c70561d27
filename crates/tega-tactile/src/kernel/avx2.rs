//! Row kernels on 256-bit vectors: 32 pixels of two rows a step.
//!
//! Both rows' levels are added up before they go to the columns. Where levels are kept, sixteen of them are a vector of
//! words, whose largest says which rows have to be looked at again for the exact one.

#![allow(unsafe_code)]

mod levels;

use std::arch::x86_64::{
    __m256i, _mm_cvtsi128_si32, _mm_max_epi32, _mm_max_epu16, _mm_min_epi32, _mm_minpos_epu16,
    _mm_set1_epi32, _mm_shuffle_epi32, _mm_xor_si128, _mm256_add_epi32, _mm256_add_epi64,
    _mm256_castsi256_si128, _mm256_cmpeq_epi16, _mm256_cmpgt_epi32, _mm256_cvtepi32_epi64,
    _mm256_extracti128_si256, _mm256_loadu_si256, _mm256_max_epi32, _mm256_max_epu16, _mm256_min_epi32,
    _mm256_movemask_epi8, _mm256_mul_epi32, _mm256_or_si256, _mm256_packus_epi32, _mm256_set1_epi16,
    _mm256_set1_epi32, _mm256_setzero_si256, _mm256_srli_epi64, _mm256_storeu_si256, _mm256_sub_epi32,
};
use std::array::from_fn;

use levels::{BYTES, GROUPS, LANES, PIXELS, Pairs, STEP, levels, levels_of_eight};

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

#[target_feature(enable = "avx2")]
#[inline]
fn lanes_i64(v: __m256i) -> [i64; LANES / 2] {
    let mut out = [0; LANES / 2];
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

    /// The row, with the pixels that no vector took. Its largest level is that of the words, where levels are kept.
    #[target_feature(enable = "avx2")]
    fn row<const DIFFERENCE: u8, const SQUARES: bool, const KEPT: bool>(
        &self,
        kernel: &Kernel,
        tail: Row,
    ) -> Row {
        let squares = if SQUARES { lanes_i64(self.squares).iter().sum::<i64>() } else { 0 };
        // The lanes' total may pass `i32`; the eight lanes themselves do not.
        let [low, high] = [_mm256_castsi256_si128(self.sum), _mm256_extracti128_si256::<1>(self.sum)];
        let wide = _mm256_add_epi64(_mm256_cvtepi32_epi64(low), _mm256_cvtepi32_epi64(high));
        let looked_for = DIFFERENCE == SIGNED && !KEPT;
        Row {
            sum: tail.sum + lanes_i64(wide).iter().sum::<i64>(),
            squares: tail.squares + squares,
            min: if looked_for { fold_lanes!(self.min, _mm_min_epi32).min(tail.min) } else { kernel.least() },
            max: if KEPT { largest_word(self.max) } else { fold_lanes!(self.max, _mm_max_epi32) }
                .max(tail.max),
        }
    }
}

/// The largest of sixteen words without sign.
#[target_feature(enable = "avx2")]
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
    rows: &mut Vec<Row>,
    kept: &mut [u16],
) {
    let bytes = 3 * columns.len();
    // With squares the sums of two rows do not fit into the registers.
    let pairs = if kernel.squares { 0 } else { frame.len() / (2 * bytes) * 2 * bytes };
    let (frame, last) = frame.split_at(pairs);
    let (baseline, baseline_last) = baseline.split_at(pairs);
    let (kept, kept_last) = kept.split_at_mut((pairs / 3).min(kept.len()));
    order(columns.as_chunks_mut::<PIXELS>().0, true);
    rows_by_reading!(kernel, rows_of(frame, baseline, columns, rows, kept));
    rows_by_reading!(kernel, rows_alone(last, baseline_last, columns, rows, kept_last));
    order(columns.as_chunks_mut::<PIXELS>().0, false);
}

/// Whole pairs of rows.
#[target_feature(enable = "avx2")]
fn rows_of<const DIFFERENCE: u8, const SQUARES: bool>(
    kernel: &Kernel,
    frame: &[u8],
    baseline: &[u8],
    columns: &mut [i32],
    rows: &mut Vec<Row>,
    kept: &mut [u16],
) {
    let width = columns.len();
    let mut kept = kept.chunks_exact_mut(2 * width);
    for (frame, baseline) in frame.chunks_exact(6 * width).zip(baseline.chunks_exact(6 * width)) {
        let (f, b) = (frame.split_at(3 * width), baseline.split_at(3 * width));
        let (f, b) = ([f.0, f.1], [b.0, b.1]);
        rows.extend(match kept.next() {
            Some(kept) => {
                let (first, second) = kept.split_at_mut(width);
                together::<DIFFERENCE, SQUARES, true, 2>(kernel, f, b, columns, [first, second])
            }
            _ => together::<DIFFERENCE, SQUARES, false, 2>(kernel, f, b, columns, [&mut [], &mut []]),
        });
    }
}

/// Rows one by one.
#[target_feature(enable = "avx2")]
fn rows_alone<const DIFFERENCE: u8, const SQUARES: bool>(
    kernel: &Kernel,
    frame: &[u8],
    baseline: &[u8],
    columns: &mut [i32],
    rows: &mut Vec<Row>,
    kept: &mut [u16],
) {
    let width = columns.len();
    let mut kept = kept.chunks_exact_mut(width);
    for (frame, baseline) in frame.chunks_exact(3 * width).zip(baseline.chunks_exact(3 * width)) {
        rows.extend(match kept.next() {
            Some(kept) => {
                together::<DIFFERENCE, SQUARES, true, 1>(kernel, [frame], [baseline], columns, [kept])
            }
            _ => together::<DIFFERENCE, SQUARES, false, 1>(kernel, [frame], [baseline], columns, [&mut []]),
        });
    }
}

/// Rows whose levels are added up before they go to the columns, and kept as words where asked for.
#[target_feature(enable = "avx2")]
#[inline]
fn together<const DIFFERENCE: u8, const SQUARES: bool, const KEPT: bool, const N: usize>(
    kernel: &Kernel,
    frame: [&[u8]; N],
    baseline: [&[u8]; N],
    columns: &mut [i32],
    kept: [&mut [u16]; N],
) -> [Row; N] {
    let weights = Pairs::of(kernel.weights);
    let mut lanes = [Lanes::none::<KEPT>(); N];
    let (steps, rest) = columns.as_chunks_mut::<PIXELS>();
    let frame_steps = frame.map(|row| row.as_chunks::<STEP>());
    let baseline_steps = baseline.map(|row| row.as_chunks::<STEP>());
    let mut kept = kept.map(|row| row.as_chunks_mut::<PIXELS>());
    for (x, columns) in steps.iter_mut().enumerate() {
        let mut total = [_mm256_setzero_si256(); GROUPS];
        for y in 0..N {
            // Rows are as long as the columns are many.
            let (Some(f), Some(b)) = (frame_steps[y].0.get(x), baseline_steps[y].0.get(x)) else { continue };
            let n = levels::<DIFFERENCE>(f, b, weights);
            for k in 0..GROUPS {
                lanes[y].take::<DIFFERENCE, SQUARES, KEPT>(n[k]);
                total[k] = _mm256_add_epi32(total[k], n[k]);
            }
            if KEPT && let Some(kept) = kept[y].0.get_mut(x) {
                let (kept, _) = kept.as_chunks_mut::<{ 2 * LANES }>();
                keep(&mut kept[0], &mut lanes[y].max, [n[0], n[1]]);
                keep(&mut kept[1], &mut lanes[y].max, [n[2], n[3]]);
            }
        }
        for (columns, n) in columns.as_chunks_mut::<LANES>().0.iter_mut().zip(total) {
            add(columns, n);
        }
    }
    let (eights, last) = rest.as_chunks_mut::<LANES>();
    from_fn(|y| {
        let ((f_eights, f), (b_eights, b)) =
            (frame_steps[y].1.as_chunks::<BYTES>(), baseline_steps[y].1.as_chunks::<BYTES>());
        let (kept_eights, kept_last) = kept[y].1.as_chunks_mut::<LANES>();
        for (x, columns) in eights.iter_mut().enumerate() {
            let n = levels_of_eight::<DIFFERENCE>(&f_eights[x], &b_eights[x], weights);
            lanes[y].take::<DIFFERENCE, SQUARES, KEPT>(n);
            add(columns, n);
            if KEPT && let Some(kept) = kept_eights.get_mut(x) {
                let mut words = [0; 2 * LANES];
                keep(&mut words, &mut lanes[y].max, [n, n]);
                let (half, _) = words.as_chunks::<4>();
                kept.copy_from_slice([half[0], half[2]].as_flattened());
            }
        }
        let mut row = lanes[y].row::<DIFFERENCE, SQUARES, KEPT>(kernel, kernel.row(f, b, last));
        if KEPT {
            kernel.keep_plain(f, b, kept_last);
            // A word of 0 may stand for less, one of 65,535 for more.
            let word = row.max.clamp(0, i32::from(u16::MAX)) as u16;
            if word == u16::MAX || (DIFFERENCE == SIGNED && word == 0) {
                row.max = largest::<DIFFERENCE>(kernel, frame[y], baseline[y], kept[y].0, word);
            }
        }
        row
    })
}

/// The largest level of a row, sought where the largest of its words are.
#[target_feature(enable = "avx2")]
fn largest<const DIFFERENCE: u8>(
    kernel: &Kernel,
    frame: &[u8],
    baseline: &[u8],
    kept: &[[u16; PIXELS]],
    word: u16,
) -> i32 {
    let weights = Pairs::of(kernel.weights);
    let (steps, rest) = frame.as_chunks::<STEP>();
    let (baseline_steps, baseline_rest) = baseline.as_chunks::<STEP>();
    let mut max = _mm256_set1_epi32(i32::MIN);
    for ((f, b), kept) in steps.iter().zip(baseline_steps).zip(kept) {
        if holds(kept, word) {
            max =
                levels::<DIFFERENCE>(f, b, weights).into_iter().fold(max, |max, n| _mm256_max_epi32(max, n));
        }
    }
    let pixels = rest.as_chunks::<3>().0.iter().zip(baseline_rest.as_chunks::<3>().0);
    let last = pixels.map(|(f, b)| kernel.grey(*f, *b)).max().unwrap_or(i32::MIN);
    fold_lanes!(max, _mm_max_epi32).max(last)
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
    count_by_reading!(kernel, count_of(frame, baseline, kept, first))
}

#[target_feature(enable = "avx2")]
fn count_of<const DIFFERENCE: u8>(
    kernel: &Kernel,
    frame: &[u8],
    baseline: &[u8],
    kept: &[u16],
    first: i32,
) -> u32 {
    let weights = Pairs::of(kernel.weights);
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
        for (below, n) in below.iter_mut().zip(levels::<DIFFERENCE>(f, b, weights)) {
            // A true comparison is −1, so subtracting it counts.
            *below = _mm256_sub_epi32(*below, _mm256_cmpgt_epi32(border, n));
        }
    }
    let below: i32 = below.iter().flat_map(|lanes| lanes_i32(*lanes)).sum();
    looked_at * PIXELS as u32 - below as u32 + kernel.count_plain(rest, baseline_rest, first)
}
