//! Find the largest of many values in a way that one of them alone does not decide.

use super::colour::{LANES, total};

/// Σ v⁸ / Σ v⁷ of values of 0 or more: their largest, steadied by those that come near it.
#[inline(always)]
pub(super) fn peak(values: &[f32]) -> f32 {
    let most = largest(values).into_iter().fold(0f32, f32::max);
    if most <= f32::MIN_POSITIVE || !most.is_finite() {
        return 0.0;
    }
    let [seven, eight] = power_sums(values, 1.0 / most).map(|lanes| total(&lanes));
    most * eight / seven
}

/// Largest values, side by side.
#[inline(always)]
fn largest(values: &[f32]) -> [f32; LANES] {
    let mut most = [0f32; LANES];
    let (chunks, rest) = values.as_chunks::<LANES>();
    for chunk in chunks {
        for lane in 0..LANES {
            most[lane] = if chunk[lane] > most[lane] { chunk[lane] } else { most[lane] };
        }
    }
    for (most, value) in most.iter_mut().zip(rest) {
        *most = if *value > *most { *value } else { *most };
    }
    most
}

/// Sums of the seventh and the eighth powers of scaled values.
#[inline(always)]
fn power_sums(values: &[f32], scale: f32) -> [[f32; LANES]; 2] {
    let mut sums = [[0f32; LANES]; 2];
    let (chunks, rest) = values.as_chunks::<LANES>();
    let mut last = [0f32; LANES];
    last.iter_mut().zip(rest).for_each(|(l, r)| *l = *r);
    for chunk in chunks.iter().chain(std::iter::once(&last)) {
        for lane in 0..LANES {
            let v = chunk[lane] * scale;
            let (two, four) = (v * v, (v * v) * (v * v));
            sums[0][lane] += four * two * v;
            sums[1][lane] += four * four;
        }
    }
    sums
}

/// A half over a peak; nothing over none.
#[inline(always)]
pub(super) fn half_share(peak: f32) -> f32 {
    if peak > 0.0 { 0.5 / peak } else { 0.0 }
}
