//! A faint hold is read steadily, and nothing is read later for it: first frame, release, a firm press, a dent that moves.

#![allow(clippy::unwrap_used)]

use proptest::prelude::*;
use tega_tactile::{Touch, TouchTracker};

use crate::slopes::{Drift, Finger, Press, update};

const RATE_HZ: f64 = 60.0;
const FIRM: f32 = 82.0;

struct Rested {
    finger: Finger,
    tracker: TouchTracker,
}

impl Rested {
    /// A fingertip that has rested for half a second.
    fn new(seed: u64) -> Self {
        let mut finger = Finger::new(seed, 160, 120);
        let tracker = finger.tracker(RATE_HZ, 20);
        let mut rested = Self { finger, tracker };
        for _ in 0..30 {
            assert!(!rested.update(None).in_contact);
        }
        rested
    }

    fn update(&mut self, press: Option<Press>) -> Touch {
        update(&mut self.tracker, &self.finger.frame(press, Drift::default()))
    }
}

fn press(ball_radius: f32) -> Press {
    Press { centre: [0.45, 0.5], contact_radius: 40.0, ball_radius }
}

/// Mean, standard deviation over it, and largest step over it.
fn scatter(values: &[f64]) -> [f64; 3] {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let deviation = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
    let step = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max);
    [mean, deviation / mean, step / mean]
}

#[test]
fn a_faint_hold_is_reported_at_once_scatters_little_and_ends_at_once() {
    for seed in 0..6 {
        let mut finger = Rested::new(seed);
        let held: Vec<Touch> = (0..150).map(|_| finger.update(Some(press(700.0)))).collect();
        assert!(held[1].in_contact && held.iter().skip(1).all(|touch| touch.in_contact), "{seed}");
        // It is a faint one.
        assert!(held.iter().all(|touch| touch.difference < 6.0 * touch.threshold), "{seed}: {:?}", held[60]);
        let steady = &held[30..];
        let of = |value: &dyn Fn(&Touch) -> f64| scatter(&steady.iter().map(value).collect::<Vec<_>>());
        let [_, area, step] = of(&|touch| f64::from(touch.eda));
        assert!(area <= 0.04 && step <= 0.15, "{seed}: {area} {step}");
        let [_, depth, _] = of(&|touch| touch.depth_mm);
        assert!(depth <= 0.04, "{seed}: depth {depth}");
        let after: Vec<bool> = (0..30).map(|_| finger.update(None).in_contact).collect();
        assert!(after[6..].iter().all(|on| !on), "{seed}: {after:?}");
    }
}

#[test]
fn a_firm_press_and_one_that_moves_are_read_picture_by_picture() {
    for seed in 0..4 {
        // What a tracker reads that knows of no earlier picture of the press.
        let alone = |press| Rested::new(seed).update(Some(press));
        // From nothing to firm within a tenth of a second.
        let mut finger = Rested::new(seed);
        for k in 1..=6 {
            finger.update(Some(press(6.0 * FIRM / k as f32)));
        }
        let (firm, wanted) = (finger.update(Some(press(FIRM))), alone(press(FIRM)));
        // The peak scatters least.
        assert!((firm.peak / wanted.peak - 1.0).abs() < 0.05, "{seed}: {firm:?} {wanted:?}");
        // A light hold for a second that then moves by a sixth of the picture.
        for _ in 0..60 {
            finger.update(Some(press(250.0)));
        }
        let moved = Press { centre: [0.6, 0.5], ..press(250.0) };
        let (now, wanted) = (finger.update(Some(moved)), alone(moved));
        let off = (now.centroid_xy.0 - wanted.centroid_xy.0).hypot(now.centroid_xy.1 - wanted.centroid_xy.1);
        assert!(off < 3.0, "{seed}: {off} px");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(8))]

    /// A faint hold that is cut anywhere and goes on with a copy reads the same, whatever the distances in time.
    #[test]
    fn a_faint_hold_that_is_cut_anywhere_reads_the_same(
        seed in 0u64..1000, cut in 0usize..30, ball_radius in 150f32..900.0, gaps in prop::collection::vec(0f64..0.3, 30)
    ) {
        let mut finger = Rested::new(seed);
        let mut other = None;
        for (k, gap_s) in gaps.into_iter().enumerate() {
            if k == cut {
                other = Some(finger.tracker.clone());
            }
            let frame = finger.finger.frame(Some(press(ball_radius)), Drift::default());
            let touch = finger.tracker.update(frame.view(), Some(gap_s), false).unwrap();
            prop_assert_eq!(touch.in_contact, touch.eda > 0);
            if let Some(other) = &mut other {
                let again = other.update(frame.view(), Some(gap_s), false).unwrap();
                prop_assert_eq!(format!("{touch:?}"), format!("{again:?}"));
                prop_assert_eq!(finger.tracker.mask(), other.mask());
                prop_assert_eq!(finger.tracker.depth_map(), other.depth_map());
            }
        }
    }
}
