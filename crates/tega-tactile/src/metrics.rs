//! Equations 1 to 6 put together: frame and baseline to contact metrics.

use num_bigint::BigInt;

use crate::decimal::{Decimal, Weights};
use crate::error::TactileError;
use crate::exact::{Exact, Sums, Threshold};
use crate::frame::{Difference, Order, Pair};
use crate::sums::{Level, Reading, count_from, read, weigh_sums};

/// What σ in Eq 4 is (readings A1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Spread {
    /// Eq 3 as printed: the root mean square distance from the centroid, in pixels.
    #[default]
    Spatial,
    /// Population standard deviation of the grey map over all pixels, in grey values.
    Intensity,
}

/// How the grey map is read at the centroid (reading A11).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum CentroidValue {
    /// The nearest pixel, ties upward; a centroid outside the image takes the clamped pixel.
    #[default]
    Nearest,
    /// Bilinear between the four pixels around it, after clamping into the image.
    Bilinear,
}

/// No contact unless at least `min_pixels` pixels exceed `noise_floor` (reading A4).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Gate {
    noise_floor: Decimal,
    min_pixels: u32,
}

impl Gate {
    /// A gate at `noise_floor` grey values (0 to 255) and `min_pixels` pixels.
    ///
    /// # Errors
    /// [`TactileError::OutOfRange`] when the floor is not a finite number from 0 to 255.
    pub fn new(noise_floor: f64, min_pixels: u32) -> Result<Self, TactileError> {
        if !(0.0..=255.0).contains(&noise_floor) {
            return Err(TactileError::OutOfRange {
                name: "noise_floor",
                value: noise_floor,
                unit: " grey values",
                wanted: "0 to 255",
            });
        }
        Ok(Self { noise_floor: Decimal::printed("noise_floor", noise_floor)?, min_pixels })
    }
}

/// How the printed equations are read; the default is the print.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Options {
    /// Grey weights of Eq 1.
    pub weights: Weights,
    /// Byte order of a pixel.
    pub order: Order,
    /// How the difference image is taken.
    pub difference: Difference,
    /// What σ is.
    pub spread: Spread,
    /// The 1.28 of Eq 4.
    pub factor: Decimal,
    /// How the grey map is read at the centroid.
    pub centroid_value: CentroidValue,
    /// Contact gate; `None` is the print.
    pub gate: Option<Gate>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            weights: Weights::luma(),
            order: Order::default(),
            difference: Difference::default(),
            spread: Spread::default(),
            factor: Decimal::new(32, 25),
            centroid_value: CentroidValue::default(),
            gate: None,
        }
    }
}

/// What one frame says about the contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactMetrics {
    /// Σ of the grey map, grey values.
    pub mass: f64,
    /// Eq 2: (column, row), pixel centres counted from 0; NaN where undefined.
    pub centroid_xy: (f64, f64),
    /// σ: pixels (spatial) or grey values (intensity); NaN where undefined.
    pub spread: f64,
    /// Eq 4: T, grey values; NaN where undefined.
    pub threshold: f64,
    /// Eq 5: pixels above T.
    pub eda: u32,
    /// Eq 6: peak over EDA; 0 where EDA is 0.
    pub cci: f64,
    /// Largest grey value.
    pub peak: f64,
    /// Its first place in row order, (column, row).
    pub peak_xy: (usize, usize),
    /// False where the equations have no value or the gate says no.
    pub in_contact: bool,
}

impl ContactMetrics {
    /// No contact: the peak and the mass are kept, everything that needs a contact is undefined or zero.
    pub(crate) fn none(mass: f64, peak: f64, peak_xy: (usize, usize)) -> Self {
        Self {
            mass,
            centroid_xy: (f64::NAN, f64::NAN),
            spread: f64::NAN,
            threshold: f64::NAN,
            eda: 0,
            cci: 0.0,
            peak,
            peak_xy,
            in_contact: false,
        }
    }
}

/// Equations 1 to 6 on one frame.
///
/// Sums are exact integers, EDA and peak are exact, the other numbers are correctly rounded to a few units in the last
/// place. Weights and factor mean their printed decimals.
///
/// # Examples
/// ```
/// use ndarray::Array3;
/// use tega_tactile::{Options, Pair, contact_metrics};
///
/// let baseline = Array3::<u8>::zeros((240, 320, 3));
/// let mut frame = baseline.clone();
/// frame[[100, 50, 0]] = 200;
/// let m = contact_metrics(&Pair::new(frame.view(), baseline.view())?, &Options::default());
/// // All mass in one pixel: σ is 0, so T is that pixel's own value and no pixel lies above it.
/// assert_eq!((m.centroid_xy, m.spread, m.eda), ((50.0, 100.0), 0.0, 0));
/// # Ok::<(), tega_tactile::TactileError>(())
/// ```
pub fn contact_metrics(pair: &Pair<'_>, options: &Options) -> ContactMetrics {
    if let Some((weights, denominator)) = options.weights.narrow(options.order) {
        metrics_with(pair, options, &weights, &BigInt::from(denominator))
    } else {
        let (weights, denominator) = options.weights.wide(options.order);
        metrics_with(pair, options, &weights, &denominator)
    }
}

fn metrics_with<L: Level + Into<BigInt> + TryFrom<BigInt>>(
    pair: &Pair<'_>,
    options: &Options,
    weights: &[L; 3],
    denominator: &BigInt,
) -> ContactMetrics {
    let reading = read(pair, options.difference, weights, options.spread == Spread::Intensity);
    let count = |first: BigInt| count_above(pair, options.difference, weights, &reading, first);
    let gated = options
        .gate
        .as_ref()
        .is_some_and(|gate| count(gate.noise_floor.first_level_above(denominator)) < gate.min_pixels);
    let map = Map { pair, options, weights, denominator, reading: &reading };
    map.resolve::<i128>(gated, &count).or_else(|| map.resolve::<BigInt>(gated, &count)).unwrap_or_else(|| {
        // Big integers do not overflow; kept total so that no input can panic.
        ContactMetrics::none(f64::NAN, f64::NAN, reading.peak_xy)
    })
}

/// Pixels at or above level `first`, without reading the images where the peak already answers.
fn count_above<L: Level + Into<BigInt> + TryFrom<BigInt>>(
    pair: &Pair<'_>,
    difference: Difference,
    weights: &[L; 3],
    reading: &Reading<L>,
    first: BigInt,
) -> u32 {
    let all = (pair.width() * pair.height()) as u32;
    if first > reading.peak.clone().into() {
        return 0;
    }
    // A border that does not fit the level type lies below every level, since it is not above the peak.
    L::try_from(first).map_or(all, |first| count_from(pair, difference, weights, &first))
}

struct Map<'m, 'p, L> {
    pair: &'m Pair<'p>,
    options: &'m Options,
    weights: &'m [L; 3],
    denominator: &'m BigInt,
    reading: &'m Reading<L>,
}

impl<L: Level + Into<BigInt>> Map<'_, '_, L> {
    /// Equations 2 to 6 in integers `I`; `None` on overflow.
    fn resolve<I: Exact + TryFrom<BigInt>>(
        &self,
        gated: bool,
        count: &dyn Fn(BigInt) -> u32,
    ) -> Option<ContactMetrics>
    where
        BigInt: From<I>,
    {
        let int = |n: BigInt| I::try_from(n).ok();
        let denominator = int(self.denominator.clone())?;
        let [a, b, c] = self.weights.clone().map(|w| int(w.into()));
        let weights = [a?, b?, c?];
        let options = self.options;
        let squares = options.spread == Spread::Intensity;
        let sums = weigh_sums(&self.reading.channels, &weights, &denominator, squares)?;
        let peak = int(self.reading.peak.clone().into())?;
        let (mass, peak_value) = (I::ratio(&sums.mass, &denominator), I::ratio(&peak, &denominator));
        let none = ContactMetrics::none(mass, peak_value, self.reading.peak_xy);
        let (false, Some([x, y])) = (gated, sums.centroid()) else {
            return Some(none);
        };
        let variance = match options.spread {
            Spread::Spatial => sums.spatial_variance()?,
            Spread::Intensity => sums.intensity_variance(self.pair.width() * self.pair.height())?,
        };
        if variance.numerator.is_negative() {
            return Some(none);
        }
        let (value, value_denominator) = self.value_at_centroid(&sums, &weights)?;
        let factor = [int(options.factor.numerator.clone())?, int(options.factor.denominator.clone())?];
        let threshold = Threshold { value, value_denominator, variance, factor, denominator };
        let eda = count(BigInt::from(threshold.first_level_above()?));
        let cci = match I::from_u32(eda) {
            Some(area) if eda > 0 => I::ratio(&peak, &threshold.denominator.checked_mul(&area)?),
            _ => 0.0,
        };
        Some(ContactMetrics {
            centroid_xy: (x, y),
            spread: threshold.spread(),
            threshold: threshold.to_f64()?,
            eda,
            cci,
            in_contact: true,
            ..none
        })
    }

    /// I(μ) as a numerator and its denominator.
    fn value_at_centroid<I: Exact + TryFrom<BigInt>>(
        &self,
        sums: &Sums<I>,
        weights: &[I; 3],
    ) -> Option<(I, I)> {
        let level = |x: usize, y: usize| {
            let d = self.pair.difference_at(x, y, self.options.difference)?;
            d.iter()
                .zip(weights)
                .try_fold(I::zero(), |total, (d, w)| total.checked_add(&w.checked_mul(&I::from_i16(*d)?)?))
        };
        let (width, height) = (self.pair.width(), self.pair.height());
        if self.options.centroid_value == CentroidValue::Nearest {
            let (x, y) = sums.nearest_pixel(width, height)?;
            return Some((level(x, y)?, sums.denominator.clone()));
        }
        // Corner pixel and the share (over the mass) of the next one, per axis.
        let split = |first: &I, side: usize| {
            let last = side - 1;
            let corner = first.div_floor(&sums.mass);
            if corner.is_negative() {
                return Some((0, I::zero()));
            }
            let corner = corner.to_usize().unwrap_or(last).min(last);
            if corner == last {
                return Some((last, I::zero()));
            }
            Some((corner, first.checked_sub(&sums.mass.checked_mul(&I::from_usize(corner)?)?)?))
        };
        let ((x, share_x), (y, share_y)) = (split(&sums.first[0], width)?, split(&sums.first[1], height)?);
        let mut value = I::zero();
        for (dx, weight_x) in [(0, sums.mass.checked_sub(&share_x)?), (1, share_x)] {
            for (dy, weight_y) in [(0, sums.mass.checked_sub(&share_y)?), (1, share_y.clone())] {
                let weight = weight_x.checked_mul(&weight_y)?;
                if !weight.is_zero() {
                    value = value.checked_add(&weight.checked_mul(&level(x + dx, y + dy)?)?)?;
                }
            }
        }
        Some((value, sums.denominator.checked_mul(&sums.mass)?.checked_mul(&sums.mass)?))
    }
}
