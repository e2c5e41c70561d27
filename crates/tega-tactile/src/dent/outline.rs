//! The outline of a patch: rays from its middle, each cut at a share of its own maximum.
//!
//! A light reaches one flank better than another, so no single level fits the whole rim; the share of each ray's
//! maximum does. Rays leave evenly in the patch's own proportions, so that a strip is followed as well as a disc.

use super::Outline;
use super::basins::LOW;
use super::cells::Grid;
use super::patches::{FREE, Patch};

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
/// Times the rays are cast, each from the centroid of the outline before.
const CASTS: usize = 2;
/// Distance between samples on a ray, in cells.
const STEP: f32 = 1.0;
/// Samples of the longest ray: images are at most 4096 pixels a side, about 50 cells across.
const SAMPLES: usize = 80;
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
        index: usize,
        patch: &Patch,
        (length, owners): (&[f32], &[u8]),
        grid: &Grid,
        outline: Outline,
    ) -> Option<Polygon> {
        self.single_out(index, length, owners, grid);
        let (mut centre, frame) = patch.frame();
        let mut polygon = None;
        for _ in 0..CASTS {
            let mut rays = [Ray::default(); RAYS];
            for (i, ray) in rays.iter_mut().enumerate() {
                *ray = Ray::towards(i, frame);
                self.cast(ray, centre, patch, grid, outline.share());
            }
            let (found, middle) = enclose(&rays, centre)?;
            polygon = Some(found);
            centre = middle;
        }
        polygon
    }

    /// Copies the response of the cells that are of this patch or of none.
    #[inline(never)]
    fn single_out(&mut self, index: usize, length: &[f32], owners: &[u8], grid: &Grid) {
        let (cols, stride) = (grid.cols, grid.stride());
        self.field.resize(grid.padded_cells(), 0.0);
        let owners = owners.chunks_exact(stride).skip(1);
        let rows = self.field.chunks_exact_mut(stride).skip(1).zip(length.chunks_exact(cols)).zip(owners);
        for ((to, from), owners) in rows {
            for ((to, from), &owner) in to.iter_mut().skip(1).zip(from).zip(owners.iter().skip(1)) {
                *to = if owner == FREE || usize::from(owner) == index { *from } else { 0.0 };
            }
            to[0] = to[1];
            to[cols + 1] = to[cols];
        }
        self.field.copy_within(stride..2 * stride, 0);
        self.field.copy_within(grid.rows * stride..(grid.rows + 1) * stride, (grid.rows + 1) * stride);
    }

    /// Samples one ray and finds where it leaves the patch.
    fn cast(&mut self, ray: &mut Ray, centre: [f32; 2], patch: &Patch, grid: &Grid, share: f32) {
        let border = [-0.5, -0.5, grid.cols as f32 - 0.5, grid.rows as f32 - 0.5];
        let [left, top, right, bottom] = patch.reach.map(|v| v as f32);
        let bounds = [left - 1.0, top - 1.0, right + 1.0, bottom + 1.0];
        let to_border = distance(centre, ray.direction, border);
        let limit = to_border.min(distance(centre, ray.direction, bounds));
        let mut samples = [0f32; SAMPLES];
        let mut count = 0;
        let mut highest = 0f32;
        // Fixed point: a 65,536th of a cell; the field's first cell is one further on for its border.
        let fixed = |v: f32| (v * 65536.0) as i32;
        let (mut x, mut y) = (fixed(centre[0] + 1.0), fixed(centre[1] + 1.0));
        let (dx, dy) = (fixed(STEP * ray.direction[0]), fixed(STEP * ray.direction[1]));
        let wanted = (limit / STEP) as usize + 1;
        for sample in samples.iter_mut().take(wanted) {
            *sample = self.sample(x, y, grid);
            highest = highest.max(*sample);
            count += 1;
            x += dx;
            y += dy;
        }
        let samples = samples.get(..count).unwrap_or_default();
        ray.known = highest >= LOW;
        ray.level = (share * highest).max(LOW);
        let last = samples.iter().rposition(|&e| e >= ray.level).unwrap_or(0);
        let here = samples.get(last).copied().unwrap_or_default();
        let past_last = match samples.get(last + 1) {
            // Straight between the two samples around the crossing.
            Some(&next) if here > next => STEP * ((here - ray.level) / (here - next)).clamp(0.0, 1.0),
            Some(_) => 0.0,
            None => STEP,
        };
        ray.reach = (last as f32 * STEP + past_last).min(to_border);
    }

    /// The field between four cells.
    #[inline(always)]
    fn sample(&self, x: i32, y: i32, grid: &Grid) -> f32 {
        let (col, row) = ((x >> 16).max(0) as usize, (y >> 16).max(0) as usize);
        let part = |v: i32| (v & 0xffff) as f32 * (1.0 / 65536.0);
        let (fx, fy) = (part(x), part(y));
        let at = row * grid.stride() + col;
        let pair = |at: usize| match self.field.get(at..at + 2) {
            Some(&[a, b]) => a + (b - a) * fx,
            _ => 0.0,
        };
        let (above, below) = (pair(at), pair(at + grid.stride()));
        above + (below - above) * fy
    }
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
fn enclose(rays: &[Ray; RAYS], centre: [f32; 2]) -> Option<(Polygon, [f32; 2])> {
    let mut known = [0f32; RAYS];
    let (mut count, mut level) = (0, 0.0);
    for ray in rays.iter().filter(|ray| ray.known) {
        known[count] = ray.reach / ray.stretch;
        level += ray.level;
        count += 1;
    }
    if count == 0 {
        return None;
    }
    let overall = middle(&mut known[..count]);
    let steady: [f32; RAYS] = std::array::from_fn(|i| {
        let mut near = [0f32; 2 * NEIGHBOURS + 1];
        let mut n = 0;
        for shift in 0..near.len() {
            let ray = &rays[(i + RAYS + shift - NEIGHBOURS) % RAYS];
            if ray.known {
                near[n] = ray.reach / ray.stretch;
                n += 1;
            }
        }
        if n == 0 { overall } else { middle(&mut near[..n]) }
    });
    let points: [[f32; 2]; RAYS] = std::array::from_fn(|i| {
        let smooth = (steady[(i + RAYS - 1) % RAYS] + 2.0 * steady[i] + steady[(i + 1) % RAYS]) / 4.0;
        let reach = smooth * rays[i].stretch;
        [centre[0] + reach * rays[i].direction[0], centre[1] + reach * rays[i].direction[1]]
    });
    let (mut doubled, mut x, mut y) = (0f32, 0f32, 0f32);
    for (i, p) in points.iter().enumerate() {
        let q = points[(i + 1) % RAYS];
        let (px, py, qx, qy) = (p[0] - centre[0], p[1] - centre[1], q[0] - centre[0], q[1] - centre[1]);
        let cross = px * qy - qx * py;
        doubled += cross;
        x += (px + qx) * cross;
        y += (py + qy) * cross;
    }
    if doubled.abs() < 1e-6 {
        return None;
    }
    let centroid = [centre[0] + x / (3.0 * doubled), centre[1] + y / (3.0 * doubled)];
    Some((Polygon { points, level: level / count as f32 }, centroid))
}

/// Median; of an even number the mean of the two in the middle.
fn middle(values: &mut [f32]) -> f32 {
    values.sort_unstable_by(f32::total_cmp);
    let n = values.len();
    match (values.get(n.saturating_sub(1) / 2), values.get(n / 2)) {
        (Some(a), Some(b)) => (a + b) / 2.0,
        _ => 0.0,
    }
}
