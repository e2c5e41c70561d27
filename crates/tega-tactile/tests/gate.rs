//! The contact gate of the `live` reading: it sees the picture only as some 1,200 cells, and yet never says "no
//! contact" to a press of the smallest area that the reading promises to find, nor "contact" to what a camera and its
//! lights do by themselves.
//!
//! The promise, in pixels of a picture of 240 x 320 (lengths go with the diagonal): a ball that touches the gel over a
//! disc of 10 pixels in radius, 314 pixels or 0.4 % of the picture, with a slope of 0.122 at the rim, that is with a
//! radius of at most 82.2 pixels, wherever in the picture its middle is. A DIGIT shows 18.68 pixels a millimetre: there
//! this is a ball of 4.4 mm touching over 1.1 mm. Of 150 such presses none was missed in the middle from 6 pixels on,
//! about half at 5, all at 4; with their middle anywhere, borders and corners included, 5 at 7 pixels and 22 at 6.

#![allow(clippy::unwrap_used)]

use ndarray::Array3;
use proptest::prelude::*;
use tega_tactile::{ContactMetrics, LiveScratch, Order, Outline, Pair, SensorNoise, read_live};

use crate::slopes::{Drift, Gel, Press, Random};

const SMALLEST_RADIUS: f32 = 10.0;
const FLATTEST_BALL: f32 = 82.2;
/// Height and width; the first three share their cells with the cameras' pictures, the last cuts cells at its border.
const SIZES: [(usize, usize); 4] = [(240, 320), (320, 240), (120, 160), (213, 301)];

fn read(frame: &Array3<u8>, baseline: &Array3<u8>, outline: Outline) -> ContactMetrics {
    let pair = Pair::new(frame.view(), baseline.view()).unwrap();
    read_live(&pair, Order::Bgr, outline, SensorNoise::default(), &mut LiveScratch::default()).unwrap()
}

/// Up to `step` counts everywhere, up to three more from one side of the picture to the other.
fn drift(random: &mut Random, step: f32) -> Drift {
    let mut three = |most: f32| [(); 3].map(|()| random.between(-most, most));
    Drift { step: three(step), across: three(3.0), down: three(3.0) }
}

/// A baseline of one gel and a frame of it.
fn scene(seed: u64, size: usize, step: f32, press: Option<Press>) -> (Array3<u8>, Array3<u8>) {
    let mut random = Random(seed);
    let (height, width) = SIZES[size];
    let gel = Gel::any(&mut random, height, width);
    let baseline = gel.frame(&mut random, None, Drift::default());
    let drift = drift(&mut random, step);
    (gel.frame(&mut random, press, drift), baseline)
}

/// Anywhere in the picture, every third time on its border. In a corner a small press may lie in one cell, as a stuck
/// pixel does.
fn anywhere() -> impl Strategy<Value = [f32; 2]> {
    let border = || prop_oneof![Just(0_f32), Just(1.0)];
    prop_oneof![
        4 => (0.1_f32..=0.9, 0.1_f32..=0.9),
        1 => (border(), 0.1_f32..=0.9),
        1 => (0.1_f32..=0.9, border()),
    ]
    .prop_map(|(x, y)| [x, y])
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    #[test]
    fn a_press_of_the_smallest_area_is_contact(
        seed: u64, size in 0..SIZES.len(), centre in anywhere(), step in prop_oneof![Just(3_f32), Just(30.0)]
    ) {
        let press = Press { centre, contact_radius: SMALLEST_RADIUS, ball_radius: FLATTEST_BALL };
        let (frame, baseline) = scene(seed, size, step, Some(press));
        let metrics = read(&frame, &baseline, Outline::Dent);
        prop_assert!(metrics.in_contact && metrics.eda > 0, "{metrics:?}");
    }

    #[test]
    fn a_larger_or_steeper_press_is_contact(
        seed: u64, size in 0..SIZES.len(), centre in anywhere(), deeper in 0_f32..1.0, rounder in 0_f32..1.0
    ) {
        let contact_radius = SMALLEST_RADIUS + deeper * (100.0 - SMALLEST_RADIUS);
        let least = contact_radius.min(FLATTEST_BALL);
        let press = Press { centre, contact_radius, ball_radius: least + rounder * (FLATTEST_BALL - least) };
        let (frame, baseline) = scene(seed, size, 3.0, Some(press));
        let metrics = read(&frame, &baseline, Outline::Contact);
        prop_assert!(metrics.in_contact && metrics.eda > 0, "{press:?} {metrics:?}");
    }

    #[test]
    fn noise_and_colour_are_no_contact(
        seed: u64, size in 0..SIZES.len(), step in prop_oneof![Just(0_f32), Just(5.0), Just(30.0)]
    ) {
        let (frame, baseline) = scene(seed, size, step, None);
        // Where a channel is at its end a step of light stops short: that is no change of light, and reads as one patch.
        prop_assume!(frame.iter().all(|value| (1..255).contains(value)));
        for outline in [Outline::Dent, Outline::Contact] {
            let metrics = read(&frame, &baseline, outline);
            prop_assert!(!metrics.in_contact && metrics.eda == 0 && metrics.cci == 0.0, "{metrics:?}");
        }
    }
}

/// How near the border of the promise is: a disc of less than half the radius does drown.
#[test]
fn a_press_of_a_sixth_of_the_smallest_area_is_not_promised() {
    let press =
        Press { centre: [0.5, 0.5], contact_radius: SMALLEST_RADIUS / 2.5, ball_radius: FLATTEST_BALL };
    let found = (0..20).filter(|seed| {
        let (frame, baseline) = scene(*seed, 0, 3.0, Some(press));
        read(&frame, &baseline, Outline::Dent).in_contact
    });
    assert_eq!(found.count(), 0);
}
