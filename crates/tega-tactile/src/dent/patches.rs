//! Basins joined to patches of contact.
//!
//! A dent closes on itself: the gel's slopes over it cancel, and so do the colours they make. A basin whose whitened
//! colours do not cancel is a piece of one (under two lights' worth of shading a press falls into lobes), and is joined
//! with the piece that completes it. Two whole presses stay apart however near they are.

use super::basins::{Basins, LOW};
use super::cells::Grid;
use super::response::Response;

/// A peak below this is no contact.
pub(super) const PEAK: f32 = 8.0;
/// A peak below this share of the picture's highest is the drift or the gel's swell around a strong contact.
const PEAK_SHARE: f32 = 0.2;
/// Cells above this share of their basin's peak count for its shape and its balance of colours.
const SEED: f32 = 0.3;
/// A basin is a piece while the sum of its colours is longer than this share of the sum of their lengths.
const OPEN: f64 = 0.55;
/// Two pieces complete each other if their colours point apart by more than 120 degrees.
const OPPOSED: f64 = -0.5;
/// And if together they are better balanced by at least this much.
const BETTER: f64 = 0.1;
/// Distance in cells within which a speck or a piece is joined to a whole patch.
const NEAR: i32 = 2;
/// Basins of at most this many cells are specks.
const SPECK: f64 = 1.0;
/// Strongest basins looked at.
const MOST: usize = 32;

/// A basin, or several joined.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Patch {
    pub peak: f32,
    /// Sum of the response over the patch's seed cells.
    pub total: f64,
    colour: [f64; 3],
    count: f64,
    /// Sums of x, y, xx, xy, yy over the seed cells.
    moments: [f64; 5],
    /// Bounds of the seed cells: left, top, right, bottom.
    seed: [i32; 4],
    /// Bounds of all its cells.
    pub reach: [i32; 4],
}

/// Owner of a cell under `LOW`.
pub(super) const FREE: u8 = u8::MAX;
/// Owner of a cell whose basin is no contact.
const DROPPED: u8 = u8::MAX - 1;

const NOWHERE: [i32; 4] = [i32::MAX, i32::MAX, i32::MIN, i32::MIN];

impl Patch {
    fn new(peak: f32) -> Self {
        Self { peak, seed: NOWHERE, reach: NOWHERE, ..Self::default() }
    }

    fn openness(&self) -> f64 {
        length(self.colour) / self.total.max(f64::MIN_POSITIVE)
    }

    fn join(&mut self, other: &Self) {
        self.peak = self.peak.max(other.peak);
        self.total += other.total;
        self.count += other.count;
        self.colour.iter_mut().zip(other.colour).for_each(|(a, b)| *a += b);
        self.moments.iter_mut().zip(other.moments).for_each(|(a, b)| *a += b);
        self.seed = hull(self.seed, other.seed);
        self.reach = hull(self.reach, other.reach);
    }

    /// Free cells between the bounds of two patches.
    fn gap(&self, other: &Self) -> i32 {
        let [l, t, r, b] = self.seed;
        let [ol, ot, or, ob] = other.seed;
        (l - or).max(ol - r).max(t - ob).max(ot - b).max(0)
    }

    fn at_border(&self, grid: &Grid) -> bool {
        let [l, t, r, b] = self.seed;
        l == 0 || t == 0 || r == grid.cols as i32 - 1 || b == grid.rows as i32 - 1
    }

    /// Mean of the seed cells, and the symmetric root of their covariance scaled to determinant one: it maps a circle
    /// to an ellipse as long and as wide as the patch, with at most eight times its width.
    pub fn frame(&self) -> ([f32; 2], [f32; 3]) {
        let [x, y, xx, xy, yy] = self.moments.map(|m| m / self.count.max(1.0));
        // A cell is not a point: its own variance is 1/12.
        let (mut a, b, mut c) = (xx - x * x + 1.0 / 12.0, xy - x * y, yy - y * y + 1.0 / 12.0);
        let floor = (a + c) / 64.0;
        a += floor;
        c += floor;
        let root = (a * c - b * b).max(f64::MIN_POSITIVE).sqrt();
        // sqrt(M) = (M + sqrt(det M)) / sqrt(trace M + 2 sqrt(det M)); its determinant is sqrt(det M).
        let scale = 1.0 / ((a + c + 2.0 * root).sqrt() * root.sqrt());
        ([x as f32, y as f32], [((a + root) * scale) as f32, (b * scale) as f32, ((c + root) * scale) as f32])
    }
}

fn length(v: [f64; 3]) -> f64 {
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}

fn hull(a: [i32; 4], b: [i32; 4]) -> [i32; 4] {
    [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])]
}

/// Patches of one frame.
#[derive(Debug, Default)]
pub(super) struct Patches {
    pub all: Vec<Patch>,
    /// Patch of every peak's basin, an index into `all`, or [`DROPPED`] where it is no contact.
    of_peak: Vec<u8>,
    owners: Vec<u8>,
    /// Peak under which a patch is dropped.
    floor: f32,
}

impl Patches {
    /// Joins the basins to patches and drops the weak ones.
    pub fn join(&mut self, basins: &Basins, response: &Response, grid: &Grid) {
        self.open(basins);
        self.sum(basins, response, grid);
        while let Some((from, into)) = self.best_pair(grid) {
            let piece = self.all.swap_remove(from);
            let moved = self.all.len();
            let into = if into == moved { from } else { into };
            for patch in &mut self.of_peak {
                *patch = match usize::from(*patch) {
                    of if of == from => into as u8,
                    of if of == moved => from as u8,
                    _ => *patch,
                };
            }
            if let Some(whole) = self.all.get_mut(into) {
                whole.join(&piece);
            }
        }
        let highest = self.all.iter().fold(0f32, |a, p| a.max(p.peak));
        self.floor = PEAK_SHARE * highest;
        self.owners.clear();
        self.owners.resize(grid.padded_cells(), FREE);
        for &cell in &basins.cells {
            let patch = basins.peak_of(cell, grid).and_then(|peak| self.of_peak.get(peak));
            if let (Some(owner), Some(patch)) = (self.owners.get_mut(grid.padded_index(cell)), patch) {
                *owner = *patch;
            }
        }
    }

    /// Patch of every cell, with a border of one cell around the grid: an index, [`FREE`] or [`DROPPED`].
    pub fn owners(&self) -> &[u8] {
        &self.owners
    }

    /// The patches that are contact, with their index.
    pub fn contacts(&self) -> impl Iterator<Item = (u8, &Patch)> {
        (0..).zip(&self.all).filter(|(_, patch)| patch.peak >= self.floor)
    }

    /// One patch for each basin whose peak is contact, the strongest only where there are many.
    fn open(&mut self, basins: &Basins) {
        self.all.clear();
        self.of_peak.clear();
        for (i, peak) in basins.peaks.iter().enumerate() {
            // Peaks come in falling order, to a quarter of a unit.
            let leads = basins.leads(i) && peak.height >= PEAK && self.all.len() < MOST;
            self.of_peak.push(if leads { self.all.len() as u8 } else { DROPPED });
            if leads {
                self.all.push(Patch::new(peak.height));
            }
        }
        for i in 0..self.of_peak.len() {
            self.of_peak[i] = self.of_peak[basins.lead_of(i)];
        }
    }

    fn sum(&mut self, basins: &Basins, response: &Response, grid: &Grid) {
        let [w0, w1, w2] = &response.white;
        for &cell in &basins.cells {
            let patch = basins.peak_of(cell, grid).and_then(|peak| self.of_peak.get(peak));
            let Some(patch) = patch.and_then(|&p| self.all.get_mut(usize::from(p))) else { continue };
            let (x, y) = (i32::from(cell.x), i32::from(cell.y));
            let cell = grid.index(cell);
            patch.reach = hull(patch.reach, [x, y, x, y]);
            let e = response.length.get(cell).copied().unwrap_or_default();
            if e < LOW.max(SEED * patch.peak) {
                continue;
            }
            patch.seed = hull(patch.seed, [x, y, x, y]);
            patch.total += f64::from(e);
            patch.count += 1.0;
            for (sum, white) in patch.colour.iter_mut().zip([w0, w1, w2]) {
                *sum += white.get(cell).copied().map_or(0.0, f64::from);
            }
            let (x, y) = (f64::from(x), f64::from(y));
            for (sum, term) in patch.moments.iter_mut().zip([x, y, x * x, x * y, y * y]) {
                *sum += term;
            }
        }
    }

    /// The next two to join, as (from, into): specks first, then pieces that complete each other, nearest first.
    fn best_pair(&self, grid: &Grid) -> Option<(usize, usize)> {
        let mut best: Option<(Merit, (usize, usize))> = None;
        for (i, a) in self.all.iter().enumerate() {
            for (j, b) in self.all.iter().enumerate().filter(|(j, _)| *j != i) {
                let Some(merit) = merit(a, b, grid) else { continue };
                if best.is_none_or(|(found, _)| merit > found) {
                    best = Some((merit, (i, j)));
                }
            }
        }
        best.map(|(_, pair)| pair)
    }
}

/// How much two patches belong together: the kind of reason, how near they are, how well they complete each other.
type Merit = (u8, i32, f64);

/// Why `a` should be joined to `b`, comparable; `None` if it should not.
fn merit(a: &Patch, b: &Patch, grid: &Grid) -> Option<Merit> {
    let gap = a.gap(b);
    if a.count <= SPECK && gap <= NEAR {
        return Some((2, -gap, f64::from(b.peak)));
    }
    let (open_a, open_b) = (a.openness(), b.openness());
    if open_a <= OPEN {
        return None;
    }
    let sum = [a.colour[0] + b.colour[0], a.colour[1] + b.colour[1], a.colour[2] + b.colour[2]];
    let open = length(sum) / (a.total + b.total).max(f64::MIN_POSITIVE);
    let dot: f64 = a.colour.iter().zip(b.colour).map(|(a, b)| a * b).sum();
    let opposed = dot < OPPOSED * length(a.colour) * length(b.colour);
    if open_b > OPEN && opposed && open < open_a.min(open_b) - BETTER {
        return Some((1, -gap, -open));
    }
    (gap <= NEAR && open < OPEN && !a.at_border(grid)).then_some((0, -gap, -open))
}
