//! From cells that differ from the untouched gel to the dent: where, how wide, how deep.
//!
//! Two maps describe a dent and each is weak where the other is strong: the energy of the colour change, which is a ring around a ball, and the
//! depth from shading, which fills the ring. The outline is where the mean of both, each over its own peak, crosses one level; where shading makes
//! no depth at the cells that change, energy alone outlines. The middle is found by itself ([`middle`](super::middle)).

use super::cells::Grid;
use super::colour::{Field, LANES, total};
use super::depth::Solver;
use super::filter::{Evidence, MapFilter};
use super::light::{GelLight, Slopes};
use super::middle::{Middle, RIM};
use super::peak::{half_share, peak};
use super::shape::{Moments, Outliner, any_above, outline};
use crate::frame::Order;

/// The outline's level: the mean of energy and depth, as shares of their peaks, that an eye marks as the rim.
pub(super) const DENT_LEVEL: f32 = 0.32;
/// The same for the touching area of a curved object.
const CONTACT_LEVEL: f32 = 0.5;
/// Share of the peak of the energy under which a cell is taken for untouched when depth is counted from there.
const UNTOUCHED: f32 = 0.2;

/// Depth at the cells that change, as a share of its peak: under the first the gel's light is not what shading takes it for, from the second on it
/// may be.
const AGREES: [f32; 2] = [0.01, 0.03];

/// The length, as a share of the picture's diagonal, that a dent's height is given over.
const HEIGHT_SHARE: f64 = 0.125;

/// What the outline of a contact means.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Outline {
    /// The dent, as an eye marks it in the picture.
    #[default]
    Dent,
    /// Nearer to the area that a curved object touches; fragile on faint contacts.
    Contact,
}

impl Outline {
    fn level(self) -> f32 {
        match self {
            Self::Dent => DENT_LEVEL,
            Self::Contact => CONTACT_LEVEL,
        }
    }
}

/// One picture's dent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Dent {
    pub moments: Moments,
    /// Its middle (column, row), pixels; NaN where nothing is outlined.
    pub middle: (f64, f64),
    /// Strongest change of colour, noise units; a mean over the strongest cells.
    pub strongest: f64,
    /// Deepest place by shading alone, millimetres; a mean likewise.
    pub shaded_mm: f64,
    /// Volume under that depth, cubic millimetres.
    pub volume_mm3: f64,
    /// Sum of the change of colour over the dent, noise units times pixels.
    pub mass: f64,
}

impl Dent {
    /// How high it stands in noise units: a gel answers to its slope, so the mean change over the dent times the dent's width goes with depth. The
    /// width is given over an eighth of the picture's diagonal.
    pub fn height(&self, grid: &Grid) -> f64 {
        let diagonal = ((grid.height * grid.height + grid.width * grid.width) as f64).sqrt();
        self.mass / (self.moments.area.max(1) as f64).sqrt() / (HEIGHT_SHARE * diagonal)
    }
}

/// Reads dents; made once for a sensor.
#[derive(Debug, Clone, Default)]
pub(super) struct DentReader {
    slopes: Slopes,
    solver: Solver,
    middle: Middle,
    outliner: Outliner,
    mm_per_cell: f64,
    /// Height in millimetres for a change of one noise unit over the width that heights are given over.
    pub mm_per_unit: f64,
    energy: Vec<f32>,
    spare: Vec<f32>,
    /// Change of colour a cell, noise units; of the last call.
    pub change: Vec<f32>,
    /// Depth a cell over the untouched gel, millimetres; of the last call.
    pub depth_mm: Vec<f32>,
    /// What is outlined; of the last call.
    pub dent: Vec<f32>,
}

impl DentReader {
    pub fn of(light: &GelLight, noise: [f32; 3], order: Order, grid: &Grid) -> Self {
        let n = grid.cells();
        let buffer = || vec![0.0; n];
        // The field of view is that of the nominal picture, whatever its size.
        let nominal_px = 400.0 / ((grid.height * grid.height + grid.width * grid.width) as f64).sqrt();
        let mut slopes = Slopes::of(light, noise, order.arrange([2, 1, 0]), grid);
        Self {
            mm_per_unit: HEIGHT_SHARE * 400.0 * light.mm_per_px / slopes.strength,
            middle: Middle::of(std::mem::take(&mut slopes.even), grid),
            outliner: Outliner::of(grid),
            slopes,
            solver: Solver::of(grid),
            mm_per_cell: grid.side as f64 * nominal_px * light.mm_per_px,
            energy: buffer(),
            spare: buffer(),
            change: buffer(),
            depth_mm: buffer(),
            dent: buffer(),
        }
    }

    /// Finds the dent in a change of colour in noise units, the light's own change taken out.
    pub fn read(&mut self, white: &Field, grid: &Grid, level: Outline) -> Dent {
        let peaks = maps(self, white, grid);
        self.measure(grid, level, peaks)
    }

    /// The same, its maps averaged with those of earlier pictures by as much as the filter finds right.
    pub fn read_steady(
        &mut self,
        white: &Field,
        grid: &Grid,
        level: Outline,
        filter: &mut MapFilter,
        evidence: &Evidence<'_>,
    ) -> Dent {
        let mut peaks = maps(self, white, grid);
        let area = cells_over(&self.dent, level.level());
        if filter.take([&mut self.change, &mut self.depth_mm], [area, peaks[1]], evidence) {
            peaks = combined(self);
        }
        self.measure(grid, level, peaks)
    }

    fn measure(&mut self, grid: &Grid, level: Outline, [strongest, deepest]: [f32; 2]) -> Dent {
        let moments = outline(&self.outliner, &self.dent, level.level());
        let maps = [&self.change[..], &self.depth_mm];
        let middle = self.middle.find(maps, [strongest, deepest], level.level());
        let [mass, volume] = sums_inside(&self.dent, [&self.change, &self.depth_mm], level.level());
        Dent {
            moments,
            middle,
            strongest: f64::from(strongest),
            shaded_mm: f64::from(deepest),
            volume_mm3: volume * self.mm_per_cell * self.mm_per_cell,
            mass: mass * (grid.side * grid.side) as f64,
        }
    }

    /// Maps change of colour, depth and what is to be outlined; the peaks of the first two.
    #[inline(always)]
    fn map(&mut self, white: &Field, grid: &Grid) -> [f32; 2] {
        let [a, b, c] = white;
        energy([a, b, c], &mut self.energy);
        smooth(&self.energy, grid, &mut self.spare, &mut self.change);
        // Noise alone has an energy of 1.
        self.change.iter_mut().for_each(|e| *e = (*e - 1.0).max(0.0).sqrt());
        let strongest = peak(&self.change);
        self.solver.solve(white, &self.slopes.weights, grid);
        let floor = untouched(&self.solver.depth, &self.change, strongest);
        let mm = self.mm_per_cell as f32;
        self.depth_mm.iter_mut().zip(&self.solver.depth).for_each(|(h, d)| *h = ((d - floor) * mm).max(0.0));
        self.combine(strongest)
    }

    /// What is outlined, from the maps of change and depth; their peaks, the first of which is known.
    #[inline(always)]
    fn combine(&mut self, strongest: f32) -> [f32; 2] {
        // Where no colour changes, what is left of depth is rounding.
        let deepest = if strongest > 0.0 { peak(&self.depth_mm) } else { 0.0 };
        let (per_change, per_depth) = (half_share(strongest), half_share(deepest));
        // Where shading contradicts, its depth is a matter of noise: change alone outlines.
        let agreed = 2.0 * per_depth * at_change(&self.depth_mm, &self.change);
        let trust = ((agreed - AGREES[0]) / (AGREES[1] - AGREES[0])).clamp(0.0, 1.0);
        let (per_change, per_depth) = ((2.0 - trust) * per_change, trust * per_depth);
        for ((dent, e), h) in self.dent.iter_mut().zip(&self.change).zip(&self.depth_mm) {
            *dent = e * per_change + h * per_depth;
        }
        [strongest, deepest]
    }

    #[inline(always)]
    fn combine_averaged(&mut self) -> [f32; 2] {
        let strongest = peak(&self.change);
        self.combine(strongest)
    }

    /// Gives every run of pixels of the last dent: (row, first column, last column excluded).
    pub fn paint(&self, level: Outline, paint: impl FnMut(usize, usize, usize)) {
        self.outliner.paint(&self.dent, level.level(), paint);
    }
}

tega_simd::dispatched! {
    /// See [`DentReader::map`].
    maps = DentReader::map, (reader: &mut DentReader, white: &Field, grid: &Grid) -> [f32; 2]
}

tega_simd::dispatched! {
    /// See [`DentReader::combine`].
    combined = DentReader::combine_averaged, (reader: &mut DentReader) -> [f32; 2]
}

tega_simd::dispatched! {
    /// See [`inside`].
    sums_inside = inside, (dent: &[f32], maps: [&[f32]; 2], level: f32) -> [f64; 2]
}

/// Sums of two maps over the cells that are over a level, one after the other.
#[inline(always)]
fn inside(dent: &[f32], [change, depth]: [&[f32]; 2], level: f32) -> [f64; 2] {
    let mut sums = [0f64; 2];
    let mut add = |dent: &[f32], change: &[f32], depth: &[f32]| {
        for ((d, e), h) in dent.iter().zip(change).zip(depth) {
            if *d > level {
                sums[0] += f64::from(*e);
                sums[1] += f64::from(*h);
            }
        }
    };
    let [(dent, last), (change, last_change), (depth, last_depth)] =
        [dent, change, depth].map(|map| map.as_chunks::<LANES>());
    for ((dent, change), depth) in dent.iter().zip(change).zip(depth) {
        // Most of the picture is not inside.
        if any_above(dent, level) {
            add(dent, change, depth);
        }
    }
    add(last, last_change, last_depth);
    sums
}

tega_simd::dispatched! {
    /// See [`count`].
    cells_over = count, (dent: &[f32], level: f32) -> f32
}

/// Cells over a level, those about it counted by degrees.
#[inline(always)]
fn count(dent: &[f32], level: f32) -> f32 {
    let from = level / RIM - 0.5;
    let degree = |v: f32| {
        let over = v * (1.0 / RIM) - from;
        let over = if over > 0.0 { over } else { 0.0 };
        if over < 1.0 { over } else { 1.0 }
    };
    let mut sums = [0f32; LANES];
    let (chunks, rest) = dent.as_chunks::<LANES>();
    for chunk in chunks {
        for lane in 0..LANES {
            sums[lane] += degree(chunk[lane]);
        }
    }
    sums.iter_mut().zip(rest).for_each(|(sum, v)| *sum += degree(*v));
    total(&sums)
}

/// Energy of the change a cell, in noise units.
#[inline(always)]
fn energy([a, b, c]: [&[f32]; 3], out: &mut [f32]) {
    for (((out, a), b), c) in out.iter_mut().zip(a).zip(b).zip(c) {
        *out = ((a * a + c * c) + b * b) * (1.0 / 3.0);
    }
}

/// 1-2-1 both ways; cells at the border are repeated.
#[inline(always)]
fn smooth(plane: &[f32], grid: &Grid, spare: &mut [f32], out: &mut [f32]) {
    let (rows, cols) = (grid.rows, grid.cols);
    let from = |row: usize| plane.get(row * cols..).unwrap_or_default();
    // Of the last row the one after it is itself.
    let (inner, last) = spare.split_at_mut((rows - 1) * cols);
    let (first, inner) = inner.split_at_mut(inner.len().min(cols));
    one_two_one(from(0), from(0), from(1), first);
    one_two_one(from(0), from(1), from(2), inner);
    one_two_one(from(rows.saturating_sub(2)), from(rows - 1), from(rows - 1), last);
    out.copy_from_slice(spare);
    if cols == 1 {
        return;
    }
    let after = |cells: usize| spare.get(cells..).unwrap_or_default();
    one_two_one(spare, after(1), after(2), out.get_mut(1..).unwrap_or_default());
    for (spare, out) in spare.chunks_exact(cols).zip(out.chunks_exact_mut(cols)) {
        out[0] = 0.25 * (3.0 * spare[0] + spare[1]);
        out[cols - 1] = 0.25 * (3.0 * spare[cols - 1] + spare[cols - 2]);
    }
}

/// A quarter of the first and the last, half of the middle.
#[inline(always)]
fn one_two_one(a: &[f32], b: &[f32], c: &[f32], out: &mut [f32]) {
    for (((out, a), b), c) in out.iter_mut().zip(a).zip(b).zip(c) {
        *out = 0.25 * ((a + c) + 2.0 * b);
    }
}

/// Mean depth of the cells, each weighed by its change squared.
#[inline(always)]
fn at_change(depth: &[f32], change: &[f32]) -> f32 {
    mean_by(weighed_sums(depth, change, |change| change * change))
}

/// Mean depth where the colours hardly change, each cell weighed by how little: 1 / (1 + v⁴), v the scaled change.
#[inline(always)]
fn untouched(depth: &[f32], change: &[f32], strongest: f32) -> f32 {
    let scale = if strongest > 0.0 { 1.0 / (UNTOUCHED * strongest) } else { 0.0 };
    mean_by(weighed_sums(depth, change, |change| {
        let v = change * scale;
        1.0 / (1.0 + (v * v) * (v * v))
    }))
}

#[inline(always)]
fn mean_by(sums: [[f32; LANES]; 2]) -> f32 {
    let [weights, sums] = sums.map(|lanes| total(&lanes));
    if weights > 0.0 { sums / weights } else { 0.0 }
}

/// Sums of the cells' weights by their change, and of weight times depth.
#[inline(always)]
fn weighed_sums(depth: &[f32], change: &[f32], weight: impl Fn(f32) -> f32) -> [[f32; LANES]; 2] {
    let mut sums = [[0f32; LANES]; 2];
    // At most seven cells of the last corner are left out.
    for (d, e) in depth.as_chunks::<LANES>().0.iter().zip(change.as_chunks::<LANES>().0) {
        for lane in 0..LANES {
            let weight = weight(e[lane]);
            sums[0][lane] += weight;
            sums[1][lane] += weight * d[lane];
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_count_by_how_far_they_are_over_the_level() {
        let level = 10.0 * RIM;
        let dent: Vec<f32> = (0..23).map(|k| level + [-9.0, -0.25, 0.0, 0.25, 9.0][k % 5] * RIM).collect();
        let wanted: f32 = (0..23).map(|k| [0.0, 0.25, 0.5, 0.75, 1.0][k % 5]).sum();
        assert!((count(&dent, level) - wanted).abs() < 1e-3, "{} {wanted}", count(&dent, level));
    }

    #[test]
    fn depth_is_counted_from_where_nothing_changes() {
        let (depth, change) = ([[3.0; 8], [9.0; 8]].concat(), [[0.0; 8], [5.0; 8]].concat());
        // Five times the scale of the weights, to the fourth power.
        let far = 1.0 / 626.0;
        let floor = untouched(&depth, &change, 5.0);
        assert!((floor - (3.0 + 9.0 * far) / (1.0 + far)).abs() < 1e-5, "{floor}");
    }

    #[test]
    fn depth_that_lies_beside_the_change_is_not_outlined() {
        let at = |cells: std::ops::Range<usize>, value: f32| -> Vec<f32> {
            (0..32).map(|k| if cells.contains(&k) { value } else { 0.0 }).collect()
        };
        let dent_of = |deep: std::ops::Range<usize>| {
            let maps = (at(8..16, 10.0), at(deep, 0.5));
            let mut reader =
                DentReader { change: maps.0, depth_mm: maps.1, dent: at(0..0, 0.0), ..DentReader::default() };
            reader.combine(10.0);
            reader.dent
        };
        assert_eq!(dent_of(16..24), at(8..16, 1.0));
        assert_eq!(dent_of(8..16), at(8..16, 1.0));
        // One of the eight cells is enough for both to count.
        let both = dent_of(15..24);
        assert_eq!((both[8], both[15], both[16]), (0.5, 1.0, 0.5));
    }

    #[test]
    fn a_dent_of_the_same_depth_is_as_high_in_a_picture_of_any_orientation() {
        let height = |w, h| {
            let dent = Dent {
                moments: Moments::default(),
                middle: (f64::NAN, f64::NAN),
                strongest: 0.0,
                shaded_mm: 0.0,
                volume_mm3: 0.0,
                mass: 300.0,
            };
            dent.height(&Grid::of(h, w))
        };
        assert_eq!(height(320, 240), height(240, 320));
        assert!((height(320, 240) / height(640, 480) - 2.0).abs() < 1e-12);
    }
}
