//! The fast contact metrics against the plain ones.

use num_bigint::BigInt;
use num_rational::BigRational;
use num_traits::{One, Signed, ToPrimitive};
use tega_tactile::{
    CentroidValue, ContactMetrics, Decimal, Difference, Gate, Options, Order, Pair, Scratch, Spread,
    TactileError, Weights, contact_metrics,
};

use super::exact::{around, assert_near, assert_root, decimal};
use super::oracle::{Answer, Question, answer};
use super::pictures::{laid_out, pair};
use crate::bytes::Bytes;

/// Any images of any layout under any options: what is counted is exact, what is measured is near the exact result.
pub fn contact_fast_equals_exact(data: &[u8]) {
    let mut bytes = Bytes(data);
    let choices = bytes.byte();
    let order = if choices & 1 == 0 { Order::Bgr } else { Order::Rgb };
    let Some((exact_rgb, weights)) = weights(&mut bytes) else { return };
    let (factor, factor_value) =
        decimal((bytes.long() % 1_000_000_000_000_000) >> bytes.up_to(49), exponent(&mut bytes));
    let gate = (choices & 2 != 0).then(|| {
        let (floor, floor_value) = decimal(i64::from(bytes.word()), -i32::from(bytes.byte() % 20));
        let least = u32::from(bytes.word()) >> (bytes.byte() % 16);
        (floor, floor_value, least)
    });
    let [r, g, b] = exact_rgb;
    let difference = bytes.pick(&[Difference::Signed, Difference::Rectified, Difference::Absolute]);
    let mut options = Options {
        weights,
        order,
        difference,
        spread: if choices & 4 == 0 { Spread::Spatial } else { Spread::Intensity },
        factor: Decimal::printed("factor", factor_value).unwrap(),
        centroid_value: if choices & 8 == 0 { CentroidValue::Nearest } else { CentroidValue::Bilinear },
        gate: None,
    };
    if let Some((floor, value, least)) = &gate {
        let made = Gate::new(*value, *least);
        assert_eq!(made.is_ok(), *floor <= BigRational::from_integer(255.into()));
        let Ok(made) = made else { return };
        options.gate = Some(made);
    }
    let question = Question {
        weights: if order == Order::Bgr { [b, g, r] } else { [r, g, b] },
        difference,
        spatial: choices & 4 == 0,
        bilinear: choices & 8 != 0,
        factor,
        gate: gate.map(|(floor, _, least)| (floor, least)),
    };
    let (height, width) = match bytes.byte() % 4 {
        0 => (1 + bytes.up_to(7), 1 + bytes.up_to(299)),
        1 => (1 + bytes.up_to(1199), 1 + bytes.up_to(1)),
        2 => (1 + bytes.up_to(15), 1 + bytes.up_to(31)),
        _ => (1, 1 + bytes.up_to(1199)),
    };
    let layouts: [u8; 2] = bytes.take();
    let (frame, baseline) = pair(&mut bytes, height, width);
    let wanted = answer(&frame, &baseline, &question);
    let (frame, baseline) = (laid_out(frame, layouts[0]), laid_out(baseline, layouts[1]));
    let images = Pair::new(frame.view(), baseline.view()).unwrap();
    // A scratch that another picture has been through.
    let mut scratch = Scratch::default();
    let swapped =
        Pair::new(baseline.slice(ndarray::s![..1, .., ..]), frame.slice(ndarray::s![..1, .., ..])).unwrap();
    contact_metrics(&swapped, &options, &mut scratch);
    compare(&contact_metrics(&images, &options, &mut scratch), &wanted);
}

fn compare(metrics: &ContactMetrics, wanted: &Answer) {
    assert_near("mass", metrics.mass, &wanted.mass);
    assert_near("peak", metrics.peak, &wanted.peak);
    assert_eq!((metrics.peak_xy, metrics.in_contact), (wanted.peak_xy, wanted.contact.is_some()));
    let Some(contact) = &wanted.contact else {
        assert_eq!((metrics.eda, metrics.cci), (0, 0.0));
        let undefined = [metrics.centroid_xy.0, metrics.centroid_xy.1, metrics.spread, metrics.threshold];
        return assert!(undefined.iter().all(|value| value.is_nan()), "{undefined:?}");
    };
    assert_eq!(metrics.eda, contact.eda);
    let [x, y] = &contact.centroid;
    assert_near("centroid x", metrics.centroid_xy.0, x);
    assert_near("centroid y", metrics.centroid_xy.1, y);
    assert_root("spread", metrics.spread, &contact.threshold.variance);
    if let Some([low, high]) = around(metrics.threshold) {
        let [low, high] = [low, high].map(|end| contact.threshold.is_under(end.numer(), end.denom()));
        assert!(!low && high, "threshold is {}: {low} {high}", metrics.threshold);
    } else {
        let huge = BigRational::from_float(f64::MAX).unwrap().to_integer();
        let one = BigInt::one();
        let beyond = contact.threshold.is_under(&-&huge, &one) || !contact.threshold.is_under(&huge, &one);
        assert!(beyond, "threshold is {}", metrics.threshold);
    }
    if contact.eda == 0 {
        assert_eq!(metrics.cci, 0.0);
    } else {
        assert_near("cci", metrics.cci, &(&wanted.peak / BigInt::from(contact.eda)));
    }
}

/// Mostly 0, seldom large.
fn exponent(bytes: &mut Bytes<'_>) -> i32 {
    let [byte] = bytes.take();
    if byte < 160 { -i32::from(byte % 16) } else { 2 * i32::from(bytes.byte() as i8) }
}

/// Weights (red, green, blue) narrow, wide, very wide, or not adding up: in rationals and as the crate has them.
fn weights(bytes: &mut Bytes<'_>) -> Option<([BigRational; 3], Weights)> {
    let form = bytes.byte();
    let turn = usize::from(form >> 6) % 3;
    let mut parts = match form % 8 {
        0..=2 => {
            let places = 1 + bytes.up_to(3) as u32;
            let one = 10_i64.pow(places);
            let (r, g) =
                (i64::from(bytes.word() as i16) % (2 * one), i64::from(bytes.word() as i16) % (2 * one));
            [r, g, one - r - g].map(|part| decimal(part, -(places as i32)))
        }
        3..=5 => {
            let places = 1 + bytes.up_to(13) as u32;
            let one = 10_i64.pow(places);
            let (r, g) = (bytes.long() % (2 * one), bytes.long() % (2 * one));
            let off = if form & 8 == 0 { 0 } else { i64::from(bytes.byte() as i8) };
            [r, g, one - r - g + off].map(|part| decimal(part, -(places as i32)))
        }
        6 => {
            let tiny = decimal(bytes.long() % 1_000_000_000, -(9 + bytes.up_to(270) as i32));
            [tiny, decimal(5, -1), decimal(5, -1)]
        }
        _ => return Some(([299, 587, 114].map(|part| decimal(part, -3).0), Weights::luma())),
    };
    parts.rotate_left(turn);
    let [r, g, b] = parts;
    let exact = [r.0, g.0, b.0];
    let sum: BigRational = exact.iter().sum();
    let miss = (sum - BigRational::one()).abs();
    let made = Weights::printed(r.1, g.1, b.1);
    let adds_up = miss <= decimal(1, -9).0;
    assert_eq!(made.is_ok(), adds_up, "{r:?} {g:?} {b:?}", r = r.1, g = g.1, b = b.1);
    match made {
        Ok(weights) => Some((exact, weights)),
        Err(TactileError::WeightSum { sum, .. }) => {
            assert_near("sum of weights", sum, &exact.iter().sum());
            None
        }
        Err(error) => panic!("{error} (miss {:?})", miss.to_f64()),
    }
}
