//! The `live` reading on generated dents: a gel lit from three sides, whose picture follows its slope.

use ndarray::{Array3, ArrayView3, s};
use proptest::prelude::*;
use tega_tactile::{LiveScratch, Order, Outline, Pair, read_live};

/// Counts per unit of slope, blue, green, red, for a slope along x and along y: lights 120 degrees apart.
const LIGHTS: [[f64; 2]; 3] = [[0.0, -150.0], [100.0, 60.0], [-130.0, 75.0]];

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
    let size = (height, width, 3);
    Array3::from_shape_fn(size, |(y, x, c)| raw.slice(s![y..y + 4, x..x + 4, c]).sum() * 1.9)
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
            value += slope * (LIGHTS[c][0] * dx + LIGHTS[c][1] * dy);
        }
        value.round().clamp(0.0, 255.0) as u8
    })
}

#[allow(clippy::unwrap_used)] // both are made here, of one size
fn read(frame: &Array3<u8>, base: &Array3<u8>) -> (tega_tactile::ContactMetrics, LiveScratch) {
    let mut scratch = LiveScratch::default();
    let pair = Pair::new(frame.view(), base.view()).unwrap();
    (read_live(&pair, Order::Bgr, Outline::Dent, &mut scratch), scratch)
}

#[test]
fn no_contact_is_no_pixels() {
    let base = baseline(240, 320);
    for seed in 1..6 {
        let (metrics, scratch) = read(&frame(&base, &[], seed), &base);
        assert_eq!(metrics.eda, 0);
        assert!(!metrics.in_contact && metrics.cci == 0.0 && metrics.peak == 0.0);
        assert!(scratch.mask().iter().all(|&m| m == 0) && scratch.patches().is_empty());
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
        let (metrics, scratch) = read(&frame(&base, &[Dent(cx, cy, radius, 0.4)], 3), &base);
        assert_eq!(scratch.patches().len(), 1);
        let (x, y) = metrics.centroid_xy;
        assert!((x - cx).hypot(y - cy) < 3.0, "{x} {y}");
        // Response falls to 0.61 of its most at 1.71 radii.
        let ratio = (f64::from(metrics.eda) / std::f64::consts::PI).sqrt() / radius;
        assert!((1.5..1.9).contains(&ratio), "{ratio}");
        assert_eq!(metrics.eda as usize, scratch.mask().iter().map(|&m| usize::from(m)).sum::<usize>());
    }
}

#[test]
fn two_dents_are_two_patches_and_each_keeps_its_area() {
    let base = baseline(240, 320);
    let (left, right) = (Dent(80.0, 110.0, 22.0, 0.5), Dent(230.0, 140.0, 30.0, 0.3));
    let (one, _) = read(&frame(&base, &[left], 5), &base);
    let (other, _) = read(&frame(&base, &[right], 5), &base);
    let (both, scratch) = read(&frame(&base, &[left, right], 5), &base);
    assert_eq!(scratch.patches().len(), 2);
    let ratio = f64::from(both.eda) / f64::from(one.eda + other.eda);
    assert!((0.9..1.1).contains(&ratio), "{ratio}");
    assert_eq!(scratch.patches().iter().map(|p| p.area).sum::<u32>(), both.eda);
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
    let pair = Pair::new(image.view(), base.view()).unwrap();
    let (mut dent, mut contact) = (LiveScratch::default(), LiveScratch::default());
    let outer = read_live(&pair, Order::Bgr, Outline::Dent, &mut dent);
    let inner = read_live(&pair, Order::Bgr, Outline::Contact, &mut contact);
    assert!(inner.eda > 0 && f64::from(inner.eda) < 0.8 * f64::from(outer.eda));
    assert!(contact.mask().iter().zip(dent.mask()).all(|(inner, outer)| inner <= outer));
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
    let areas = [area(1), area(2), area(3), area(5)];
    for a in areas {
        assert!((a / areas[1] - 1.0).abs() < 0.06, "{areas:?}");
    }
}

#[test]
fn strides_and_colour_order_do_not_matter() {
    let base = baseline(96, 128);
    let image = frame(&base, &[Dent(60.0, 40.0, 16.0, 0.4)], 9);
    let mut scratch = LiveScratch::default();
    let mut of = |image: ArrayView3<'_, u8>, base: ArrayView3<'_, u8>, order| {
        let metrics = read_live(&Pair::new(image, base).unwrap(), order, Outline::Dent, &mut scratch);
        (metrics, scratch.mask().to_vec())
    };
    let plain = of(image.view(), base.view(), Order::Bgr);
    let wide = |a: &Array3<u8>| Array3::from_shape_fn((96, 256, 3), |(y, x, c)| a[[y, x / 2, c]]);
    let (wide_image, wide_base) = (wide(&image), wide(&base));
    let strided = of(wide_image.slice(s![.., ..;2, ..]), wide_base.slice(s![.., ..;2, ..]), Order::Bgr);
    assert_eq!(plain, strided);
    let swapped = of(image.slice(s![.., .., ..;-1]), base.slice(s![.., .., ..;-1]), Order::Rgb);
    assert_eq!(plain, swapped);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// Whatever the pictures, the numbers agree with each other and nothing leaves the image.
    #[test]
    fn any_pictures_give_a_mask_and_numbers_that_agree(
        height in 1usize..70, width in 1usize..70, seed in any::<u64>(), blocks in 1usize..30,
    ) {
        let value = |y: usize, x: usize, c: usize, which: u64| {
            let block = ((y / blocks * 31 + x / blocks) * 3 + c) as u64;
            (seed ^ which).wrapping_mul(0x2545_f491_4f6c_dd1d).rotate_left((block * 11 % 64) as u32) as u8
        };
        let image = Array3::from_shape_fn((height, width, 3), |(y, x, c)| value(y, x, c, 1));
        let base = Array3::from_shape_fn((height, width, 3), |(y, x, c)| value(y, x, c, 2) / 2);
        let (metrics, scratch) = read(&image, &base);
        let mask = scratch.mask();
        prop_assert_eq!(mask.len(), height * width);
        prop_assert_eq!(mask.iter().map(|&m| usize::from(m)).sum::<usize>(), metrics.eda as usize);
        prop_assert!(mask.iter().all(|&m| m <= 1));
        prop_assert_eq!(scratch.patches().iter().map(|p| p.area).sum::<u32>(), metrics.eda);
        prop_assert_eq!(metrics.in_contact, metrics.eda > 0);
        if metrics.in_contact {
            let (mut sx, mut sy, mut n) = (0usize, 0usize, 0usize);
            for (i, _) in mask.iter().enumerate().filter(|(_, m)| **m == 1) {
                sx += i % width;
                sy += i / width;
                n += 1;
            }
            let (x, y) = metrics.centroid_xy;
            prop_assert!((x - sx as f64 / n as f64).abs() < 1e-6 && (y - sy as f64 / n as f64).abs() < 1e-6);
            prop_assert!((metrics.cci - metrics.peak / (n as f64).sqrt()).abs() <= 1e-9 * metrics.cci);
            prop_assert!(metrics.peak.is_finite() && metrics.spread.is_finite() && metrics.mass > 0.0);
            for patch in scratch.patches() {
                let (left, top, right, bottom) = patch.bounds;
                prop_assert!(left <= right && right < width && top <= bottom && bottom < height);
            }
        }
    }
}

#[test]
fn buffers_hold_nothing_of_the_frame_before() {
    let mut scratch = LiveScratch::default();
    let (large, small) = (baseline(240, 320), baseline(64, 48));
    let frames = [
        (frame(&large, &[Dent(80.0, 110.0, 22.0, 0.5), Dent(230.0, 140.0, 30.0, 0.3)], 1), &large),
        (frame(&large, &[Dent(160.0, 40.0, 15.0, 0.5)], 2), &large),
        (frame(&small, &[Dent(20.0, 30.0, 8.0, 0.5)], 3), &small),
        (frame(&large, &[], 4), &large),
        (frame(&large, &[Dent(150.0, 200.0, 25.0, 0.4)], 5), &large),
    ];
    for (image, base) in &frames {
        let pair = Pair::new(image.view(), base.view()).unwrap();
        let metrics = read_live(&pair, Order::Bgr, Outline::Dent, &mut scratch);
        let (fresh, untouched) = read(image, base);
        assert_eq!(scratch.mask(), untouched.mask());
        assert_eq!((metrics.eda, metrics.cci.to_bits()), (fresh.eda, fresh.cci.to_bits()));
    }
}
