//! The baseline of generated recordings: what a camera and a hand do to one.

use ndarray::{Array3, ArrayView3};
use tega_tactile::{BaselineSource, BaselineSurvey, TactileError, estimate_baseline, median_image};

const SIZE: (usize, usize, usize) = (96, 128, 3);

fn still(seed: usize) -> Array3<u8> {
    Array3::from_shape_fn(SIZE, |(y, x, c)| {
        let noise = (seed * 7919 + y * 104_729 + x * 1_299_709 + c * 15_485_863) % 5;
        (90 + (y / 4 + x / 8) % 40 + noise) as u8
    })
}

/// A square pressed in: its left half lit, its right half dark.
fn pressed(seed: usize, top: usize, left: usize) -> Array3<u8> {
    let mut frame = still(seed);
    for ((y, x, _), value) in frame.indexed_iter_mut() {
        if (top..top + 30).contains(&y) && (left..left + 40).contains(&x) {
            *value = if x < left + 20 { *value + 40 } else { *value - 40 };
        }
    }
    frame
}

fn views(frames: &[Array3<u8>]) -> Vec<ArrayView3<'_, u8>> {
    frames.iter().map(|frame| frame.view()).collect()
}

fn error(image: &Array3<u8>) -> f64 {
    let truth = still(0);
    let sum: u64 = image.iter().zip(&truth).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    sum as f64 / truth.len() as f64
}

#[test]
fn dark_and_stale_first_frames_are_passed_over() {
    let mut frames =
        vec![still(1).mapv(|v| (f64::from(v) * 0.71) as u8), still(2).mapv(|v| (f64::from(v) * 0.96) as u8)];
    frames.extend((0..10).map(|i| pressed(i, 10, 20)));
    frames.extend((0..9).map(still));
    frames.extend((0..60).map(|i| pressed(i, 40, 60)));
    let baseline = estimate_baseline(&views(&frames)).unwrap();
    assert_eq!(baseline.choice.source, BaselineSource::QuietFrames);
    assert_eq!(baseline.choice.frames, (12..21).collect::<Vec<_>>());
    assert!(error(&baseline.image) < 1.5);
}

#[test]
fn a_recording_may_begin_in_contact_that_lasts() {
    let mut frames: Vec<_> = (0..80).map(|i| pressed(i, 30, 40)).collect();
    frames.extend((0..12).map(still));
    let baseline = estimate_baseline(&views(&frames)).unwrap();
    assert!(baseline.choice.frames.iter().all(|&i| i >= 80), "{:?}", baseline.choice);
}

#[test]
fn a_contact_that_is_always_somewhere_is_taken_out_by_the_median() {
    let frames: Vec<_> = (0..12).map(|i| pressed(i, 5 + 20 * (i % 4), 5 + 28 * (i % 3))).collect();
    let baseline = estimate_baseline(&views(&frames)).unwrap();
    assert_eq!(baseline.choice.source, BaselineSource::MovingContact);
    assert_eq!(baseline.choice.frames.len(), 12);
    assert!(error(&baseline.image) < 2.0, "{}", error(&baseline.image));
}

#[test]
fn few_frames_are_no_trouble() {
    let one = [still(3)];
    assert_eq!(estimate_baseline(&views(&one)).unwrap().image, one[0]);
    let two = [pressed(1, 20, 20), still(2)];
    assert_eq!(estimate_baseline(&views(&two)).unwrap().choice.frames, [1]);
    assert_eq!(estimate_baseline(&[]), Err(TactileError::NoFrames));
    assert_eq!(BaselineSurvey::default().choose(), Err(TactileError::NoFrames));
}

#[test]
fn frames_of_another_size_are_refused() {
    let frames = [still(0), Array3::zeros((96, 120, 3))];
    assert!(matches!(estimate_baseline(&views(&frames)), Err(TactileError::Mixed { .. })));
    assert!(matches!(median_image(&views(&frames)), Err(TactileError::Mixed { .. })));
}

#[test]
fn the_median_leaves_no_channel_out() {
    for channels in [(3, 1), (1, 3), (3, 4)] {
        let frames = [Array3::<u8>::zeros((2, 3, channels.0)), Array3::zeros((2, 3, channels.1))];
        let wanted = TactileError::Channels { name: "frame", channels: channels.0 + channels.1 - 3 };
        assert_eq!(median_image(&views(&frames)), Err(wanted));
    }
}

#[test]
fn the_median_is_that_of_each_pixel() {
    let frames: Vec<_> = [10, 255, 13, 12].map(|v| Array3::<u8>::from_elem((2, 3, 3), v)).into();
    assert_eq!(median_image(&views(&frames)).unwrap(), Array3::from_elem((2, 3, 3), 13));
    assert_eq!(median_image(&views(&frames[..3])).unwrap(), Array3::from_elem((2, 3, 3), 13));
}
