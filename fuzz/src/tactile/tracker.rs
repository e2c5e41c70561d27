//! The touch tracker on any frames at any times.

use ndarray::Array3;
use tega_tactile::{Order, Outline, SensorNoise, Touch, TouchTracker, TrackerOptions};

use super::pictures::{draw, laid_out};
use crate::bytes::Bytes;

/// Any frames at any times: no panic, the numbers are bounded and agree, two trackers fed the same say the same whatever the layout, an
/// error changes nothing, and its own baseline is no contact.
pub fn tracker_is_bounded_and_the_same_again(data: &[u8]) {
    let mut bytes = Bytes(data);
    let choices = bytes.byte();
    let (height, width) = match bytes.byte() % 32 {
        0 => (240, 320),
        1 => (1, 1 + bytes.up_to(4095)),
        2 => (1 + bytes.up_to(4095), 1),
        3 => (1 + bytes.up_to(9), 1 + bytes.up_to(9)),
        _ => (1 + bytes.up_to(119), 1 + bytes.up_to(159)),
    };
    let noise = bytes.take().map(|byte: u8| f64::from(byte) / 16.0);
    let options = TrackerOptions {
        rate_hz: 0.01 + f64::from(bytes.word()) / 66.0,
        order: if choices & 1 == 0 { Order::Bgr } else { Order::Rgb },
        outline: if choices & 2 == 0 { Outline::Dent } else { Outline::Contact },
        noise: SensorNoise::of_counts(noise).unwrap(),
        rezero: choices & 4 == 0,
        ..TrackerOptions::default()
    };
    let colour: [u8; 3] = bytes.take();
    let mut baseline = Array3::from_shape_fn((height, width, 3), |(_, _, c)| colour[c]);
    draw(&mut bytes, &mut baseline);
    let mut trackers = [(); 2].map(|()| TouchTracker::new(baseline.view(), options).unwrap());
    let mut quiet = trackers[0].clone();
    for _ in 0..20 {
        let touch = quiet.update(baseline.view(), None, false).unwrap();
        assert!(!touch.in_contact && touch.strength == 0.0, "{touch:?}");
    }
    let mut frame = baseline.clone();
    for _ in 0..=bytes.up_to(15) {
        let (what, layout) = (bytes.byte(), bytes.byte());
        if what & 1 != 0 {
            frame.assign(&baseline);
        }
        if what & 2 != 0 {
            draw(&mut bytes, &mut frame);
        }
        let dt_s = match what >> 2 & 3 {
            0 => None,
            1 => Some(0.0),
            2 => Some(f64::from(bytes.word()) / 1000.0),
            _ => Some(1e6 / (1.0 + f64::from(bytes.word()))),
        };
        let loaded = what & 16 != 0;
        for _ in 0..=what >> 5 {
            let [one, other] = &mut trackers;
            let touch = one.update(frame.view(), dt_s, loaded).unwrap();
            check(&touch, one, [height, width]);
            assert!(other.update(frame.view(), Some(f64::NAN), loaded).is_err());
            let turned = laid_out(frame.clone(), layout);
            let again = other.update(turned.view(), dt_s, loaded).unwrap();
            assert_eq!(format!("{again:?}"), format!("{touch:?}"));
            assert_eq!(one.mask(), other.mask());
        }
    }
}

/// What the numbers of any touch owe to each other.
fn check(t: &Touch, tracker: &TouchTracker, [height, width]: [usize; 2]) {
    let (mask, shape) = tracker.mask();
    assert_eq!((mask.len(), shape), (height * width, [height, width]));
    assert_eq!(mask.iter().filter(|on| **on).count(), t.eda as usize);
    let (depth_mm, [rows, cols]) = tracker.depth_map();
    assert!(depth_mm.len() == rows * cols && depth_mm.iter().all(|h| h.is_finite() && *h >= 0.0));
    assert_eq!(t.in_contact, t.eda > 0);
    assert!((0.0..=1.0).contains(&t.strength) && (0.0..=1.0).contains(&t.broad), "{t:?}");
    for value in [t.cci, t.peak, t.depth_mm, t.force_n, t.difference, t.threshold] {
        assert!(value.is_finite() && value >= 0.0, "{t:?}");
    }
    let (x, y) = t.centroid_xy;
    if t.in_contact {
        assert!((0.0..width as f64).contains(&x) && (0.0..height as f64).contains(&y), "{t:?}");
        assert!((0.0..=(height + width) as f64).contains(&t.spread), "{t:?}");
    } else {
        assert!(x.is_nan() && y.is_nan() && t.spread.is_nan() && t.cci == 0.0 && t.peak == 0.0, "{t:?}");
    }
}
