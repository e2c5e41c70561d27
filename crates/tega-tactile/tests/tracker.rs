//! The tracker on a made gel: silent on what cameras and lights do, there for a press anywhere, the same at every rate and in every layout.

#![allow(clippy::unwrap_used)]

use ndarray::{Array3, Axis, s};
use tega_tactile::{Order, Outline, Touch, TouchTracker, TrackerOptions};

use crate::slopes::{Drift, Finger, Press, update};

const RATES_HZ: [f64; 5] = [5.0, 15.0, 30.0, 60.0, 120.0];

pub fn press(x: f32, y: f32) -> Press {
    Press { centre: [x, y], contact_radius: 30.0, ball_radius: 82.0 }
}

pub fn tracker(baseline: &Array3<u8>, rate_hz: f64) -> TouchTracker {
    TouchTracker::new(baseline.view(), TrackerOptions { rate_hz, ..TrackerOptions::default() }).unwrap()
}

/// What the numbers of any touch owe to each other.
pub fn checked(touch: &Touch, tracker: &TouchTracker) {
    let (mask, [height, width]) = tracker.mask();
    let (depth_mm, [rows, cols]) = tracker.depth_map();
    assert_eq!(mask.len(), height * width);
    assert_eq!(depth_mm.len(), rows * cols);
    assert!(depth_mm.iter().all(|h| h.is_finite() && *h >= 0.0));
    assert_eq!(mask.iter().filter(|on| **on).count(), touch.eda as usize);
    assert_eq!(touch.in_contact, touch.eda > 0);
    assert!((0.0..=1.0).contains(&touch.strength), "{touch:?}");
    assert!((0.0..=1.0).contains(&touch.broad), "{touch:?}");
    for value in [touch.cci, touch.peak, touch.depth_mm, touch.force_n, touch.difference, touch.threshold] {
        assert!(value.is_finite() && value >= 0.0, "{touch:?}");
    }
    let (x, y) = touch.centroid_xy;
    if touch.in_contact {
        assert!((0.0..width as f64).contains(&x) && (0.0..height as f64).contains(&y), "{touch:?}");
        assert!(touch.spread >= 0.0 && touch.spread <= (height + width) as f64, "{touch:?}");
        assert!(touch.cci > 0.0 && touch.peak > 0.0, "{touch:?}");
    } else {
        assert!(x.is_nan() && y.is_nan() && touch.spread.is_nan(), "{touch:?}");
        assert_eq!((touch.cci, touch.peak, touch.broad), (0.0, 0.0, 0.0));
        assert!(depth_mm.iter().all(|h| *h == 0.0));
    }
}

/// Gives a tracker the next frame, and checks what it reports.
pub fn followed(tracker: &mut TouchTracker, frame: &Array3<u8>) -> Touch {
    let touch = update(tracker, frame);
    checked(&touch, tracker);
    touch
}

fn read(tracker: &mut TouchTracker, frames: &[Array3<u8>]) -> Vec<Touch> {
    frames.iter().map(|frame| update(tracker, frame)).collect()
}

fn bits(touches: &[Touch]) -> String {
    format!("{touches:?}")
}

#[test]
fn its_own_baseline_is_no_contact_for_thousands_of_frames() {
    let baseline = Finger::new(1, 96, 128).still();
    let mut tracker = tracker(&baseline, 60.0);
    for _ in 0..2000 {
        let touch = update(&mut tracker, &baseline);
        assert!(!touch.in_contact && touch.strength == 0.0, "{touch:?}");
        assert!(touch.difference < 0.01, "{touch:?}");
    }
}

#[test]
fn noise_is_no_contact_at_any_rate() {
    for (seed, rate_hz) in RATES_HZ.into_iter().enumerate() {
        let mut finger = Finger::new(seed as u64, 120, 160);
        let mut tracker = tracker(&finger.still(), rate_hz);
        for k in 0..300 {
            let touch = followed(&mut tracker, &finger.still());
            assert!(!touch.in_contact, "{rate_hz} Hz, frame {k}: {touch:?}");
        }
    }
}

#[test]
fn light_that_steps_or_drifts_is_no_contact() {
    for step in [10.0, -10.0, 20.0, 30.0, -30.0] {
        let mut finger = Finger::new(7, 120, 160);
        let mut tracker = tracker(&finger.still(), 60.0);
        let drift = Drift { step: [step, -0.7 * step, 0.5 * step], ..Drift::default() };
        for k in 0..120 {
            let frame = finger.frame(None, if k < 30 { Drift::default() } else { drift });
            let touch = update(&mut tracker, &frame);
            assert!(!touch.in_contact, "step {step}, frame {k}: {touch:?}");
        }
    }
    let mut finger = Finger::new(8, 120, 160);
    let mut tracker = tracker(&finger.still(), 60.0);
    for k in 0..300 {
        let share = 0.04 * k as f32;
        let drift = Drift { step: [share; 3], across: [share, -share, 0.0], down: [0.0, share, -share] };
        let touch = update(&mut tracker, &finger.frame(None, drift));
        assert!(!touch.in_contact, "frame {k}: {touch:?}");
    }
}

#[test]
fn a_gain_is_no_contact() {
    for gain in [0.7f32, 0.85, 0.95, 1.05, 1.2] {
        let mut finger = Finger::new(9, 120, 160);
        let mut tracker = tracker(&finger.still(), 60.0);
        for k in 0..90 {
            let mut frame = finger.still();
            if k >= 30 {
                frame.mapv_inplace(|v| (f32::from(v) * gain).round().clamp(0.0, 255.0) as u8);
            }
            let touch = update(&mut tracker, &frame);
            assert!(!touch.in_contact, "gain {gain}, frame {k}: {touch:?}");
        }
    }
}

#[test]
fn a_press_is_found_in_the_middle_on_borders_and_in_corners() {
    const SHARES: [f32; 3] = [0.0, 0.5, 1.0];
    for (height, width) in [(120, 160), (320, 240)] {
        for (x, y) in SHARES.into_iter().flat_map(|x| SHARES.map(|y| (x, y))) {
            let mut finger = Finger::new(11, height, width);
            let mut tracker = tracker(&finger.still(), 60.0);
            for _ in 0..20 {
                assert!(!update(&mut tracker, &finger.still()).in_contact);
            }
            let mut pressed = || followed(&mut tracker, &finger.frame(Some(press(x, y)), Drift::default()));
            for _ in 0..9 {
                pressed();
            }
            let touch = pressed();
            assert!(touch.in_contact, "{height}x{width} {x} {y}: {touch:?}");
            let (wanted_x, wanted_y) = (f64::from(x) * width as f64, f64::from(y) * height as f64);
            // The lights of this gel are not those that depth is read with, and of a corner a quarter is seen.
            let off = (touch.centroid_xy.0 - wanted_x).hypot(touch.centroid_xy.1 - wanted_y);
            let most = if x == 0.5 && y == 0.5 { 0.1 } else { 0.2 };
            let diagonal = (height as f64).hypot(width as f64);
            assert!(off < most * diagonal, "{height}x{width} {x} {y}: {touch:?}");
        }
    }
}

/// A press, a hold and a release to what the gel keeps, then rest.
fn session(finger: &mut Finger, rate_hz: f64) -> Vec<Array3<u8>> {
    let frames = |seconds: f64| (seconds * rate_hz).round().max(1.0) as usize;
    let mut all = Vec::new();
    for _ in 0..frames(1.0).max(10) {
        all.push(finger.still());
    }
    for _ in 0..frames(1.0) {
        all.push(finger.frame(Some(press(0.4, 0.6)), Drift::default()));
    }
    // What a gel keeps sinks; what stays as it is would be a light hold.
    for k in 0..frames(2.0) {
        let sunk = (k as f64 / rate_hz).min(1.0) as f32;
        let left = Press { ball_radius: 700.0 * (1.0 + sunk), ..press(0.4, 0.6) };
        all.push(finger.frame(Some(left), Drift::default()));
    }
    all
}

#[test]
fn a_leftover_is_silent_and_the_next_press_is_felt_at_any_rate() {
    for rate_hz in RATES_HZ {
        let mut finger = Finger::new(13, 120, 160);
        let mut tracker = tracker(&finger.still(), rate_hz);
        for round in 0..2 {
            let frames = session(&mut finger, rate_hz);
            let touches: Vec<Touch> = frames.iter().map(|frame| followed(&mut tracker, frame)).collect();
            let one = rate_hz as usize;
            let first = one.max(10);
            // The first second shows what the round before left behind.
            assert!(round > 0 || touches[..first].iter().all(|t| !t.in_contact), "{rate_hz}");
            assert!(
                touches[first + one / 4 + 1..first + one].iter().all(|t| t.in_contact),
                "{rate_hz} {round}"
            );
            let over = first + one + one / 2 + 2;
            let shown = touches[over..].iter().filter(|t| t.in_contact || t.strength > 0.5).count();
            assert_eq!(shown, 0, "{rate_hz} Hz, round {round}");
        }
    }
}

#[test]
fn two_trackers_fed_the_same_give_the_same_bits() {
    let mut finger = Finger::new(17, 120, 160);
    let baseline = finger.still();
    let frames = session(&mut finger, 30.0);
    let run = |dt_s: Option<f64>| -> Vec<Touch> {
        let mut tracker = tracker(&baseline, 30.0);
        frames.iter().map(|frame| tracker.update(frame.view(), dt_s, false).unwrap()).collect()
    };
    assert!(run(None).iter().any(|t| t.in_contact));
    assert_eq!(bits(&run(None)), bits(&run(None)));
    assert_eq!(bits(&run(None)), bits(&run(Some(1.0 / 30.0))));
}

#[test]
fn colour_order_does_not_matter() {
    let mut finger = Finger::new(19, 120, 160);
    let baseline = finger.still();
    let frames = session(&mut finger, 15.0);
    let wanted = read(&mut tracker(&baseline, 15.0), &frames);
    let options = TrackerOptions { rate_hz: 15.0, order: Order::Rgb, ..TrackerOptions::default() };
    let mut swapped = TouchTracker::new(baseline.slice(s![.., .., ..;-1]), options).unwrap();
    let got: Vec<Touch> =
        frames.iter().map(|f| swapped.update(f.slice(s![.., .., ..;-1]), None, false).unwrap()).collect();
    assert_eq!(bits(&wanted), bits(&got));
}

#[test]
fn an_error_leaves_the_tracker_as_it_was() {
    let mut finger = Finger::new(37, 120, 160);
    let baseline = finger.still();
    let frames = session(&mut finger, 15.0);
    let (mut plain, mut disturbed) = (tracker(&baseline, 15.0), tracker(&baseline, 15.0));
    let turned = Array3::<u8>::zeros((160, 120, 3));
    let grey = Array3::<u8>::zeros((120, 160, 1));
    for frame in &frames {
        let wanted = update(&mut plain, frame);
        let refused = |tracker: &mut TouchTracker, frame: &Array3<u8>, dt_s| {
            tracker.update(frame.view(), dt_s, false).unwrap_err().to_string()
        };
        assert!(refused(&mut disturbed, &turned, None).contains("frame is 160x120"));
        assert!(refused(&mut disturbed, &grey, None).contains("1 channels per pixel"));
        for dt_s in [-1e-9, f64::NAN, f64::INFINITY, 1.1e6] {
            assert!(refused(&mut disturbed, frame, Some(dt_s)).starts_with("dt_s = "));
        }
        assert_eq!(bits(&[update(&mut disturbed, frame)]), bits(&[wanted]));
        assert_eq!(disturbed.mask(), plain.mask());
        assert!(disturbed.update(turned.view(), None, false).is_err());
        assert_eq!((disturbed.mask(), disturbed.depth_map()), (plain.mask(), plain.depth_map()));
    }
    for rate_hz in [0.0, -1.0, 1001.0, f64::NAN] {
        let options = TrackerOptions { rate_hz, ..TrackerOptions::default() };
        let error = TouchTracker::new(baseline.view(), options).unwrap_err();
        assert!(error.to_string().starts_with("rate_hz = "), "{error}");
    }
    let flat = baseline.index_axis(Axis(0), 0).insert_axis(Axis(0)).to_owned();
    assert!(TouchTracker::new(flat.slice(s![0..0, .., ..]), TrackerOptions::default()).is_err());
}

#[test]
fn a_loaded_hand_takes_no_rest_anew() {
    let mut finger = Finger::new(41, 120, 160);
    let baseline = finger.still();
    let frames = session(&mut finger, 30.0);
    let differs = |loaded: bool| {
        let mut tracker = tracker(&baseline, 30.0);
        let update = |frame: &Array3<u8>| tracker.update(frame.view(), None, loaded).unwrap().difference;
        frames.iter().map(update).fold(0.0, |_, newest| newest)
    };
    // What is left of the press stays a difference while another finger holds on.
    assert!(differs(true) > 1.5 * differs(false), "{} {}", differs(true), differs(false));
}

#[test]
fn the_touching_area_is_within_the_dent() {
    let mut finger = Finger::new(43, 240, 320);
    let baseline = finger.still();
    let frames = session(&mut finger, 15.0);
    let with = |outline| {
        let options = TrackerOptions { rate_hz: 15.0, outline, ..TrackerOptions::default() };
        TouchTracker::new(baseline.view(), options).unwrap()
    };
    let (mut dent, mut contact) = (with(Outline::Dent), with(Outline::Contact));
    let mut compared = 0;
    for frame in &frames {
        let outer = update(&mut dent, frame);
        let inner = update(&mut contact, frame);
        assert_eq!(outer.difference.to_bits(), inner.difference.to_bits());
        if outer.in_contact {
            compared += 1;
            assert!(0 < inner.eda && inner.eda < outer.eda);
            assert!(contact.mask().0.iter().zip(dent.mask().0).all(|(inner, outer)| *inner <= outer));
        }
    }
    assert!(compared > 5);
}
