//! The tracker on frames that are missing, late, black or of any size.

#![allow(clippy::unwrap_used)]

use ndarray::{Array3, s};
use tega_tactile::{SensorNoise, TouchTracker, TrackerOptions};

use crate::slopes::{Drift, Finger, Random, update};
use crate::tracker::{checked, followed, press, tracker};

#[test]
fn dropped_frames_lose_no_contact_and_make_none() {
    let mut finger = Finger::new(23, 120, 160);
    let mut tracker = tracker(&finger.still(), 60.0);
    let mut random = Random(5);
    let mut t_s = 0.0;
    while t_s < 6.0 {
        let dt_s = f64::from(random.between(1.0, 20.0).floor()) / 60.0;
        t_s += dt_s;
        let pressed = (2.0..4.0).contains(&t_s);
        let frame = finger.frame(pressed.then(|| press(0.5, 0.5)), Drift::default());
        let touch = tracker.update(frame.view(), Some(dt_s), false).unwrap();
        checked(&touch, &tracker);
        let settled = (2.4..4.0).contains(&t_s) || !(2.0..4.4).contains(&t_s);
        assert!(!settled || touch.in_contact == pressed, "{t_s} s: {touch:?}");
    }
}

#[test]
fn a_gap_of_no_time_or_of_days_is_survived() {
    let mut finger = Finger::new(29, 120, 160);
    let mut tracker = tracker(&finger.still(), 60.0);
    for dt_s in [0.0, 1e6, 1e-9, 0.0, 1e6] {
        for pressed in [false, true, false] {
            let frame = finger.frame(pressed.then(|| press(0.5, 0.5)), Drift::default());
            let touch = tracker.update(frame.view(), Some(dt_s), false).unwrap();
            checked(&touch, &tracker);
        }
    }
}

#[test]
fn black_and_saturated_pictures_and_a_stuck_pixel_are_read() {
    let (black, white) = (Array3::<u8>::zeros((120, 160, 3)), Array3::from_elem((120, 160, 3), 255u8));
    let mut finger = Finger::new(31, 120, 160);
    let still = finger.still();
    for baseline in [&black, &white, &still] {
        for noise in [SensorNoise::default(), SensorNoise::of_counts([0.0; 3]).unwrap()] {
            let options = TrackerOptions { noise, ..TrackerOptions::default() };
            let mut tracker = TouchTracker::new(baseline.view(), options).unwrap();
            for frame in [baseline, &black, &white, &still, baseline] {
                for _ in 0..30 {
                    followed(&mut tracker, frame);
                }
            }
        }
    }
    // Lights that fail, or shine into the camera, are no contact of an even gel.
    let grey = Array3::from_elem((120, 160, 3), 90u8);
    let mut even = tracker(&grey, 60.0);
    for frame in [&black, &white, &grey] {
        for _ in 0..30 {
            assert!(!update(&mut even, frame).in_contact);
        }
    }
    for (height, width) in [(320, 240), (120, 160)] {
        let mut finger = Finger::new(31, height, width);
        for stuck in [255, 0] {
            let mut even = tracker(&finger.still(), 60.0);
            for k in 0..60 {
                let mut frame = finger.still();
                frame.slice_mut(s![50, 70, ..]).fill(stuck);
                let touch = update(&mut even, &frame);
                assert!(!touch.in_contact, "a pixel of {stuck}, frame {k}: {touch:?}");
            }
        }
    }
}

#[test]
fn every_size_from_one_pixel_on_is_tracked() {
    for (height, width) in [(1, 1), (1, 9), (700, 1), (7, 7), (8, 8), (47, 53), (120, 160), (960, 720)] {
        let gel =
            Array3::from_shape_fn((height, width, 3), |(y, x, c)| (60 + (y + 2 * x) % 50 + 20 * c) as u8);
        let other = gel.mapv(|v| v.wrapping_mul(5) ^ 0x3c);
        let mut tracker = tracker(&gel, 60.0);
        for frame in [&gel, &gel, &gel, &other, &other, &gel, &gel] {
            let touch = followed(&mut tracker, frame);
            assert!(height.min(width) >= 8 || !touch.in_contact, "{height}x{width}");
        }
    }
}

#[test]
fn a_press_is_felt_and_let_go_at_every_size_of_a_camera() {
    for (height, width) in
        [(120, 160), (160, 120), (240, 320), (320, 240), (480, 640), (720, 960), (960, 720)]
    {
        let mut finger = Finger::new(47, height, width);
        let mut tracker = tracker(&finger.still(), 30.0);
        let mut told = Vec::new();
        for k in 0..18 {
            let frame = finger.frame((4..10).contains(&k).then(|| press(0.5, 0.5)), Drift::default());
            told.push(followed(&mut tracker, &frame).in_contact);
        }
        assert!(told[..4].iter().all(|on| !on), "{height}x{width}: before, {told:?}");
        assert!(told[6..10].iter().all(|on| *on), "{height}x{width}: pressed, {told:?}");
        assert!(told[14..].iter().all(|on| !on), "{height}x{width}: after, {told:?}");
    }
}
