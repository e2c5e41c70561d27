//! The two presets on any images.

use ndarray::Array3;
use tega_tactile::{
    ContactMetrics, LiveReader, LiveScratch, MIN_PIXELS, NOISE_FLOOR, Order, Outline, Pair, PaperScratch,
    SensorNoise, read_live, read_paper,
};

use super::pictures::{laid_out, pair};
use crate::bytes::Bytes;

/// A frame, its baseline and how they are read.
struct Scene {
    frame: Array3<u8>,
    baseline: Array3<u8>,
    layouts: [u8; 2],
    order: Order,
    outline: Outline,
}

impl Scene {
    fn draw(bytes: &mut Bytes<'_>) -> Self {
        let choices = bytes.byte();
        let (height, width) = match bytes.byte() % 32 {
            // The cameras' sizes, where whole cells take a way of their own.
            0 => (240, 320),
            1 => (320, 240),
            // Thin as a line, either way.
            2 => (1, 1 + bytes.up_to(4095)),
            3 => (1 + bytes.up_to(4095), 1),
            4 => (1 + bytes.up_to(1023), 1 + bytes.up_to(7)),
            5 => (1 + bytes.up_to(9), 1 + bytes.up_to(9)),
            _ => (1 + bytes.up_to(119), 1 + bytes.up_to(159)),
        };
        let layouts = bytes.take();
        let (frame, baseline) = pair(bytes, height, width);
        Self {
            frame: laid_out(frame, layouts[0]),
            baseline: laid_out(baseline, layouts[1]),
            layouts,
            order: if choices & 1 == 0 { Order::Bgr } else { Order::Rgb },
            outline: if choices & 2 == 0 { Outline::Dent } else { Outline::Contact },
        }
    }

    fn pair(&self) -> Pair<'_> {
        Pair::new(self.frame.view(), self.baseline.view()).unwrap()
    }

    /// The same bytes laid out the other way around, in a scratch that another picture has been through.
    fn again<S: Default>(&self, read: impl Fn(&Pair<'_>, &mut S) -> ContactMetrics) -> (ContactMetrics, S) {
        let (frame, baseline) = (
            laid_out(self.frame.clone(), !self.layouts[0]),
            laid_out(self.baseline.clone(), !self.layouts[1]),
        );
        let mut scratch = S::default();
        let mirrored = Array3::from_shape_fn((37, 90, 3), |(y, x, c)| (y * 3 + x * 2 + c * 50) as u8);
        let dark = Array3::zeros((37, 90, 3));
        read(&Pair::new(mirrored.view(), dark.view()).unwrap(), &mut scratch);
        (read(&Pair::new(frame.view(), baseline.view()).unwrap(), &mut scratch), scratch)
    }

    /// What any reading's numbers owe to each other.
    fn check(&self, m: &ContactMetrics) {
        let (height, width, _) = self.frame.dim();
        assert!(m.eda as usize <= height * width && m.peak_xy.0 < width && m.peak_xy.1 < height);
        assert!(m.mass.is_finite() == m.in_contact || m.mass >= 0.0 || m.mass.is_nan());
        if !m.in_contact {
            assert_eq!((m.eda, m.cci), (0, 0.0));
            return assert!(m.centroid_xy.0.is_nan() && m.spread.is_nan() && m.threshold.is_nan());
        }
        let (x, y) = m.centroid_xy;
        assert!((-1e-6..width as f64).contains(&x) && (-1e-6..height as f64).contains(&y), "{m:?}");
        assert!(m.spread >= 0.0 && m.spread <= (height + width) as f64 && m.threshold >= 0.0, "{m:?}");
        assert!(
            m.mass > 0.0 && m.peak > 0.0 && m.cci >= 0.0 && m.mass.is_finite() && m.cci.is_finite(),
            "{m:?}"
        );
    }
}

/// Any images: no panic, the mask's pixels are EDA, they are those over the threshold, and memory does not matter.
pub fn paper_reading_survives_any_image(data: &[u8]) {
    let scene = Scene::draw(&mut Bytes(data));
    let mut scratch = PaperScratch::default();
    let metrics = read_paper(&scene.pair(), scene.order, &mut scratch);
    scene.check(&metrics);
    let mask: Vec<bool> = scratch.mask().collect();
    assert_eq!(mask.iter().filter(|on| **on).count(), metrics.eda as usize);
    let map: Vec<f32> = scratch.pressure_map().collect();
    assert_eq!(map.iter().fold(0f32, |a, b| a.max(*b)), metrics.peak as f32);
    let floor = NOISE_FLOOR as f32;
    assert!(map.iter().all(|grey| *grey == 0.0 || *grey >= floor));
    let pressed = map.iter().filter(|grey| **grey > floor).count();
    assert_eq!(metrics.in_contact, pressed >= MIN_PIXELS as usize);
    for (on, grey) in mask.iter().zip(&map).filter(|_| metrics.in_contact) {
        // A level is at most a float's rounding away from the threshold that it was compared with exactly.
        let above = f64::from(*grey) - metrics.threshold;
        assert!(if *on { above > -1e-4 } else { above < 1e-4 }, "{grey} {on} {metrics:?}");
    }
    let (again, scratch) =
        scene.again(|pair, scratch: &mut PaperScratch| read_paper(pair, scene.order, scratch));
    assert_eq!(format!("{again:?}"), format!("{metrics:?}"));
    assert!(scratch.mask().eq(mask));
}

/// Any images: no panic, the mask's pixels are EDA, and memory does not matter.
pub fn live_reading_mask_is_its_area(data: &[u8]) {
    let scene = Scene::draw(&mut Bytes(data));
    let (order, outline, noise) = (scene.order, scene.outline, SensorNoise::default());
    let mut reader = LiveReader::new(scene.baseline.view(), order, outline, noise).unwrap();
    let (metrics, mask) = reader.mask(scene.frame.view()).unwrap();
    scene.check(&metrics);
    let (height, width, _) = scene.frame.dim();
    assert_eq!(mask.len(), height * width);
    assert!(mask.iter().all(|on| *on <= 1));
    assert_eq!(mask.iter().map(|on| u32::from(*on)).sum::<u32>(), metrics.eda);
    assert_eq!(metrics.in_contact, metrics.eda > 0);
    let pressure: Vec<f32> = reader.pressure_map().collect();
    assert!(pressure.len() == height * width && pressure.iter().all(|e| e.is_finite() && *e >= 0.0));
    assert!(metrics.in_contact || pressure.iter().all(|e| *e == 0.0));
    assert!(!reader.read(scene.baseline.view()).unwrap().in_contact);
    let (again, _) = scene
        .again(|pair, scratch: &mut LiveScratch| read_live(pair, order, outline, noise, scratch).unwrap());
    assert_eq!(format!("{again:?}"), format!("{metrics:?}"));
}
