//! Take a change of the whole picture's colour out, and say how much of the picture differs from the untouched gel.
//!
//! Light that drifts changes all of the picture: a plane per colour and a gain against the untouched gel explain it. What they leave, pooled
//! over two by two cells, is summed up in one number S: √(Σ e² / Σ e), e the energy of a pooled cell in noise units. S hardly varies while
//! nothing touches, and counts broad contacts by all the picture that they change. One cell that outweighs all others is left out.

use super::cells::Grid;
use super::rank::{Keys, middles};

/// Values that are summed side by side, in one order on every processor.
pub(crate) const LANES: usize = 8;
/// Rounds of the robust fit.
const ROUNDS: usize = 3;
/// The untouched gel's counts are divided by this for the fit of the gain.
const GAIN_COUNTS: f32 = 64.0;
/// Added to the gain's normal equation, so that an even gel says nothing about gain: a variance of one count.
const GAIN_HOLD: f64 = 1.0 / (64.0 * 64.0);
/// Sums of a fit that its colours share: of weights with 1, x, y, x², xy, y².
const SHARED: usize = 6;
/// Those of one colour: of weights with b, bx, by, b², and of the value with 1, x, y, b.
const OWN: usize = 8;

/// The share of Σ e² over which one cell outweighs all others.
const LONE_SHARE: f32 = 0.8;

/// Three planes of one value a cell.
pub(crate) type Field = [Vec<f32>; 3];

/// Pooled cells and buffers of the fit.
#[derive(Debug, Clone, Default)]
pub(super) struct Colour {
    rows: usize,
    cols: usize,
    /// Places of the pooled cells, -1 to 1, and 0 past their end.
    x: Vec<f32>,
    y: Vec<f32>,
    /// Sums of their squares.
    squares: [f32; 2],
    /// Places of the cells among the pooled ones, along rows and along columns.
    among: [Vec<f32>; 2],
    pooled: Field,
    gel: Field,
    left: Field,
    weights: Vec<f32>,
    keys: [Keys; 3],
}

impl Colour {
    pub fn of(grid: &Grid) -> Self {
        let (rows, cols) = (grid.rows / 2, grid.cols / 2);
        let n = (rows * cols).next_multiple_of(LANES);
        let place = |k: usize, of: usize| (2 * k + 1) as f32 / of as f32 - 1.0;
        let (mut x, mut y, mut weights) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        for i in 0..rows * cols {
            (x[i], y[i], weights[i]) = (place(i % cols, cols), place(i / cols, rows), 1.0);
        }
        let plane = || vec![0.0; n];
        let field = || [plane(), plane(), plane()];
        let squares = [&x, &y].map(|v| v.iter().map(|v| v * v).sum());
        Self {
            rows,
            cols,
            squares,
            among: [
                (0..grid.cells()).map(|cell| place_among(cell % grid.cols, cols)).collect(),
                (0..grid.cells()).map(|cell| place_among(cell / grid.cols, rows)).collect(),
            ],
            x,
            y,
            weights,
            pooled: field(),
            gel: field(),
            left: field(),
            keys: [0; 3].map(|_| Keys::of(rows * cols)),
        }
    }

    fn cells(&self) -> usize {
        self.rows * self.cols
    }

    /// Whether there are cells enough to tell a contact from light.
    pub fn tells(&self) -> bool {
        self.rows >= 4 && self.cols >= 4
    }

    /// Pooled cells of a plane, and zeros past their end.
    pub fn pooled(&self, plane: &[f32], grid: &Grid, out: &mut Vec<f32>) {
        out.clear();
        out.resize(self.x.len(), 0.0);
        pool(plane, grid, self.cols, out);
    }

    /// What the last fit left of the pooled change.
    pub fn left(&self) -> &Field {
        &self.left
    }

    /// S of a change as it is, without a fit; [`Self::judge`] may follow.
    #[inline(always)]
    pub fn plain(&mut self, white: &Field, grid: &Grid) -> f32 {
        for ((white, pooled), left) in white.iter().zip(&mut self.pooled).zip(&mut self.left) {
            pool(white, grid, self.cols, pooled);
            left.clone_from(pooled);
        }
        self.statistic()
    }

    /// S after a plane by plain least squares; what a gel at rest needs no more than.
    #[inline(always)]
    pub fn glance(&mut self, white: &Field, grid: &Grid) -> f32 {
        let (n, cells) = (self.cells() as f32, self.cells());
        let [xx, yy] = self.squares;
        for (c, white) in white.iter().enumerate() {
            pool(white, grid, self.cols, &mut self.pooled[c]);
            let [z, zx, zy] = plane_sums(&self.pooled[c], &self.x, &self.y).map(|lanes| total(&lanes));
            let plane = [z / n, zx / xx, zy / yy];
            without_plane(&self.pooled[c], &self.x, &self.y, plane, &mut self.left[c]);
            self.left[c].iter_mut().skip(cells).for_each(|v| *v = 0.0);
        }
        self.statistic()
    }

    /// S after a plane and a gain by a fit that contacts do not pull; takes both out of `white` too. `gel` is the untouched gel, counts.
    /// Call [`Self::glance`] before.
    #[inline(always)]
    pub fn judge(&mut self, white: &mut Field, gel: &Field, grid: &Grid) -> f32 {
        let cells = self.cells();
        for (gel, pooled) in gel.iter().zip(&mut self.gel) {
            pool(gel, grid, self.cols, pooled);
        }
        let means = sums(&self.gel, cells).map(|sum| sum / cells as f32);
        for (keys, pooled) in self.keys.iter_mut().zip(&self.pooled) {
            keys.take(pooled);
        }
        let middles = middles(&mut self.keys);
        for (c, mean) in means.iter().enumerate() {
            self.gel[c].iter_mut().take(cells).for_each(|b| *b = (*b - mean) / GAIN_COUNTS);
            without_plane(&self.pooled[c], &self.x, &self.y, [middles[c], 0.0, 0.0], &mut self.left[c]);
        }
        let mut fits = [[0f32; 4]; 3];
        for _ in 0..ROUNDS {
            let [a, b, c] = &self.left;
            trust([a, b, c], &mut self.weights);
            self.weights.iter_mut().skip(cells).for_each(|w| *w = 0.0);
            let shared = shared_sums(&self.weights, [&self.x, &self.y]);
            for (c, fit) in fits.iter_mut().enumerate() {
                let places = [&self.x[..], &self.y, &self.gel[c]];
                *fit = solve(&shared, &own_sums(&self.weights, places, &self.pooled[c]));
                without_fit(&self.pooled[c], places, *fit, &mut self.left[c]);
                self.left[c].iter_mut().skip(cells).for_each(|v| *v = 0.0);
            }
        }
        for (c, fit) in fits.into_iter().enumerate() {
            let [level, x, y, gain] = fit;
            let gain = gain / GAIN_COUNTS;
            let (shift, [across, down]) = (gain * means[c], &self.among);
            for (((white, gel), across), down) in white[c].iter_mut().zip(&gel[c]).zip(across).zip(down) {
                *white -= (level + y * down - shift) + x * across + gain * gel;
            }
        }
        self.statistic()
    }

    #[inline(always)]
    fn statistic(&self) -> f32 {
        statistic(&self.left)
    }
}

/// S of pooled cells.
#[inline(always)]
pub(super) fn statistic([a, b, c]: &Field) -> f32 {
    let [energy, square, most] = energy_sums([a, b, c]);
    let most = most.into_iter().fold(0f32, f32::max);
    let (mut energy, mut square) = (total(&energy), total(&square));
    // A pixel that is stuck lies in one cell; no contact does.
    if most * most > LONE_SHARE * square {
        (energy, square) = (energy - most, square - most * most);
    }
    if energy > f32::MIN_POSITIVE { (square / energy).sqrt() } else { 0.0 }
}

/// A cell's place among the pooled ones.
fn place_among(k: usize, pooled: usize) -> f32 {
    (k as f32 + 0.5) / pooled as f32 - 1.0
}

/// Sums of the first values of three planes, each one after the other: side by side, so that none waits for another.
#[inline(always)]
fn sums([a, b, c]: &Field, n: usize) -> [f32; 3] {
    a.iter().zip(b).zip(c).take(n).fold([-0.0; 3], |[x, y, z], ((a, b), c)| [x + a, y + b, z + c])
}

/// Means of two by two cells; a last odd row or column is left out.
#[inline(always)]
fn pool(plane: &[f32], grid: &Grid, cols: usize, out: &mut [f32]) {
    let rows = plane.chunks_exact(grid.cols);
    let pairs = rows.clone().step_by(2).zip(rows.skip(1).step_by(2));
    for ((upper, lower), out) in pairs.zip(out.chunks_exact_mut(cols.max(1))) {
        let quads = upper.as_chunks::<2>().0.iter().zip(lower.as_chunks::<2>().0);
        for (([a, b], [c, d]), out) in quads.zip(out) {
            *out = 0.25 * ((a + b) + (c + d));
        }
    }
}

/// Sum of the lanes. A call: inlined, it has the compiler turn the lanes within the loop before it.
#[inline(never)]
pub(super) fn total(lanes: &[f32; LANES]) -> f32 {
    lanes.iter().sum()
}

/// Sums of a value with 1, x and y.
#[inline(always)]
fn plane_sums(z: &[f32], x: &[f32], y: &[f32]) -> [[f32; LANES]; 3] {
    let mut sums = [[0f32; LANES]; 3];
    let places = x.as_chunks::<LANES>().0.iter().zip(y.as_chunks::<LANES>().0);
    for (z, (x, y)) in z.as_chunks::<LANES>().0.iter().zip(places) {
        for lane in 0..LANES {
            sums[0][lane] += z[lane];
            sums[1][lane] += z[lane] * x[lane];
            sums[2][lane] += z[lane] * y[lane];
        }
    }
    sums
}

/// Takes a plane out.
#[inline(always)]
fn without_plane(z: &[f32], x: &[f32], y: &[f32], [level, px, py]: [f32; 3], out: &mut [f32]) {
    for (((out, z), x), y) in out.iter_mut().zip(z).zip(x).zip(y) {
        *out = z - (level + px * x + py * y);
    }
}

/// Takes a plane and a gain out.
#[inline(always)]
fn without_fit(z: &[f32], [x, y, b]: [&[f32]; 3], [level, px, py, pb]: [f32; 4], out: &mut [f32]) {
    for ((((out, z), x), y), b) in out.iter_mut().zip(z).zip(x).zip(y).zip(b) {
        *out = z - (level + px * x + py * y + pb * b);
    }
}

/// How much each pooled cell is trusted to be untouched: 1 / (1 + energy)².
#[inline(always)]
fn trust([a, b, c]: [&[f32]; 3], weights: &mut [f32]) {
    for (((w, a), b), c) in weights.iter_mut().zip(a).zip(b).zip(c) {
        let distrust = 1.0 + ((a * a + c * c) + b * b) * (1.0 / 3.0);
        *w = 1.0 / (distrust * distrust);
    }
}

/// The weighted sums of places; see [`SHARED`].
#[inline(always)]
fn shared_sums(weights: &[f32], [x, y]: [&[f32]; 2]) -> [[f32; LANES]; SHARED] {
    let mut sums = [[0f32; LANES]; SHARED];
    let places = x.as_chunks::<LANES>().0.iter().zip(y.as_chunks::<LANES>().0);
    for (w, (x, y)) in weights.as_chunks::<LANES>().0.iter().zip(places) {
        for l in 0..LANES {
            let (wx, wy) = (w[l] * x[l], w[l] * y[l]);
            let terms = [w[l], wx, wy, wx * x[l], wx * y[l], wy * y[l]];
            for k in 0..SHARED {
                sums[k][l] += terms[k];
            }
        }
    }
    sums
}

/// The weighted sums of a colour's gel and values; see [`OWN`].
#[inline(always)]
fn own_sums(weights: &[f32], [x, y, b]: [&[f32]; 3], z: &[f32]) -> [[f32; LANES]; OWN] {
    let mut sums = [[0f32; LANES]; OWN];
    let chunks = weights.as_chunks::<LANES>().0.iter().zip(z.as_chunks::<LANES>().0);
    let places = x.as_chunks::<LANES>().0.iter().zip(y.as_chunks::<LANES>().0).zip(b.as_chunks::<LANES>().0);
    for ((w, z), ((x, y), b)) in chunks.zip(places) {
        for l in 0..LANES {
            let (wb, wz) = (w[l] * b[l], w[l] * z[l]);
            let terms = [wb, wb * x[l], wb * y[l], wb * b[l], wz, wz * x[l], wz * y[l], wz * b[l]];
            for k in 0..OWN {
                sums[k][l] += terms[k];
            }
        }
    }
    sums
}

/// Sums of energy and of its square over pooled cells, and the largest energies.
#[inline(always)]
fn energy_sums([a, b, c]: [&[f32]; 3]) -> [[f32; LANES]; 3] {
    let mut sums = [[0f32; LANES]; 3];
    let chunks = a.as_chunks::<LANES>().0.iter().zip(b.as_chunks::<LANES>().0).zip(c.as_chunks::<LANES>().0);
    for ((a, b), c) in chunks {
        for lane in 0..LANES {
            let e = ((a[lane] * a[lane] + c[lane] * c[lane]) + b[lane] * b[lane]) * (1.0 / 3.0);
            sums[0][lane] += e;
            sums[1][lane] += e * e;
            sums[2][lane] = if e > sums[2][lane] { e } else { sums[2][lane] };
        }
    }
    sums
}

/// Solves the normal equations of these sums; zeros where they have no answer. A call, as [`total`] is.
#[inline(never)]
fn solve(shared: &[[f32; LANES]; SHARED], own: &[[f32; LANES]; OWN]) -> [f32; 4] {
    let sum = |lanes: [f32; LANES]| lanes.iter().map(|&v| f64::from(v)).sum::<f64>();
    let [n, x, y, xx, xy, yy] = shared.map(sum);
    let [b, bx, by, bb, z, zx, zy, zb] = own.map(sum);
    let hold = 1e-6 * n + f64::MIN_POSITIVE;
    let mut m = [
        [n + hold, x, y, b, z],
        [x, xx + hold, xy, bx, zx],
        [y, xy, yy + hold, by, zy],
        [b, bx, by, bb + GAIN_HOLD * n + hold, zb],
    ];
    // Positive definite with the terms held: no pivoting.
    for k in 0..4 {
        let row = m[k];
        if row[k] <= 0.0 {
            return [0.0; 4];
        }
        for other in (0..4).filter(|other| *other != k) {
            let share = m[other][k] / row[k];
            m[other].iter_mut().zip(row).for_each(|(v, r)| *v -= share * r);
        }
    }
    let found: [f64; 4] = std::array::from_fn(|k| m[k][4] / m[k][k]);
    if found.iter().all(|v| v.is_finite()) { found.map(|v| v as f32) } else { [0.0; 4] }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fields(of: impl Fn(usize, usize, usize) -> f32) -> (Field, Grid) {
        let grid = Grid::of(320, 240);
        let plane = |c| (0..grid.cells()).map(|i| of(c, i / grid.cols, i % grid.cols)).collect();
        ([plane(0), plane(1), plane(2)], grid)
    }

    #[test]
    fn a_plane_and_a_gain_leave_nothing() {
        let (gel, grid) = fields(|c, row, col| 80.0 + 20.0 * ((row * (c + 2) + 3 * col) as f32 / 9.0).sin());
        let (mut white, _) = fields(|c, row, col| {
            let b = gel[c][row * grid.cols + col];
            3.0 - 0.4 * row as f32 + 0.1 * col as f32 + 0.2 * b
        });
        let mut colour = Colour::of(&grid);
        assert!(colour.glance(&white, &grid) > 1.0);
        let s = colour.judge(&mut white, &gel, &grid);
        assert!(s < 0.2, "{s}");
        assert!(white.iter().flatten().all(|v| v.abs() < 0.3));
    }

    #[test]
    fn a_contact_over_a_third_of_the_picture_stays() {
        let (gel, grid) = fields(|c, row, col| 90.0 + (row + c) as f32 - col as f32);
        let (mut white, _) = fields(|c, row, _| if row < 13 { 6.0 - c as f32 } else { 0.0 } + 2.0);
        let mut colour = Colour::of(&grid);
        colour.glance(&white, &grid);
        let s = colour.judge(&mut white, &gel, &grid);
        assert!((4.0..6.0).contains(&s), "{s}");
        assert!(white[0][39 * 30].abs() < 0.5, "{}", white[0][39 * 30]);
    }

    #[test]
    fn nothing_reads_as_nothing() {
        let (mut white, grid) = fields(|_, _, _| 0.0);
        let gel = white.clone();
        let mut colour = Colour::of(&grid);
        assert_eq!(colour.glance(&white, &grid), 0.0);
        assert_eq!(colour.judge(&mut white, &gel, &grid), 0.0);
    }
}
