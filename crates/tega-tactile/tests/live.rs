//! The `live` reading on generated dents: a gel lit from three sides, whose picture follows its slope.

#![allow(clippy::unwrap_used)] // pictures are made here, of one size

use ndarray::{Array3, Axis, Slice, s};
use tega_error::OutOfRange;
use tega_tactile::{ContactMetrics, GelLight, LiveReader, Order, Outline, SensorNoise, TactileError};

/// Counts per unit of slope for a colour at a place, for a slope along x and along y: the light of the sensor that the reading was fitted to.
fn light(colour: usize, x: f64, y: f64) -> [f64; 2] {
    let terms = [1.0, x, y, x * x, x * y, y * y];
    GelLight::default().terms[colour]
        .map(|answers| answers.iter().zip(terms).map(|(&answer, term)| f64::from(answer) * term).sum())
}

/// A round dent: middle, radius of its steepest circle, steepest slope.
#[derive(Clone, Copy)]
struct Dent(f64, f64, f64, f64);

fn baseline(height: usize, width: usize) -> Array3<u8> {
    Array3::from_shape_fn((height, width, 3), |(y, x, c)| {
        let (y, x) = (y as f64 / height as f64, x as f64 / width as f64);
        (100.0 + 30.0 * ((x * 3.0 + c as f64).sin() + (y * 2.0 - c as f64).cos())) as u8
    })
}

/// Correlated noise of about two counts, the same for the same seed.
fn noise(height: usize, width: usize, seed: u64) -> Array3<f64> {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let mut white = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    };
    let raw = Array3::from_shape_simple_fn((height + 3, width + 3, 3), &mut white);
    let four = |a: &Array3<f64>, axis| {
        let mut sums = a.slice_axis(axis, (..-3).into()).to_owned();
        for k in 1..4 {
            let last = if k == 3 { None } else { Some(k - 3) };
            sums += &a.slice_axis(axis, Slice::new(k, last, 1));
        }
        sums
    };
    four(&four(&raw, Axis(0)), Axis(1)) * 1.9
}

fn frame(base: &Array3<u8>, dents: &[Dent], seed: u64) -> Array3<u8> {
    let (height, width, _) = base.dim();
    let noise = noise(height, width, seed);
    Array3::from_shape_fn(base.dim(), |(y, x, c)| {
        let mut value = f64::from(base[[y, x, c]]) + noise[[y, x, c]];
        for &Dent(cx, cy, radius, steepest) in dents {
            let (dx, dy) = (x as f64 - cx, y as f64 - cy);
            let r = (dx * dx + dy * dy).sqrt() / radius;
            // A slope that rises to its most at the rim and dies away outside.
            let slope = steepest * r * (0.5 * (1.0 - r * r)).exp() / (r * radius).max(1e-9);
            let place = |at: usize, of: usize| (2 * at + 1) as f64 / of as f64 - 1.0;
            let [along_x, along_y] = light(c, place(x, width), place(y, height));
            // Depth falls from the middle outwards.
            value -= slope * (along_x * dx + along_y * dy);
        }
        value.round().clamp(0.0, 255.0) as u8
    })
}

fn reader(base: &Array3<u8>, outline: Outline) -> LiveReader {
    LiveReader::new(base.view(), Order::Bgr, outline, SensorNoise::default()).unwrap()
}

fn read(frame: &Array3<u8>, base: &Array3<u8>) -> (ContactMetrics, Vec<u8>) {
    let mut reader = reader(base, Outline::Dent);
    let (metrics, mask) = reader.mask(frame.view()).unwrap();
    (metrics, mask.to_vec())
}

fn ones(mask: &[u8]) -> usize {
    mask.iter().map(|&m| usize::from(m)).sum()
}

#[test]
fn no_contact_is_no_pixels() {
    let base = baseline(240, 320);
    for seed in 1..4 {
        let (metrics, mask) = read(&frame(&base, &[], seed), &base);
        assert!(!metrics.in_contact && metrics.cci == 0.0 && metrics.peak == 0.0 && metrics.mass == 0.0);
        assert_eq!((metrics.eda, ones(&mask)), (0, 0));
    }
}

#[test]
fn a_change_of_the_whole_picture_is_no_contact() {
    let base = baseline(240, 320);
    let changes: [(f64, f64); 6] =
        [(1.0, 12.0), (1.0, -12.0), (0.71, 0.0), (0.96, 0.0), (1.2, -5.0), (0.0, 0.0)];
    for (gain, offset) in changes {
        let mut other = frame(&base, &[], 7);
        other.mapv_inplace(|v| (f64::from(v) * gain + offset).clamp(0.0, 255.0) as u8);
        assert_eq!(read(&other, &base).0.eda, 0, "gain {gain}, offset {offset}");
    }
}

#[test]
fn a_dent_is_found_where_it_is() {
    let base = baseline(320, 240);
    for (cx, cy, radius) in [(120.0, 160.0, 45.0), (70.0, 250.0, 30.0), (170.0, 60.0, 20.0)] {
        let (metrics, mask) = read(&frame(&base, &[Dent(cx, cy, radius, 0.4)], 3), &base);
        let (x, y) = metrics.centroid_xy;
        assert!((x - cx).hypot(y - cy) < 0.25 * radius, "{x} {y}, {cx} {cy}");
        // Its steepest circle and what lies within, not the whole picture.
        let ratio = (f64::from(metrics.eda) / std::f64::consts::PI).sqrt() / radius;
        assert!((1.0..2.1).contains(&ratio), "{ratio}");
        assert_eq!(metrics.eda as usize, ones(&mask));
        assert!((metrics.cci - metrics.peak / f64::from(metrics.eda).sqrt()).abs() <= 1e-9 * metrics.cci);
        // What counts begins under the dent's own height.
        assert!(0.0 < metrics.threshold && metrics.threshold < metrics.peak, "{metrics:?}");
    }
}

#[test]
fn two_dents_are_both_outlined() {
    let base = baseline(240, 320);
    let (left, right) = (Dent(80.0, 110.0, 22.0, 0.5), Dent(230.0, 140.0, 30.0, 0.4));
    let (_, both) = read(&frame(&base, &[left, right], 5), &base);
    for Dent(x, y, ..) in [left, right] {
        assert_eq!(both[y as usize * 320 + x as usize], 1, "{x} {y}");
    }
    assert!((0..240).all(|y| both[y * 320 + 150] == 0), "the gel between them is untouched");
}

#[test]
fn area_and_cci_rise_with_the_press() {
    let base = baseline(240, 320);
    let mut last = (0, 0.0);
    for step in 1..10 {
        // A ball sinks in: the rim goes out with the root of the depth, and so does its slope.
        let root = f64::from(step).sqrt();
        let (metrics, _) = read(&frame(&base, &[Dent(160.0, 120.0, 13.0 * root, 0.17 * root)], 11), &base);
        assert!(metrics.eda > last.0 && metrics.cci > last.1, "step {step}: {} {}", metrics.eda, metrics.cci);
        last = (metrics.eda, metrics.cci);
    }
}

#[test]
fn the_touching_area_is_within_the_dent() {
    let base = baseline(240, 320);
    let image = frame(&base, &[Dent(160.0, 120.0, 35.0, 0.4)], 2);
    let (outer, dent) = read(&image, &base);
    let mut reader = reader(&base, Outline::Contact);
    let (inner, contact) = reader.mask(image.view()).unwrap();
    assert!(inner.eda > 0 && f64::from(inner.eda) < 0.8 * f64::from(outer.eda));
    assert!(contact.iter().zip(dent).all(|(inner, outer)| *inner <= outer));
}

#[test]
fn resolution_changes_the_scale_alone() {
    let area = |k: usize| {
        let base = baseline(120 * k, 160 * k);
        let scale = k as f64;
        let (metrics, _) =
            read(&frame(&base, &[Dent(70.0 * scale, 60.0 * scale, 18.0 * scale, 0.4)], 4), &base);
        f64::from(metrics.eda) / (scale * scale)
    };
    let areas = [area(1), area(2), area(3), area(6)];
    for a in areas {
        assert!((a / areas[1] - 1.0).abs() < 0.03, "{areas:?}");
    }
}

#[test]
fn colour_order_does_not_matter() {
    let base = baseline(96, 128);
    let image = frame(&base, &[Dent(60.0, 40.0, 16.0, 0.4)], 9);
    let (plain, mask) = read(&image, &base);
    assert!(plain.in_contact);
    let turned = base.slice(s![.., .., ..;-1]);
    let mut reader = LiveReader::new(turned, Order::Rgb, Outline::Dent, SensorNoise::default()).unwrap();
    assert_eq!(reader.mask(image.slice(s![.., .., ..;-1])).unwrap(), (plain, &mask[..]));
}

#[test]
fn noise_is_what_differences_are_weighed_by() {
    let base = baseline(240, 320);
    let image = frame(&base, &[Dent(160.0, 120.0, 35.0, 0.08)], 2);
    let of = |counts: f64| {
        let noise = SensorNoise::of_counts([counts; 3]).unwrap();
        LiveReader::new(base.view(), Order::Bgr, Outline::Dent, noise).unwrap().read(image.view()).unwrap()
    };
    assert!(of(1.0).in_contact);
    assert!(!of(200.0).in_contact);
    // No noise at all is not believed: the least that is.
    assert_eq!(format!("{:?}", of(0.0)), format!("{:?}", of(0.01)));
    for wrong in [-1.0, f64::NAN, f64::INFINITY, 256.0] {
        assert!(matches!(
            SensorNoise::of_counts([1.0, wrong, 1.0]),
            Err(TactileError::OutOfRange(OutOfRange { name: "noise", .. }))
        ));
    }
}

#[test]
fn every_size_from_one_pixel_on_is_read() {
    for (height, width) in [
        (1, 1),
        (1, 4),
        (2, 1),
        (3, 3),
        (1, 700),
        (700, 1),
        (8, 8),
        (47, 53),
        (120, 160),
        (320, 240),
        (720, 960),
    ] {
        let base = baseline(height, width);
        let mut other = base.clone();
        other.mapv_inplace(|v| v.wrapping_mul(7) ^ 0x55);
        let mut reader = reader(&base, Outline::Dent);
        assert!(!reader.read(base.view()).unwrap().in_contact);
        let (metrics, mask) = reader.mask(other.view()).unwrap();
        assert_eq!((mask.len(), ones(mask)), (height * width, metrics.eda as usize));
        let map: Vec<f32> = reader.pressure_map().collect();
        assert!(map.len() == height * width && map.iter().all(|v| v.is_finite() && *v >= 0.0));
        // Whatever 4 x 4 pairs of cells cannot show, and one pixel cannot, is no contact.
        assert!(height.min(width) >= 8 || !metrics.in_contact, "{height}x{width}");
    }
}

#[test]
fn a_frame_of_another_size_is_refused_and_changes_nothing() {
    let base = baseline(240, 320);
    let image = frame(&base, &[Dent(160.0, 120.0, 35.0, 0.4)], 2);
    let mut reader = reader(&base, Outline::Dent);
    let first = reader.read(image.view()).unwrap();
    let turned = baseline(320, 240);
    assert!(matches!(reader.read(turned.view()), Err(TactileError::ShapeMismatch { frame_h: 320, .. })));
    let grey = Array3::<u8>::zeros((240, 320, 1));
    assert!(matches!(reader.read(grey.view()), Err(TactileError::Channels { channels: 1, .. })));
    assert_eq!(reader.read(image.view()).unwrap(), first);
}
