//! Equations 1 to 6 in rational numbers, a pixel at a time: nothing rounds, nothing overflows, nothing is clever.

use std::collections::BTreeMap;

use ndarray::{Array3, Axis};
use num_bigint::BigInt;
use num_rational::BigRational;
use num_traits::{Signed, ToPrimitive, Zero};
use tega_tactile::Difference;

/// What the equations are asked.
pub struct Question {
    /// As the bytes of a pixel lie.
    pub weights: [BigRational; 3],
    pub difference: Difference,
    pub spatial: bool,
    pub bilinear: bool,
    pub factor: BigRational,
    pub gate: Option<(BigRational, u32)>,
}

/// What they answer.
pub struct Answer {
    pub mass: BigRational,
    pub peak: BigRational,
    pub peak_xy: (usize, usize),
    pub contact: Option<Contact>,
}

pub struct Contact {
    pub centroid: [BigRational; 2],
    pub threshold: Threshold,
    pub eda: u32,
}

/// `value - factor * sqrt(variance)`.
pub struct Threshold {
    value: BigRational,
    factor: BigRational,
    pub variance: BigRational,
}

impl Threshold {
    /// Whether `numerator / denominator` (positive) is above it, decided on squares of integers.
    pub fn is_under(&self, numerator: &BigInt, denominator: &BigInt) -> bool {
        let gap = self.value.numer() * denominator - numerator * self.value.denom();
        let scale = self.value.denom() * denominator;
        let (f, v) = (&self.factor, &self.variance);
        let step = f.numer().pow(2) * v.numer() * scale.pow(2);
        let gap_square = gap.pow(2) * f.denom().pow(2) * v.denom();
        match (f.is_negative(), gap.is_negative()) {
            (false, true) => true,
            (true, false) => false,
            (false, false) => step > gap_square,
            (true, true) => step < gap_square,
        }
    }
}

/// A grey map in integers over one denominator.
struct Map {
    levels: Vec<BigInt>,
    denominator: BigInt,
    width: usize,
    height: usize,
}

impl Map {
    fn of(frame: &Array3<u8>, baseline: &Array3<u8>, question: &Question) -> Self {
        let denominator = question.weights.iter().fold(BigInt::from(1), |d, w| d * w.denom());
        let weights = question.weights.each_ref().map(|w| (w * &denominator).to_integer());
        let (height, width, _) = frame.dim();
        let mut levels = vec![];
        for (f, b) in frame.lanes(Axis(2)).into_iter().zip(baseline.lanes(Axis(2))) {
            let mut level = BigInt::zero();
            for c in 0..3 {
                let d = i32::from(f[c]) - i32::from(b[c]);
                level += &weights[c]
                    * match question.difference {
                        Difference::Signed => d,
                        Difference::Rectified => d.max(0),
                        Difference::Absolute => d.abs(),
                    };
            }
            levels.push(level);
        }
        Self { levels, denominator, width, height }
    }

    fn grey(&self, level: &BigInt) -> BigRational {
        BigRational::new(level.clone(), self.denominator.clone())
    }

    fn at(&self, x: usize, y: usize) -> BigRational {
        self.grey(&self.levels[y * self.width + x])
    }

    /// Pixels of which `counted` is true, each level asked once.
    fn count(&self, counted: impl Fn(&BigInt) -> bool) -> u32 {
        let mut pixels = BTreeMap::<&BigInt, u32>::new();
        self.levels.iter().for_each(|level| *pixels.entry(level).or_default() += 1);
        pixels.into_iter().filter(|(level, _)| counted(level)).map(|(_, n)| n).sum()
    }

    /// Sum over the pixels of the level times `of(x, y)`.
    fn sum(&self, of: impl Fn(usize, usize) -> BigInt) -> BigInt {
        self.levels.iter().enumerate().map(|(i, level)| level * of(i % self.width, i / self.width)).sum()
    }
}

fn integer(n: usize) -> BigRational {
    BigRational::from_integer(n.into())
}

pub fn answer(frame: &Array3<u8>, baseline: &Array3<u8>, question: &Question) -> Answer {
    let map = Map::of(frame, baseline, question);
    let mass = map.sum(|_, _| 1.into());
    let peak = map.levels.iter().max().unwrap();
    let at = map.levels.iter().position(|level| level == peak).unwrap();
    let mut answer = Answer {
        mass: map.grey(&mass),
        peak: map.grey(peak),
        peak_xy: (at % map.width, at / map.width),
        contact: None,
    };
    let gated = question.gate.as_ref().is_some_and(|(floor, least)| {
        map.count(|level| level * floor.denom() > floor.numer() * &map.denominator) < *least
    });
    if gated || !mass.is_positive() {
        return answer;
    }
    let (sum_x, sum_y) = (map.sum(|x, _| x.into()), map.sum(|_, y| y.into()));
    let centroid = [&sum_x, &sum_y].map(|sum| BigRational::new(sum.clone(), mass.clone()));
    let pixels = BigInt::from(map.levels.len());
    let variance = if question.spatial {
        // Central moments, scaled by the mass to stay integers.
        let off = |at: usize, sum: &BigInt| -> BigInt { (at * &mass - sum).pow(2) };
        BigRational::new(map.sum(|x, y| off(x, &sum_x) + off(y, &sum_y)), mass.pow(3))
    } else {
        let off = |level: &BigInt| -> BigInt { (level * &pixels - &mass).pow(2) };
        let squares: BigInt = map.levels.iter().map(off).sum();
        BigRational::new(squares, pixels.pow(3) * map.denominator.pow(2))
    };
    if variance.is_negative() {
        return answer;
    }
    let value = value_at(&map, &centroid, question.bilinear);
    let threshold = Threshold { value, factor: question.factor.clone(), variance };
    let eda = map.count(|level| threshold.is_under(level, &map.denominator));
    answer.contact = Some(Contact { centroid, threshold, eda });
    answer
}

fn value_at(map: &Map, centroid: &[BigRational; 2], bilinear: bool) -> BigRational {
    let inside = |at: &BigRational, side: usize| at.clone().max(integer(0)).min(integer(side - 1));
    let [x, y] = centroid;
    if !bilinear {
        let half = BigRational::new(1.into(), 2.into());
        let pixel = |at: &BigRational, side| inside(&(at + &half).floor(), side).to_usize().unwrap();
        return map.at(pixel(x, map.width), pixel(y, map.height));
    }
    let (x, y) = (inside(x, map.width), inside(y, map.height));
    let mut value = BigRational::zero();
    for (row, share_y) in neighbours(&y) {
        for (col, share_x) in neighbours(&x) {
            // A share of nothing belongs to a pixel that may lie outside.
            let share = &share_x * &share_y;
            if !share.is_zero() {
                value += share * map.at(col, row);
            }
        }
    }
    value
}

/// The integers below and above with their shares.
fn neighbours(at: &BigRational) -> [(usize, BigRational); 2] {
    let below = at.floor().to_usize().unwrap();
    [(below, integer(below + 1) - at), (below + 1, at - integer(below))]
}
