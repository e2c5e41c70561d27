//! Equations 1 to 6 put together: frame and baseline to contact metrics.

use num_bigint::BigInt;
use num_traits::Signed;
use tega_error::OutOfRange;

use crate::decimal::{Decimal, Form, Weights};
use crate::error::TactileError;
use crate::exact::{Exact, Sums, Threshold};
use crate::frame::{Difference, Order, Pair};
use crate::grey::Scratch;
use crate::sums;

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
            return Err(OutOfRange::new("noise_floor", noise_floor, "grey values", "0 to 255").into());
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

/// With a larger factor, a threshold is beyond all grey values by so much that it is no number any more.
const MOST_FACTOR: f64 = 1e6;

impl Options {
    /// The factor of Eq 4 as the decimal that `value` prints as.
    ///
    /// # Errors
    /// [`TactileError::OutOfRange`] when `value` is not from -1e6 to 1e6.
    pub fn printed_factor(value: f64) -> Result<Decimal, TactileError> {
        if value.is_finite() && value.abs() > MOST_FACTOR {
            return Err(OutOfRange::new("factor", value, "", "-1e6 to 1e6").into());
        }
        Decimal::printed("factor", value)
    }
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
/// use tega_tactile::{Options, Pair, Scratch, contact_metrics};
///
/// let baseline = Array3::<u8>::zeros((240, 320, 3));
/// let mut frame = baseline.clone();
/// frame[[100, 50, 0]] = 200;
/// let m = contact_metrics(&Pair::new(frame.view(), baseline.view())?, &Options::default(), &mut Scratch::default());
/// // All mass in one pixel: σ is 0, so T is that pixel's own value and no pixel lies above it.
/// assert_eq!((m.centroid_xy, m.spread, m.eda), ((50.0, 100.0), 0.0, 0));
/// # Ok::<(), tega_tactile::TactileError>(())
/// ```
pub fn contact_metrics(pair: &Pair<'_>, options: &Options, scratch: &mut Scratch) -> ContactMetrics {
    let squares = options.spread == Spread::Intensity;
    let metrics = match options.weights.arranged(options.order) {
        Form::Narrow(weights, denominator) => {
            let kernel = scratch.kernel(weights, options.difference, squares);
            let greys = kernel.read(pair, denominator, scratch);
            let map = Map {
                pair,
                options,
                weights: weights.map(i128::from),
                sums: greys.sums.clone(),
                peak: i128::from(greys.peak),
                peak_xy: greys.peak_xy,
            };
            let count = |first: i32| greys.count_from(&kernel, first);
            // A grey value outside `i32` is beyond every pixel's.
            let outside = |negative: bool| if negative { i32::MIN } else { i32::MAX };
            map.resolve(&|first| count(i32::try_from(*first).unwrap_or(outside(first.is_negative()))))
                .or_else(|| {
                    map.widened().resolve(&|first: &BigInt| {
                        count(i32::try_from(first).unwrap_or(outside(first.is_negative())))
                    })
                })
        }
        Form::Wide(weights, denominator) => {
            let reading = sums::read(pair, options.difference, &weights, squares);
            let map = Map {
                pair,
                options,
                sums: sums::weigh_sums(&reading.channels, &weights, &denominator, squares),
                weights: weights.clone(),
                peak: reading.peak,
                peak_xy: reading.peak_xy,
            };
            map.resolve(&|first| {
                if *first > map.peak {
                    0
                } else {
                    sums::count_from(pair, options.difference, &weights, first)
                }
            })
        }
    };
    // Big integers do not overflow; kept total so that no input can panic.
    metrics.unwrap_or_else(|| ContactMetrics::none(f64::NAN, f64::NAN, (0, 0)))
}

/// A grey map summed up in integers `I`, and where to look single pixels up.
struct Map<'m, 'p, I> {
    pair: &'m Pair<'p>,
    options: &'m Options,
    weights: [I; 3],
    sums: Sums<I>,
    peak: I,
    peak_xy: (usize, usize),
}

impl<'p, I: Exact> Map<'_, 'p, I> {
    /// The same map in integers without a limit.
    fn widened(&self) -> Map<'_, 'p, BigInt> {
        Map {
            pair: self.pair,
            options: self.options,
            weights: self.weights.each_ref().map(I::to_big),
            sums: self.sums.widened(),
            peak: self.peak.to_big(),
            peak_xy: self.peak_xy,
        }
    }

    /// Equations 2 to 6; `count` returns how many pixels are at or above a grey value. `None` on overflow.
    fn resolve(&self, count: &dyn Fn(&I) -> u32) -> Option<ContactMetrics> {
        let (options, sums) = (self.options, &self.sums);
        let denominator = &sums.denominator;
        let mass = I::ratio(&sums.mass, denominator);
        let none = ContactMetrics::none(mass, I::ratio(&self.peak, denominator), self.peak_xy);
        if let Some(gate) = &options.gate
            && count(&gate.noise_floor.first_level_above(denominator)?) < gate.min_pixels
        {
            return Some(none);
        }
        let Some([x, y]) = sums.centroid() else {
            return Some(none);
        };
        let variance = match options.spread {
            Spread::Spatial => sums.spatial_variance()?,
            Spread::Intensity => sums.intensity_variance(self.pair.width() * self.pair.height())?,
        };
        if variance.numerator.is_negative() {
            return Some(none);
        }
        let (value, value_denominator) = self.value_at_centroid()?;
        let factor = options.factor.parts()?;
        let threshold =
            Threshold { value, value_denominator, variance, factor, denominator: denominator.clone() };
        let spread = threshold.spread();
        let value = threshold.to_f64(spread)?;
        let eda = count(&threshold.first_level_above(value)?);
        let cci =
            if eda == 0 { 0.0 } else { I::ratio(&self.peak, &denominator.checked_mul(&I::from_u32(eda)?)?) };
        Some(ContactMetrics {
            centroid_xy: (x, y),
            spread,
            threshold: value,
            eda,
            cci,
            in_contact: true,
            ..none
        })
    }

    /// I(μ) as a numerator and its denominator.
    fn value_at_centroid(&self) -> Option<(I, I)> {
        let sums = &self.sums;
        let level = |x: usize, y: usize| {
            let d = self.pair.difference_at(x, y, self.options.difference)?;
            d.iter()
                .zip(&self.weights)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_factor_is_a_number_of_at_most_a_million() {
        for value in [-1e6, -0.0, 1.28, 1e6] {
            assert!(Options::printed_factor(value).is_ok(), "{value}");
        }
        for value in [-1.5e6, 1.000_001e6, 1e300, f64::NAN, f64::INFINITY] {
            assert!(Options::printed_factor(value).is_err(), "{value}");
        }
    }
}
