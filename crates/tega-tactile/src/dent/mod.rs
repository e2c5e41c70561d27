//! The `live` reading: where the gel is dented, from the shading of a fingertip camera's image.
//!
//! 0. Two rows of each row of cells are looked at ([`glance`]); an untouched gel is told by them.
//! 1. Both images are averaged over some 1,200 cells ([`cells`]); a median per channel takes out a change of colour.
//! 2. The difference is weighed by the sensor's noise ([`response`]). Where fewer than [`GATE_CELLS`] cells rise above
//!    [`GATE`] noise units there is no contact and nothing further is done.
//! 3. Printed dots are filled where the baseline has them ([`dots`]); offset and gain of the picture are fitted.
//! 4. Cells are grouped around peaks ([`basins`]), pieces of one dent are joined ([`patches`]), each patch gets an
//!    outline ([`outline`], from [`samples`]) and is filled at full resolution ([`fill`]).
//!
//! All arithmetic is on integers, or on floats in one fixed order: the result is the same on every processor.

mod basins;
mod cells;
mod dots;
mod fill;
mod glance;
mod known;
mod outline;
mod patches;
mod response;
mod samples;
mod thumbnail;

pub(crate) use basins::sort_keys;
pub(crate) use cells::{add_difference, add_four_differences, add_four_rows, add_row, fold_octets};
pub(crate) use dots::close;
pub(crate) use outline::{Crossing, crossing, medians_of_seven, own};
pub(crate) use response::{LANES, count_above, lengths, mark_quiet, median, quiet_lanes, smooth, take_out};
pub(crate) use samples::{BUNDLE, Walk, between, walk};
pub(crate) use thumbnail::{Thumbnail, Thumbnails};

pub use known::LiveBaseline;

use crate::frame::{Order, Pair};
use crate::metrics::ContactMetrics;
use basins::Basins;
use cells::{Grid, Planes, Source, Strip};
use dots::Closing;
use fill::{Crossings, Filled};
use known::Known;
use outline::Rays;
use patches::Patches;
use response::{COUNTS_PER_UNIT, Response};

/// Response, in noise units, that a cell without contact does not reach.
const GATE: f32 = 8.0;
/// Cells above [`GATE`] that make a contact.
const GATE_CELLS: usize = 1;
/// The length, as a share of the image's diagonal, that a dent's height is given over.
const HEIGHT_SHARE: f64 = 0.125;

/// What the mask of the `live` reading means.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Outline {
    /// The dent, as an eye marks it: out to where the response falls to 0.61 of each flank's own maximum.
    #[default]
    Dent,
    /// The touching area of a curved object: to 0.9 of each flank's maximum. Fragile on faint contacts.
    Contact,
}

impl Outline {
    fn share(self) -> f32 {
        match self {
            Self::Dent => 0.61,
            Self::Contact => 0.9,
        }
    }
}

/// One patch of contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactPatch {
    /// Pixels of the mask that are of this patch and of none before it.
    pub area: u32,
    /// Mean position of those pixels (x, y).
    pub centroid_xy: (f64, f64),
    /// First column, first row, last column, last row of the patch.
    pub bounds: (usize, usize, usize, usize),
    /// Highest response, in counts.
    pub response: f64,
    /// How deep the dent is in the response's own terms, in counts; see [`read_live`].
    pub height: f64,
}

/// Buffers that are reused from frame to frame, and the last frame's result; each is sized once.
#[derive(Debug, Default)]
pub struct LiveScratch {
    grid: Grid,
    strip: Strip,
    difference: Planes,
    /// Of the last frame's baseline.
    known: Known,
    closing: Closing,
    response: Response,
    basins: Basins,
    joined: Patches,
    rays: Rays,
    crossings: Vec<Crossings>,
    mask: Vec<u8>,
    patches: Vec<ContactPatch>,
}

impl LiveScratch {
    /// Makes the mask one of zeros, touching only the rows that the last frame's patches lie in.
    fn clear_mask(&mut self, grid: &Grid) {
        if self.grid == *grid {
            for patch in &self.patches {
                let (_, top, _, bottom) = patch.bounds;
                if let Some(rows) = self.mask.get_mut(top * grid.width..(bottom + 1) * grid.width) {
                    rows.fill(0);
                }
            }
        } else {
            self.mask.clear();
            self.mask.resize(grid.height * grid.width, 0);
            self.grid = *grid;
        }
        self.patches.clear();
    }

    /// The last frame's mask, row by row: 1 in contact, 0 elsewhere.
    pub fn mask(&self) -> &[u8] {
        &self.mask
    }

    /// The last frame's patches, in falling order of response.
    pub fn patches(&self) -> &[ContactPatch] {
        &self.patches
    }

    /// The last frame's response in counts at every pixel, row by row; one value a cell, 0 all over without contact.
    pub fn pressure_map(&self) -> impl Iterator<Item = f32> {
        let Grid { height, width, rows, cols, side, .. } = self.grid;
        let response: &[f32] = if self.patches.is_empty() { &[] } else { &self.response.length };
        let cell = move |pixel: usize, cells: usize| (pixel / side.max(1)).min(cells.saturating_sub(1));
        (0..height).flat_map(move |y| {
            let row = cell(y, rows) * cols;
            (0..width).map(move |x| {
                let response = response.get(row + cell(x, cols));
                response.map_or(0.0, |e| e * COUNTS_PER_UNIT)
            })
        })
    }
}

/// Contact metrics of the `live` reading: `eda` is the number of pixels of [`LiveScratch::mask`].
///
/// - `peak` is the height of the highest patch: its mean response times the root of its area, over an eighth of the
///   image's diagonal. A gel answers to its slope, so slope times width goes with depth.
/// - `cci` is `peak / sqrt(eda)`, and rises with the press.
/// - `centroid_xy`, `peak_xy`: mean position of the mask, of the highest patch. `spread`: root mean square distance of
///   the mask's pixels from its centroid, in pixels. `threshold`: mean response at the outlines, in counts. `mass`: sum of
///   the response over the contact, in counts times pixels.
pub fn read_live(
    pair: &Pair<'_>,
    order: Order,
    outline: Outline,
    scratch: &mut LiveScratch,
) -> ContactMetrics {
    read_with(pair, order, outline, None, scratch)
}

fn read_with(
    pair: &Pair<'_>,
    order: Order,
    outline: Outline,
    known: Option<&Known>,
    scratch: &mut LiveScratch,
) -> ContactMetrics {
    let grid = Grid::of(pair.height(), pair.width());
    scratch.clear_mask(&grid);
    if !respond(pair, &grid, order, known, scratch) {
        return ContactMetrics::none(f64::NAN, 0.0, (0, 0));
    }
    scratch.basins.find(&scratch.response.length, &grid);
    scratch.joined.join(&scratch.basins, &scratch.response, &grid);
    let mut sums = Sums::default();
    let pixels = (grid.side * grid.side) as f64;
    let reference = HEIGHT_SHARE * f64::from(grid.diagonal()) * grid.side as f64;
    for (index, patch) in scratch.joined.contacts() {
        let maps = (&scratch.response.length[..], scratch.joined.owners());
        let Some(polygon) = scratch.rays.outline(index, patch, maps, &grid, outline) else { continue };
        let filled = fill::fill(&polygon, &grid, &mut scratch.crossings, &mut scratch.mask);
        if filled.area == 0 {
            continue;
        }
        let mass = patch.total * pixels * f64::from(COUNTS_PER_UNIT);
        let height = mass / f64::from(filled.area).sqrt() / reference;
        sums.add(&filled, f64::from(polygon.level * COUNTS_PER_UNIT), mass);
        scratch.patches.push(ContactPatch {
            area: filled.area,
            centroid_xy: (filled.x / f64::from(filled.area), filled.y / f64::from(filled.area)),
            bounds: (filled.left, filled.top, filled.right, filled.bottom),
            response: f64::from(patch.peak * COUNTS_PER_UNIT),
            height,
        });
    }
    scratch.patches.sort_unstable_by(|a, b| b.response.total_cmp(&a.response));
    sums.metrics(&scratch.patches)
}

/// Computes the response; false where nothing is in contact.
#[inline(never)]
fn respond(
    pair: &Pair<'_>,
    grid: &Grid,
    order: Order,
    known: Option<&Known>,
    scratch: &mut LiveScratch,
) -> bool {
    glance::may_touch(pair, grid, order, &mut scratch.strip)
        && respond_in_full(pair, grid, order, known, scratch)
}

/// The same, reading all of the frame.
fn respond_in_full(
    pair: &Pair<'_>,
    grid: &Grid,
    order: Order,
    known: Option<&Known>,
    scratch: &mut LiveScratch,
) -> bool {
    let LiveScratch { strip, difference, response, closing, known: found, .. } = scratch;
    let source = known.map_or(Source::Difference, Known::difference);
    cells::average(pair, grid, source, strip, difference);
    response.whiten(difference, grid, order);
    if response.count_above(GATE) < GATE_CELLS {
        return false;
    }
    let known = known.unwrap_or_else(|| {
        found.find(pair, grid, order, strip, closing);
        found
    });
    if let Some(dotless) = known.dotless() {
        closing.without_dots(difference, &known.means, dotless, grid);
        response.whiten(&closing.difference, grid, order);
    }
    response.take_out_colour(&known.smooth, grid);
    response.count_above(GATE) >= GATE_CELLS
}

/// Sums over all patches.
#[derive(Debug, Default)]
struct Sums {
    area: u32,
    x: f64,
    y: f64,
    square: f64,
    level: f64,
    mass: f64,
}

impl Sums {
    fn add(&mut self, filled: &Filled, level: f64, mass: f64) {
        self.area += filled.area;
        self.x += filled.x;
        self.y += filled.y;
        self.square += filled.square;
        self.level += level * f64::from(filled.area);
        self.mass += mass;
    }

    fn metrics(&self, patches: &[ContactPatch]) -> ContactMetrics {
        let highest = patches.iter().max_by(|a, b| a.height.total_cmp(&b.height));
        let Some(highest) = highest else { return ContactMetrics::none(f64::NAN, 0.0, (0, 0)) };
        let n = f64::from(self.area);
        let (x, y) = (self.x / n, self.y / n);
        let (peak_x, peak_y) = highest.centroid_xy;
        ContactMetrics {
            mass: self.mass,
            centroid_xy: (x, y),
            spread: (self.square / n - x * x - y * y).max(0.0).sqrt(),
            threshold: self.level / n,
            eda: self.area,
            cci: highest.height / n.sqrt(),
            peak: highest.height,
            peak_xy: (peak_x.round() as usize, peak_y.round() as usize),
            in_contact: true,
        }
    }
}
