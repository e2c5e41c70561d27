//! Sum bands of four rows at once, byte by byte, on 256-bit vectors.
//!
//! Sums are linear in the channels, so the differences are summed as they lie, and weighed once a row or column. A vector of 32
//! bytes is taken as 16 words, each of a byte `low` and a byte `high`: sums of the words modulo 2^16 and sums of `high` give
//! both, as long as neither passes 2^16. Three vectors are 32 pixels, so that each byte of a vector has one channel.

use std::arch::x86_64::{
    __m256i, _mm_cvtsi128_si32, _mm_max_epi32, _mm_shuffle_epi32, _mm256_add_epi16, _mm256_add_epi32,
    _mm256_add_epi64, _mm256_adds_epi16, _mm256_castsi256_si128, _mm256_cmpgt_epi16, _mm256_cvtepi32_epi64,
    _mm256_extracti128_si256, _mm256_loadu_si256, _mm256_madd_epi16, _mm256_maddubs_epi16, _mm256_max_epi32,
    _mm256_max_epu8, _mm256_min_epu8, _mm256_set1_epi16, _mm256_setzero_si256, _mm256_slli_epi16,
    _mm256_srli_epi16, _mm256_storeu_si256, _mm256_sub_epi8, _mm256_sub_epi16, _mm256_subs_epu8,
};
use std::ops::Range;

use super::{BYTES, Halves, lanes_i32, lanes_i64, load, spread, weighed};
use crate::frame::Difference;
use crate::kernel::{ABSOLUTE, Kernel, RECTIFIED};

/// Bytes of a vector.
const VECTOR: usize = 32;
/// Words of a vector.
const WORDS: usize = VECTOR / 2;
/// Bytes of a step: as many pixels as a vector has bytes.
pub(crate) const STEP: usize = 3 * VECTOR;
/// Rows of a band.
pub(crate) const BAND: usize = 4;
/// Rows after which the sums of columns have to be taken out: 257 rows and more could pass 16 bits.
pub(crate) const MOST_ROWS: usize = 256;
/// Steps after which a count of 16 bits a lane has to be taken out.
const MOST_STEPS: usize = 8192;

/// Sums of the columns of one vector: of words modulo 2^16, and of their high bytes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Words {
    all: [u16; WORDS],
    high: [u16; WORDS],
}

impl Words {
    pub(crate) const NONE: Self = Self { all: [0; WORDS], high: [0; WORDS] };

    /// The sums of the 32 columns of bytes; starts again from 0.
    pub(crate) fn take(&mut self) -> [u16; VECTOR] {
        let mut bytes = [0; VECTOR];
        for (pair, (all, high)) in bytes.as_chunks_mut::<2>().0.iter_mut().zip(self.all.iter().zip(self.high))
        {
            *pair = [all.wrapping_sub(high << 8), high];
        }
        *self = Self::NONE;
        bytes
    }
}

/// What a band says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Band {
    /// Its first row, and how many it has.
    pub y: usize,
    pub rows: usize,
    /// No grey value of the band passes it.
    pub bound: i32,
}

impl Band {
    /// Its rows.
    pub(crate) fn ys(&self) -> Range<usize> {
        self.y..self.y + self.rows
    }
}

/// Where a band's sums go.
pub(crate) struct Sums<'s> {
    /// Of columns, a vector each.
    pub columns: &'s mut [Words],
    /// Of the columns behind the last whole step.
    pub rest: &'s mut [i32],
    /// Of rows.
    pub rows: &'s mut Vec<i64>,
    pub bands: &'s mut Vec<Band>,
}

#[target_feature(enable = "avx2")]
#[inline]
fn load_words<T: Copy>(words: &[T; WORDS]) -> __m256i {
    const { assert!(size_of::<T>() == 2) };
    // SAFETY: the array is exactly 32 bytes.
    unsafe { _mm256_loadu_si256(words.as_ptr().cast()) }
}

#[target_feature(enable = "avx2")]
#[inline]
fn store_words(words: &mut [u16; WORDS], v: __m256i) {
    // SAFETY: the array is exactly 32 bytes, borrowed mutably.
    unsafe { _mm256_storeu_si256(words.as_mut_ptr().cast(), v) };
}

/// The differences of 32 bytes.
///
/// # Safety
/// 32 bytes can be read from both addresses.
#[target_feature(enable = "avx2")]
#[inline]
unsafe fn difference<const DIFFERENCE: u8>(frame: *const u8, baseline: *const u8) -> __m256i {
    // SAFETY: the caller's.
    let (f, b) = unsafe { (_mm256_loadu_si256(frame.cast()), _mm256_loadu_si256(baseline.cast())) };
    if DIFFERENCE == ABSOLUTE {
        _mm256_sub_epi8(_mm256_max_epu8(f, b), _mm256_min_epu8(f, b))
    } else {
        _mm256_subs_epu8(f, b)
    }
}

/// Weights of the channels as they lie in a step: of the low and the high bytes of its three vectors' words.
#[target_feature(enable = "avx2")]
#[inline]
fn by_word(weights: [i32; 3]) -> [[__m256i; 2]; 3] {
    [0, 1, 2].map(|vector| {
        [0, 1].map(|half| {
            let mut words = [0_i16; WORDS];
            for (word, weight) in words.iter_mut().enumerate() {
                // Weights of this path fit 14 bits.
                *weight = weights[(VECTOR * vector + 2 * word + half) % 3] as i16;
            }
            load_words(&words)
        })
    })
}

/// Sums of rows and columns of whole rows of `bytes` bytes each, [`MOST_ROWS`] at most, of differences without sign.
#[target_feature(enable = "avx2")]
pub(crate) fn sum(kernel: &Kernel, frame: &[u8], baseline: &[u8], bytes: usize, sums: &mut Sums<'_>) {
    if kernel.difference == Difference::Absolute {
        sum_of::<ABSOLUTE>(kernel, frame, baseline, bytes, sums);
    } else {
        sum_of::<RECTIFIED>(kernel, frame, baseline, bytes, sums);
    }
}

#[target_feature(enable = "avx2")]
fn sum_of<const DIFFERENCE: u8>(
    kernel: &Kernel,
    frame: &[u8],
    baseline: &[u8],
    bytes: usize,
    sums: &mut Sums<'_>,
) {
    let (frames, frame_rest) = frame.split_at(frame.len() / (BAND * bytes) * (BAND * bytes));
    let (baselines, baseline_rest) = baseline.split_at(frames.len());
    let weights = by_word(kernel.weights);
    for (f, b) in frames.chunks_exact(BAND * bytes).zip(baselines.chunks_exact(BAND * bytes)) {
        band::<DIFFERENCE, BAND>(kernel, &weights, f, b, sums);
    }
    for (f, b) in frame_rest.chunks_exact(bytes).zip(baseline_rest.chunks_exact(bytes)) {
        band::<DIFFERENCE, 1>(kernel, &weights, f, b, sums);
    }
}

#[target_feature(enable = "avx2")]
#[inline]
fn band<const DIFFERENCE: u8, const ROWS: usize>(
    kernel: &Kernel,
    weights: &[[__m256i; 2]; 3],
    frame: &[u8],
    baseline: &[u8],
    sums: &mut Sums<'_>,
) {
    let zero = _mm256_setzero_si256();
    let bytes = frame.len() / ROWS;
    let steps = (bytes / STEP).min(sums.columns.len() / 3);
    // What the loads below rely on.
    assert!(baseline.len() == frame.len() && steps * STEP <= bytes);
    let (mut rows, mut most) = ([zero; ROWS], [[0_u8; VECTOR]; 3]);
    for vector in 0..3 {
        let (mut all, mut high, mut largest) = ([zero; ROWS], [zero; ROWS], zero);
        for (step, columns) in sums.columns.as_chunks_mut::<3>().0.iter_mut().take(steps).enumerate() {
            let columns = &mut columns[vector];
            let (mut column_all, mut column_high) = (load_words(&columns.all), load_words(&columns.high));
            for row in 0..ROWS {
                let at = row * bytes + step * STEP + vector * VECTOR;
                // SAFETY: `at` is within row `row`, 32 bytes or more before the end of its whole steps; both images are as long.
                let d =
                    unsafe { difference::<DIFFERENCE>(frame.as_ptr().add(at), baseline.as_ptr().add(at)) };
                let d_high = _mm256_srli_epi16::<8>(d);
                all[row] = _mm256_add_epi16(all[row], d);
                high[row] = _mm256_add_epi16(high[row], d_high);
                column_all = _mm256_add_epi16(column_all, d);
                column_high = _mm256_add_epi16(column_high, d_high);
                largest = _mm256_max_epu8(largest, d);
            }
            store_words(&mut columns.all, column_all);
            store_words(&mut columns.high, column_high);
        }
        for row in 0..ROWS {
            // A row's sums stay under 2^15 (128 steps), and a lane's weighed sum under 2^31: twelve bytes' at most.
            let low = _mm256_sub_epi16(all[row], _mm256_slli_epi16::<8>(high[row]));
            let low = _mm256_madd_epi16(low, weights[vector][0]);
            rows[row] = _mm256_add_epi32(rows[row], low);
            rows[row] = _mm256_add_epi32(rows[row], _mm256_madd_epi16(high[row], weights[vector][1]));
        }
        // SAFETY: the array is exactly 32 bytes, borrowed mutably.
        unsafe { _mm256_storeu_si256(most[vector].as_mut_ptr().cast(), largest) };
    }
    let mut bound = if steps == 0 { i32::MIN } else { bound_of(kernel, most.as_flattened()) };
    for (row, lanes) in rows.into_iter().enumerate() {
        let [low, high] = [_mm256_castsi256_si128(lanes), _mm256_extracti128_si256::<1>(lanes)];
        let wide = _mm256_add_epi64(_mm256_cvtepi32_epi64(low), _mm256_cvtepi32_epi64(high));
        let rest = row * bytes + steps * STEP..(row + 1) * bytes;
        let rest = kernel.row(&frame[rest.clone()], &baseline[rest], sums.rest);
        sums.rows.push(lanes_i64(wide).iter().sum::<i64>() + rest.sum);
        bound = bound.max(rest.max);
    }
    sums.bands.push(Band { y: sums.rows.len() - ROWS, rows: ROWS, bound });
}

/// What no grey value passes whose differences are those of a step, or less.
#[target_feature(enable = "avx2")]
#[inline]
fn bound_of(kernel: &Kernel, most: &[u8]) -> i32 {
    let weights = Halves::of(kernel.weights.map(|weight| weight.max(0)));
    let mut max = _mm256_setzero_si256();
    for pixels in most.as_chunks::<BYTES>().0 {
        max = _mm256_max_epi32(max, weighed(spread(load(pixels)), weights));
    }
    fold_lanes!(max, _mm_max_epi32)
}

/// Number of pixels whose sum by coarse weights is `border` or more; how many bytes of both images were counted is told too.
#[target_feature(enable = "avx2")]
pub(crate) fn count(
    difference: Difference,
    coarse: [i8; 3],
    frame: &[u8],
    baseline: &[u8],
    border: i16,
) -> (u32, usize) {
    if difference == Difference::Absolute {
        count_of::<ABSOLUTE>(coarse, frame, baseline, border)
    } else {
        count_of::<RECTIFIED>(coarse, frame, baseline, border)
    }
}

#[target_feature(enable = "avx2")]
fn count_of<const DIFFERENCE: u8>(
    coarse: [i8; 3],
    frame: &[u8],
    baseline: &[u8],
    border: i16,
) -> (u32, usize) {
    let [first, second] = by_place(coarse);
    let below = _mm256_set1_epi16(border - 1);
    // A step reads two bytes of the next one.
    let steps = (frame.len().min(baseline.len()).max(2) - 2) / STEP;
    let mut count = 0;
    let mut at = 0;
    while at < steps {
        let end = steps.min(at + MOST_STEPS);
        let mut lanes = _mm256_setzero_si256();
        for step in at..end {
            for vector in 0..3 {
                let at = step * STEP + vector * VECTOR;
                // SAFETY: the step ends two bytes or more before both images do.
                let (d, next) = unsafe {
                    let (frame, baseline) = (frame.as_ptr().add(at), baseline.as_ptr().add(at));
                    (
                        difference::<DIFFERENCE>(frame, baseline),
                        difference::<DIFFERENCE>(frame.add(2), baseline.add(2)),
                    )
                };
                let (d, next) =
                    (_mm256_maddubs_epi16(d, first[vector]), _mm256_maddubs_epi16(next, second[vector]));
                // What passes 16 bits stays at their end, which no border passes. A true comparison is −1.
                let sum = _mm256_adds_epi16(d, next);
                lanes = _mm256_sub_epi16(lanes, _mm256_cmpgt_epi16(sum, below));
            }
        }
        let pairs = _mm256_madd_epi16(lanes, _mm256_set1_epi16(1));
        count += lanes_i32(pairs).iter().sum::<i32>() as u32;
        at = end;
    }
    (count, steps * STEP)
}

/// Coarse weights as a step's bytes lie, and those of the bytes two further on.
///
/// Two pixels are three words: `b g`, `r b`, `g r`. The first pixel's sum is that of word 0 and of `r` in word 1, the second
/// one's that of `b` in word 1 and of word 2. So each sum stands in the word that its pixel begins in, and the third word has none.
#[target_feature(enable = "avx2")]
#[inline]
fn by_place([b, g, r]: [i8; 3]) -> [[__m256i; 3]; 2] {
    let of = |bytes: [i8; 6]| {
        [0, 1, 2].map(|vector| {
            let mut words = [[0_i8; 2]; WORDS];
            for (word, pair) in words.iter_mut().enumerate() {
                let place = 2 * ((WORDS * vector + word) % 3);
                *pair = [bytes[place], bytes[place + 1]];
            }
            load_words(&words)
        })
    };
    [of([b, g, 0, b, 0, 0]), of([r, 0, g, r, 0, 0])]
}
