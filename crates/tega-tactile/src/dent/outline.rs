//! The outline of a patch: rays from its middle, each cut at a share of its own maximum.
//!
//! A light reaches one flank better than another, so no single level fits the whole rim; the share of each ray's
//! maximum does. Rays leave evenly in the patch's own proportions, so that a strip is followed as well as a disc.

use super::Outline;
use super::basins::LOW;
use super::cells::Grid;
use super::patches::{FREE, Patch};
use super::samples::{BUNDLE, SAMPLES, Samples, Walk, fixed};
use crate::simd;

/// Rays of one patch; a multiple of four.
pub(super) const RAYS: usize = 48;
/// Cosines of 0, 7.5, ... 90 degrees: constants, because a library's differ from machine to machine in the last bit.
const COSINES: [f32; RAYS / 4 + 1] = [
    1.0,
    0.991_444_9,
    0.965_925_8,
    0.923_879_5,
    0.866_025_4,
    0.793_353_3,
    std::f32::consts::FRAC_1_SQRT_2,
    0.608_761_4,
    0.5,
    0.382_683_43,
    0.258_819_05,
    0.130_526_19,
    0.0,
];
/// Distance between samples on a ray, in cells.
const STEP: f32 = 1.0;
/// Neighbours on either side in the median that steadies the outline.
const NEIGHBOURS: usize = 3;

/// One patch's outline, in cells: (0, 0) is the middle of the first cell.
#[derive(Debug, Clone, Copy)]
pub(super) struct Polygon {
    pub points: [[f32; 2]; RAYS],
    /// Mean of the levels that cut the rays.
    pub level: f32,
}

/// Buffers of the rays.
#[derive(Debug, Default)]
pub(super) struct Rays {
    /// The response of one patch alone, with its border cells repeated once around the grid.
    field: Vec<f32>,
    samples: Samples,
}

#[derive(Debug, Clone, Copy, Default)]
struct Ray {
    /// Unit direction, and the stretch of the patch's frame along it.
    direction: [f32; 2],
    stretch: f32,
    reach: f32,
    level: f32,
    known: bool,
}

impl Rays {
    /// The outline of patch `index`; `None` if it encloses nothing.
    #[inline(never)]
    pub fn outline(
        &mut self,
        index: u8,
        patch: &Patch,
        (length, owners): (&[f32], &[u8]),
        grid: &Grid,
        outline: Outline,
    ) -> Option<Polygon> {
        self.single_out(index, length, owners, grid);
        let (seed, frame) = patch.frame();
        // Few rays from the middle of the seed cells, which leans to the brighter flank, find the middle of the outline.
        let few: [Ray; RAYS / 2] = self.cast_all(seed, frame, patch, grid, outline.share());
        let (_, centre) = enclose(&few, seed)?;
        let rays: [Ray; RAYS] = self.cast_all(centre, frame, patch, grid, outline.share());
        let (points, _) = enclose(&rays, centre)?;
        let levels = rays.iter().filter(|ray| ray.known).map(|ray| ray.level);
        let known = rays.iter().filter(|ray| ray.known).count();
        Some(Polygon { points, level: levels.sum::<f32>() / known as f32 })
    }

    fn cast_all<const N: usize>(
        &mut self,
        centre: [f32; 2],
        frame: [f32; 3],
        patch: &Patch,
        grid: &Grid,
        share: f32,
    ) -> [Ray; N] {
        let mut rays: [Ray; N] = std::array::from_fn(|i| Ray::towards(i * (RAYS / N), frame));
        for bundle in rays.as_chunks_mut::<BUNDLE>().0 {
            self.cast(bundle, centre, patch, grid, share);
        }
        rays
    }

    /// Copies the response of the cells that are of this patch or of none.
    #[inline(never)]
    fn single_out(&mut self, index: u8, length: &[f32], owners: &[u8], grid: &Grid) {
        let (cols, stride) = (grid.cols, grid.stride());
        self.field.resize(grid.padded_cells(), 0.0);
        let owners = owners.chunks_exact(stride).skip(1);
        let rows = self.field.chunks_exact_mut(stride).skip(1).zip(length.chunks_exact(cols)).zip(owners);
        for ((to, from), owners) in rows {
            let (cells, owners) = (to.get_mut(1..=cols), owners.get(1..=cols));
            simd::own(index, from, owners.unwrap_or_default(), cells.unwrap_or_default());
            to[0] = to[1];
            to[cols + 1] = to[cols];
        }
        self.field.copy_within(stride..2 * stride, 0);
        self.field.copy_within(grid.rows * stride..(grid.rows + 1) * stride, (grid.rows + 1) * stride);
    }

    /// Samples a bundle of rays and finds where each leaves the patch.
    fn cast(&mut self, rays: &mut [Ray; BUNDLE], centre: [f32; 2], patch: &Patch, grid: &Grid, share: f32) {
        let border = [-0.5, -0.5, grid.cols as f32 - 0.5, grid.rows as f32 - 0.5];
        let [left, top, right, bottom] = patch.reach.map(|v| v as f32);
        let bounds = [left - 1.0, top - 1.0, right + 1.0, bottom + 1.0];
        let to_border = rays.each_ref().map(|ray| distance(centre, ray.direction, border));
        let start = [fixed(centre[0] + 1.0), fixed(centre[1] + 1.0), 0].map(|v| [v; BUNDLE]);
        let mut walk = Walk { start, step: [[-1; BUNDLE]; 3] };
        for (i, ray) in rays.iter().enumerate() {
            let limit = to_border[i].min(distance(centre, ray.direction, bounds));
            walk.step[0][i] = fixed(STEP * ray.direction[0]);
            walk.step[1][i] = fixed(STEP * ray.direction[1]);
            walk.start[2][i] = ((limit / STEP) as i32 + 1).min(SAMPLES as i32);
        }
        let counts = walk.start[2];
        let samples = self.samples.take(&walk, &self.field, grid.stride());
        let Crossing { highest, level, last } = simd::crossing(samples, share);
        for (i, ray) in rays.iter_mut().enumerate() {
            let at = |k: i32| samples.get(k as usize).map_or(0.0, |sample| sample[i]);
            let last = last[i];
            ray.known = highest[i] >= LOW;
            ray.level = level[i];
            let (here, next) = (at(last), at(last + 1));
            let past_last = if last + 1 == counts[i] {
                STEP
            } else if here > next {
                // Straight between the two samples around the crossing.
                STEP * ((here - ray.level) / (here - next)).clamp(0.0, 1.0)
            } else {
                0.0
            };
            ray.reach = (last as f32 * STEP + past_last).min(to_border[i]);
        }
    }
}

/// Where the rays of a bundle leave their patch.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Crossing {
    highest: [f32; BUNDLE],
    level: [f32; BUNDLE],
    /// Last sample that reaches the level, 0 if none does.
    last: [i32; BUNDLE],
}

/// Cuts each ray of a bundle at a share of its highest sample.
#[inline(always)]
pub(crate) fn crossing(samples: &[[f32; BUNDLE]], share: f32) -> Crossing {
    let (mut highest, mut last) = ([0f32; BUNDLE], [0; BUNDLE]);
    for sample in samples {
        for i in 0..BUNDLE {
            highest[i] = if sample[i] > highest[i] { sample[i] } else { highest[i] };
        }
    }
    let level = highest.map(|highest| if share * highest > LOW { share * highest } else { LOW });
    for (k, sample) in (0..).zip(samples) {
        for i in 0..BUNDLE {
            last[i] = if sample[i] >= level[i] { k } else { last[i] };
        }
    }
    Crossing { highest, level, last }
}

impl Ray {
    fn towards(i: usize, [a, b, c]: [f32; 3]) -> Self {
        let quarter = RAYS / 4;
        let (turn, part) = (i / quarter, i % quarter);
        let (near, far) = (COSINES[part], COSINES[quarter - part]);
        let [x, y] = match turn {
            0 => [near, far],
            1 => [-far, near],
            2 => [-near, -far],
            _ => [far, -near],
        };
        let (x, y) = (a * x + b * y, b * x + c * y);
        let stretch = (x * x + y * y).sqrt();
        Self { direction: [x / stretch, y / stretch], stretch, ..Self::default() }
    }
}

/// Distance from `from` along `direction` to the edge of a box; 0 from outside it.
fn distance(from: [f32; 2], direction: [f32; 2], [left, top, right, bottom]: [f32; 4]) -> f32 {
    let one = |at: f32, d: f32, low: f32, high: f32| {
        if d > 1e-6 {
            (high - at) / d
        } else if d < -1e-6 {
            (low - at) / d
        } else {
            f32::MAX
        }
    };
    one(from[0], direction[0], left, right).min(one(from[1], direction[1], top, bottom)).max(0.0)
}

/// Steadies the rays' reach (median of the known neighbours, then 1-2-1) and closes them to a polygon with its centroid.
fn enclose<const N: usize>(rays: &[Ray; N], centre: [f32; 2]) -> Option<([[f32; 2]; N], [f32; 2])> {
    let mut steady = rays.each_ref().map(|ray| ray.reach / ray.stretch);
    if rays.iter().all(|ray| ray.known) {
        // Seen from one ray, its neighbours go round the end.
        let mut round = [0f32; RAYS + 2 * NEIGHBOURS];
        for (to, i) in round.iter_mut().zip(N - NEIGHBOURS..2 * N + NEIGHBOURS) {
            *to = steady[i % N];
        }
        simd::medians_of_seven(&round, &mut steady);
    } else {
        steady = std::array::from_fn(|i| {
            let near = (N - NEIGHBOURS..=N + NEIGHBOURS).map(|shift| &rays[(i + shift) % N]);
            median_of_known(near).or_else(|| median_of_known(rays.iter())).unwrap_or_default()
        });
    }
    let points: [[f32; 2]; N] = std::array::from_fn(|i| {
        let smooth = (steady[(i + N - 1) % N] + 2.0 * steady[i] + steady[(i + 1) % N]) / 4.0;
        let reach = smooth * rays[i].stretch;
        [centre[0] + reach * rays[i].direction[0], centre[1] + reach * rays[i].direction[1]]
    });
    let (mut doubled, mut x, mut y) = (0f32, 0f32, 0f32);
    for (i, p) in points.iter().enumerate() {
        let q = points[(i + 1) % N];
        let (px, py, qx, qy) = (p[0] - centre[0], p[1] - centre[1], q[0] - centre[0], q[1] - centre[1]);
        let cross = px * qy - qx * py;
        doubled += cross;
        x += (px + qx) * cross;
        y += (py + qy) * cross;
    }
    if doubled.abs() < 1e-6 {
        return None;
    }
    Some((points, [centre[0] + x / (3.0 * doubled), centre[1] + y / (3.0 * doubled)]))
}

/// Median reach of the rays that met the patch, in the patch's proportions; of an even number the lower.
fn median_of_known<'r>(rays: impl Iterator<Item = &'r Ray>) -> Option<f32> {
    let mut values = [0f32; RAYS];
    let mut n = 0;
    for (value, ray) in values.iter_mut().zip(rays.filter(|ray| ray.known)) {
        *value = ray.reach / ray.stretch;
        n += 1;
    }
    let known = values.get_mut(..n)?;
    known.sort_unstable_by(f32::total_cmp);
    known.get(n.saturating_sub(1) / 2).copied()
}

/// Median of every seven neighbours: a network of comparisons that leaves it in the middle.
#[inline(always)]
pub(crate) fn medians_of_seven(values: &[f32], medians: &mut [f32]) {
    const NETWORK: [(usize, usize); 13] = [
        (0, 5),
        (0, 3),
        (1, 6),
        (2, 4),
        (0, 1),
        (3, 5),
        (2, 6),
        (2, 3),
        (3, 6),
        (4, 5),
        (1, 4),
        (1, 3),
        (3, 4),
    ];
    for (median, seven) in medians.iter_mut().zip(values.windows(7)) {
        let Some(&(mut v)) = seven.first_chunk::<7>() else { return };
        for (i, j) in NETWORK {
            (v[i], v[j]) = if v[j] < v[i] { (v[j], v[i]) } else { (v[i], v[j]) };
        }
        *median = v[3];
    }
}

/// The response of the cells that patch `index` or none owns, 0 for the others.
#[inline(always)]
pub(crate) fn own(index: u8, response: &[f32], owners: &[u8], out: &mut [f32]) {
    for ((out, &e), &owner) in out.iter_mut().zip(response).zip(owners) {
        *out = if owner == FREE || owner == index { e } else { 0.0 };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_network_leaves_the_median_in_the_middle() {
        // A comparison network that is right for all zeros and ones is right for all numbers.
        for bits in 0u32..128 {
            let values: [f32; 7] = std::array::from_fn(|i| f32::from(u8::from(bits >> i & 1 == 1)));
            let wanted = f32::from(u8::from(bits.count_ones() >= 4));
            let mut median = [f32::NAN];
            medians_of_seven(&values, &mut median);
            assert_eq!(median, [wanted], "{values:?}");
        }
    }

    #[test]
    fn rays_go_round_once() {
        for i in 0..RAYS {
            let ray = Ray::towards(i, [1.0, 0.0, 1.0]);
            let angle = std::f64::consts::TAU * i as f64 / RAYS as f64;
            assert!((f64::from(ray.direction[0]) - angle.cos()).abs() < 1e-6);
            assert!((f64::from(ray.direction[1]) - angle.sin()).abs() < 1e-6);
        }
    }
}
