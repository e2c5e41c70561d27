//! Read one picture against one of the untouched gel, without memory: the `live` reading.

use ndarray::ArrayView3;

use super::cells::{Grid, Planes, Strip, UNITS_PER_COUNT, average, octet_mean};
use super::colour::{Colour, Field, LANES, total};
use super::dent::{DENT_LEVEL, Dent, DentReader, Outline};
use super::filter::{Evidence, MapFilter};
use super::light::GelLight;
use super::noise::{SensorNoise, grid_of, same_size};
use crate::error::TactileError;
use crate::frame::{Order, Pair};
use crate::metrics::ContactMetrics;

/// S that two pictures of an untouched gel, taken minutes apart, do not reach: twice what shots of a DIGIT far from any press show.
pub(super) const GATE: f32 = 3.0;

/// Counts from which a gel has light that can fail.
const LIT: f32 = 8.0;

/// Sums of each plane, side by side.
#[inline(always)]
fn lights([a, b, c]: &Field) -> [[f32; LANES]; 3] {
    let mut sums = [[0f32; LANES]; 3];
    let [(a, last_a), (b, last_b), (c, last_c)] = [a, b, c].map(|plane| plane.as_chunks::<LANES>());
    for ((a, b), c) in a.iter().zip(b).zip(c) {
        for lane in 0..LANES {
            sums[0][lane] += a[lane];
            sums[1][lane] += b[lane];
            sums[2][lane] += c[lane];
        }
    }
    for (sums, last) in sums.iter_mut().zip([last_a, last_b, last_c]) {
        sums.iter_mut().zip(last).for_each(|(sum, v)| *sum += v);
    }
    sums
}

/// What both the stateless reading and the tracker share: a sensor's cells, noise and light.
#[derive(Debug, Clone, Default)]
pub(super) struct Cells {
    pub grid: Grid,
    pub order: Order,
    pub noise: SensorNoise,
    strip: Strip,
    pub means: Planes,
    /// Change of colour in noise units; of the last call.
    pub white: Field,
    pub colour: Colour,
    pub reader: DentReader,
}

impl Cells {
    pub fn of(
        image: &ArrayView3<'_, u8>,
        noise: SensorNoise,
        light: &GelLight,
        order: Order,
    ) -> Result<Self, TactileError> {
        let grid = grid_of(image)?;
        Ok(Self {
            grid,
            order,
            noise,
            colour: Colour::of(&grid),
            reader: DentReader::of(light, noise.arranged(order), order, &grid),
            white: [vec![0.0; grid.cells()], vec![0.0; grid.cells()], vec![0.0; grid.cells()]],
            ..Self::default()
        })
    }

    /// Cell means of an image in counts.
    pub fn counts(&mut self, image: &ArrayView3<'_, u8>, out: &mut Field) -> Result<(), TactileError> {
        self.take(image)?;
        for (out, means) in out.iter_mut().zip(&self.means) {
            out.clear();
            out.extend(means.iter().map(|&m| f32::from(m) / UNITS_PER_COUNT));
        }
        Ok(())
    }

    /// Averages an image over the cells.
    pub fn take(&mut self, image: &ArrayView3<'_, u8>) -> Result<(), TactileError> {
        same_size(&self.grid, image)?;
        average(image.view(), &self.grid, &mut self.strip, &mut self.means);
        Ok(())
    }

    /// Takes an image's sums over cells of 8 x 8 pixels.
    pub fn take_sums(&mut self, sums: [&[i16]; 3]) -> Result<(), TactileError> {
        let (got, wanted) = (sums.map(<[i16]>::len), if self.grid.octets() { self.grid.cells() } else { 0 });
        if got.iter().any(|got| *got != wanted) || wanted == 0 {
            return Err(TactileError::Cells { got: got[0], wanted });
        }
        for (means, sums) in self.means.iter_mut().zip(sums) {
            means.clear();
            means.extend(sums.iter().map(|sum| octet_mean(*sum)));
        }
        Ok(())
    }

    /// S of the last image taken against an untouched gel in counts, by the quick fit.
    #[inline(always)]
    pub fn glance(&mut self, gel: &Field) -> f32 {
        let noise = self.noise.arranged(self.order);
        for (((white, means), gel), noise) in self.white.iter_mut().zip(&self.means).zip(gel).zip(noise) {
            whiten(means, gel, 1.0 / UNITS_PER_COUNT, 1.0 / noise, white);
        }
        self.colour.glance(&self.white, &self.grid)
    }

    /// S of the last image after a change of light is taken out; call [`Self::glance`] before.
    #[inline(always)]
    pub fn judge(&mut self, gel: &Field) -> f32 {
        self.colour.judge(&mut self.white, gel, &self.grid)
    }

    /// Whether the last image has less than half of the light of an untouched gel in counts, where that has any.
    #[inline(always)]
    pub fn dark(&self, gel: &Field) -> bool {
        let [a, b, c] = &self.means;
        let now: i32 =
            a.iter().zip(b).zip(c).map(|((a, b), c)| [*a, *b, *c].map(i32::from).iter().sum::<i32>()).sum();
        let [first, middle, last] = lights(gel).map(|sums| total(&sums));
        let still = (first + last) + middle;
        still > LIT * (3 * self.grid.cells()) as f32 && (now as f32) < 0.5 * UNITS_PER_COUNT * still
    }

    /// Change from one untouched gel in counts to another in noise units, a change of light taken out.
    pub fn change_between(&mut self, now: &Field, gel: &Field) {
        let noise = self.noise.arranged(self.order);
        for (((white, now), gel), noise) in self.white.iter_mut().zip(now).zip(gel).zip(noise) {
            white.iter_mut().zip(now).zip(gel).for_each(|((w, now), gel)| *w = (now - gel) / noise);
        }
        if self.colour.tells() {
            self.colour.glance(&self.white, &self.grid);
            judge(self, gel);
        }
    }

    /// The dent of the last change; call [`Self::judge`] before.
    pub fn dent(&mut self, outline: Outline) -> Dent {
        self.reader.read(&self.white, &self.grid, outline)
    }

    /// The same, averaged over time; `rest` is S at rest.
    pub fn steady_dent(&mut self, outline: Outline, filter: &mut MapFilter, rest: f64, dt_s: f64) -> Dent {
        let evidence = Evidence { pooled: self.colour.left(), rest, dt_s };
        self.reader.read_steady(&self.white, &self.grid, outline, filter, &evidence)
    }

    /// Gives every run of pixels of the last dent: (row, first column, last column excluded).
    pub fn paint(&self, outline: Outline, paint: impl FnMut(usize, usize, usize)) {
        self.reader.paint(outline, paint);
    }

    /// Counts that one noise unit is, root mean square over the colours.
    pub fn counts_per_unit(&self) -> f64 {
        (self.noise.bgr.iter().map(|n| f64::from(n * n)).sum::<f64>() / 3.0).sqrt()
    }

    /// The dent in the form of the printed equations' metrics.
    pub fn metrics(&self, dent: &Dent) -> ContactMetrics {
        if dent.moments.area == 0 {
            return ContactMetrics::none(0.0, 0.0, (0, 0));
        }
        let (x, y) = dent.middle;
        let height = dent.height(&self.grid) * self.counts_per_unit();
        let area = dent.moments.area as f64;
        ContactMetrics {
            mass: dent.mass * self.counts_per_unit(),
            centroid_xy: (x, y),
            spread: dent.moments.spread(),
            threshold: dent.strongest * self.counts_per_unit() * f64::from(DENT_LEVEL),
            eda: u32::try_from(dent.moments.area).unwrap_or(u32::MAX),
            cci: height / area.sqrt(),
            peak: height,
            peak_xy: (x.round() as usize, y.round() as usize),
            in_contact: true,
        }
    }
}

tega_simd::dispatched! {
    /// See [`Cells::glance`].
    glance = Cells::glance, (cells: &mut Cells, gel: &Field) -> f32
}

tega_simd::dispatched! {
    /// See [`Cells::dark`].
    dark = Cells::dark, (cells: &Cells, gel: &Field) -> bool
}

tega_simd::dispatched! {
    /// See [`Cells::judge`].
    judge = Cells::judge, (cells: &mut Cells, gel: &Field) -> f32
}

tega_simd::dispatched! {
    /// See [`Colour::plain`].
    plain_of = Colour::plain, (colour: &mut Colour, white: &Field, grid: &Grid) -> f32
}

/// S of the last change as it is now, after more was taken out than [`Cells::judge`] takes.
pub(super) fn plain(cells: &mut Cells) -> f32 {
    plain_of(&mut cells.colour, &cells.white, &cells.grid)
}

tega_simd::dispatched! {
    /// See [`Colour::glance`].
    glance_of = Colour::glance, (colour: &mut Colour, white: &Field, grid: &Grid) -> f32
}

/// S of the last change as it is now, by the quick fit.
pub(super) fn glance_again(cells: &mut Cells) -> f32 {
    glance_of(&mut cells.colour, &cells.white, &cells.grid)
}

/// Change of cell means to the untouched gel, in noise units.
#[inline(always)]
fn whiten(means: &[i16], gel: &[f32], scale: f32, per_noise: f32, out: &mut [f32]) {
    for ((out, mean), gel) in out.iter_mut().zip(means).zip(gel) {
        *out = (f32::from(*mean) * scale - gel) * per_noise;
    }
}

/// Moves the untouched gel a share of the way to cell means.
#[inline(always)]
fn follow_plain(gel: &mut [f32], means: &[i16], scale: f32, share: f32) {
    for (gel, mean) in gel.iter_mut().zip(means) {
        *gel += share * (f32::from(*mean) * scale - *gel);
    }
}

tega_simd::dispatched! {
    /// See [`follow_plain`].
    follow = follow_plain, (gel: &mut [f32], means: &[i16], scale: f32, share: f32) -> ()
}

/// Reads pictures against one of the untouched gel; what can be found out from that one alone is found out once.
#[derive(Debug, Clone)]
pub struct LiveReader {
    cells: Cells,
    gel: Field,
    outline: Outline,
    mask: Vec<u8>,
    marked: bool,
    touched: bool,
}

impl LiveReader {
    /// Takes the picture of the untouched gel; `noise` is the sensor's.
    ///
    /// # Errors
    /// [`TactileError::Channels`] or [`TactileError::Size`].
    pub fn new(
        baseline: ArrayView3<'_, u8>,
        order: Order,
        outline: Outline,
        noise: SensorNoise,
    ) -> Result<Self, TactileError> {
        let mut cells = Cells::of(&baseline, noise, &GelLight::default(), order)?;
        let mut gel = Field::default();
        cells.counts(&baseline, &mut gel)?;
        Ok(Self { cells, gel, outline, mask: Vec::new(), marked: false, touched: false })
    }

    /// Metrics of a frame.
    ///
    /// - `peak` is the height of the dent in counts: the mean change of colour over it times the root of its area, over an eighth of the picture's
    ///   diagonal. A gel answers to its slope, so slope times width goes with depth.
    /// - `cci` is `peak / sqrt(eda)`. `centroid_xy`, `peak_xy`: middle of the dent, as its outline would lie in an even light. `spread`: root mean
    ///   square distance of the mask's pixels from their mean place. `threshold`: change of colour at the outline, counts. `mass`: sum of the
    ///   change over the dent, counts times pixels.
    ///
    /// # Errors
    /// [`TactileError::Channels`] or [`TactileError::ShapeMismatch`].
    pub fn read(&mut self, frame: ArrayView3<'_, u8>) -> Result<ContactMetrics, TactileError> {
        self.read_and(&frame, false)
    }

    fn read_and(&mut self, frame: &ArrayView3<'_, u8>, mark: bool) -> Result<ContactMetrics, TactileError> {
        self.touched = false;
        self.marked = mark;
        if mark {
            self.mask.clear();
            self.mask.resize(self.cells.grid.height * self.cells.grid.width, 0);
        }
        self.cells.take(frame)?;
        let none = ContactMetrics::none(0.0, 0.0, (0, 0));
        if !self.cells.colour.tells()
            || glance(&mut self.cells, &self.gel) < GATE
            || judge(&mut self.cells, &self.gel) < GATE
        {
            return Ok(none);
        }
        let (width, mask) = (self.cells.grid.width, &mut self.mask);
        let dent = self.cells.dent(self.outline);
        if mark {
            self.cells.paint(self.outline, |y, first, end| {
                if let Some(run) = mask.get_mut(y * width + first..y * width + end) {
                    run.fill(1);
                }
            });
        }
        self.touched = dent.moments.area > 0;
        Ok(self.cells.metrics(&dent))
    }

    /// Metrics of a frame and its mask, row by row: 1 in contact, 0 elsewhere; `eda` is the number of its ones.
    ///
    /// # Errors
    /// Those of [`Self::read`].
    pub fn mask(&mut self, frame: ArrayView3<'_, u8>) -> Result<(ContactMetrics, &[u8]), TactileError> {
        let metrics = self.read_and(&frame, true)?;
        Ok((metrics, &self.mask))
    }

    /// Change of colour in counts at every pixel of the last frame, row by row; one value a cell, 0 all over without contact.
    pub fn pressure_map(&self) -> impl Iterator<Item = f32> {
        let Grid { height, width, cols, side, .. } = self.cells.grid;
        let change: &[f32] = if self.touched { &self.cells.reader.change } else { &[] };
        let unit = self.cells.counts_per_unit() as f32;
        (0..height).flat_map(move |y| {
            (0..width).map(move |x| change.get(y / side * cols + x / side).map_or(0.0, |e| e * unit))
        })
    }
}

/// Keeps the reader of the last call, for calls with one baseline after the other.
#[derive(Debug, Default)]
pub struct LiveScratch {
    reader: Option<LiveReader>,
}

impl LiveScratch {
    /// A reader for this baseline; buffers of the one before are used where they fit.
    ///
    /// # Errors
    /// None for images that make a [`Pair`].
    pub fn reader(
        &mut self,
        pair: &Pair<'_>,
        order: Order,
        outline: Outline,
        noise: SensorNoise,
    ) -> Result<&mut LiveReader, TactileError> {
        let fits = |r: &LiveReader| {
            (r.cells.grid.height, r.cells.grid.width) == (pair.height(), pair.width())
                && r.cells.order == order
                && r.cells.noise == noise
        };
        match self.reader.take().filter(fits) {
            Some(mut reader) => {
                let mut gel = std::mem::take(&mut reader.gel);
                reader.cells.counts(&pair.baseline(), &mut gel)?;
                reader.gel = gel;
                reader.outline = outline;
                Ok(self.reader.insert(reader))
            }
            None => Ok(self.reader.insert(LiveReader::new(pair.baseline(), order, outline, noise)?)),
        }
    }
}

/// Contact metrics of the `live` reading of one frame against one of the untouched gel; see [`LiveReader::read`].
///
/// # Errors
/// None for images that make a [`Pair`].
pub fn read_live(
    pair: &Pair<'_>,
    order: Order,
    outline: Outline,
    noise: SensorNoise,
    scratch: &mut LiveScratch,
) -> Result<ContactMetrics, TactileError> {
    scratch.reader(pair, order, outline, noise)?.read(pair.frame())
}
