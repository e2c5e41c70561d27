//! The kernels that are timed and counted, ready to be called again and again.
//!
//! Ids are `kernel/variant/size`. Input is made here, from integers and a fixed sequence, the same on every machine.

mod pictures;

use std::hint::black_box;

use ndarray::Array3;
use tega_emg::{ButterworthLowpass, GraspIntent, Kind, Preset};
use tega_gel::{Gel, Indenter, PICTURE, Setup, Shape};
use tega_hand::{Gains, HandController, JointModel, PoseSet};
use tega_tactile::{
    Difference, LiveReader, Options, Order, Outline, Pair, PaperScratch, Scratch, SensorNoise, Spread,
    TouchTracker, TrackerOptions, contact_metrics, read_paper,
};

use pictures::{baseline, frame};

/// One DIGIT's picture, upright, a quarter and four of it: height, width.
const SIZES: [(usize, usize); 3] = [(320, 240), (160, 120), (640, 480)];
const FINGER: (usize, usize) = SIZES[0];
const CHANNELS: usize = 3;

/// A kernel on input of its own.
pub struct Kernel {
    /// `kernel/variant/size`.
    pub id: String,
    /// Whether the instruction set in use matters to it.
    pub dispatched: bool,
    /// Makes its input.
    pub make: Box<dyn FnOnce() -> Run>,
}

/// Runs a kernel once.
pub type Run = Box<dyn FnMut()>;

/// Every kernel.
pub fn kernels() -> Vec<Kernel> {
    let mut all = Vec::new();
    for size in SIZES {
        for (name, difference) in [
            ("rectified-spatial", Difference::Rectified),
            ("signed-spatial", Difference::Signed),
            ("absolute-spatial", Difference::Absolute),
        ] {
            let options = Options { difference, ..Options::default() };
            all.push(tactile("contact_metrics", name, size, move || metrics(size, options)));
        }
        all.push(tactile("read_paper", "touched", size, move || paper(size)));
        all.push(tactile("live_reader", "touched", size, move || live(size, 1)));
        all.push(tactile("live_reader", "untouched", size, move || live(size, 0)));
        all.push(tactile("touch_tracker", "touched", size, move || tracker(size, 1)));
        all.push(tactile("touch_tracker", "touched-thrice", size, move || tracker(size, 3)));
        all.push(tactile("touch_tracker", "untouched", size, move || tracker(size, 0)));
    }
    let wide = indenter(Shape::Box { half: [20.0; 3] }, 5.0);
    all.push(tactile("touch_tracker", "face-5-N", FINGER, move || tracker_on_gel(vec![wide])));
    all.push(tactile("touch_tracker", "rest-on-gel", FINGER, || tracker_on_gel(vec![])));
    let options =
        Options { difference: Difference::Rectified, spread: Spread::Intensity, ..Options::default() };
    all.push(tactile("contact_metrics", "rectified-intensity", FINGER, move || metrics(FINGER, options)));
    all.push(plain("lowpass/3-channels/10", true, || lowpass(10)));
    all.push(plain("lowpass/3-channels/10000", true, || lowpass(10_000)));
    all.push(plain("grasp_intent/3-channels/10", true, intent));
    all.push(plain("hand/controller-and-model/16", false, hand));
    for (variant, force_n) in [("untouched", 0.0), ("ball-1-N", 1.0), ("ball-4-N", 4.0), ("ball-12-N", 12.0)]
    {
        let ball = Shape::Sphere { radius: 4.4 };
        all.push(tactile("gel_frame", variant, FINGER, move || gel(vec![indenter(ball, force_n)], None)));
    }
    let face = Shape::Box { half: [20.0; 3] };
    all.push(tactile("gel_frame", "face-4-N", FINGER, move || gel(vec![indenter(face, 4.0)], None)));
    let before = indenter(Shape::Sphere { radius: 4.4 }, 4.0);
    all.push(tactile("gel_frame", "ball-4-N-memory", FINGER, move || gel(vec![before], Some(before))));
    all.push(tactile("gel_frame", "after-release", FINGER, move || gel(vec![], Some(before))));
    all
}

fn tactile(
    kernel: &str,
    variant: &str,
    (height, width): (usize, usize),
    make: impl FnOnce() -> Run + 'static,
) -> Kernel {
    Kernel { id: format!("{kernel}/{variant}/{height}x{width}"), dispatched: true, make: Box::new(make) }
}

fn plain(id: &str, dispatched: bool, make: impl FnOnce() -> Run + 'static) -> Kernel {
    Kernel { id: id.into(), dispatched, make: Box::new(make) }
}

fn pair<'a>(frame: &'a Array3<u8>, baseline: &'a Array3<u8>) -> Pair<'a> {
    Pair::new(frame.view(), baseline.view()).expect("the pictures are alike")
}

fn metrics(size: (usize, usize), options: Options) -> Run {
    let (frame, baseline) = (frame(size, 1), baseline(size));
    let mut scratch = Scratch::default();
    Box::new(move || {
        black_box(contact_metrics(black_box(&pair(&frame, &baseline)), &options, &mut scratch));
    })
}

fn paper(size: (usize, usize)) -> Run {
    let (frame, baseline) = (frame(size, 1), baseline(size));
    let mut scratch = PaperScratch::default();
    Box::new(move || {
        black_box(read_paper(black_box(&pair(&frame, &baseline)), Order::Bgr, &mut scratch));
    })
}

fn reader(size: (usize, usize)) -> LiveReader {
    LiveReader::new(baseline(size).view(), Order::Bgr, Outline::Dent, SensorNoise::default())
        .expect("a picture of three colours")
}

fn live(size: (usize, usize), presses: usize) -> Run {
    let (frame, mut reader) = (frame(size, presses), reader(size));
    Box::new(move || {
        black_box(reader.read(black_box(frame.view())).expect("the pictures are alike"));
    })
}

/// A tracker that has seen its gel at rest, and then frames with these presses held.
fn settled(size: (usize, usize), presses: usize) -> TouchTracker {
    let mut tracker = TouchTracker::new(baseline(size).view(), TrackerOptions::default())
        .expect("a picture of three colours");
    for image in [frame(size, 0), frame(size, presses)] {
        for _ in 0..30 {
            tracker.update(image.view(), None, false).expect("the pictures are alike");
        }
    }
    tracker
}

fn tracker(size: (usize, usize), presses: usize) -> Run {
    let (frame, mut tracker) = (frame(size, presses), settled(size, presses));
    Box::new(move || {
        let touch = tracker.update(black_box(frame.view()), None, false);
        black_box(touch.expect("the pictures are alike"));
    })
}

/// A tracker on a simulated fingertip, at rest and then pressed: frames that differ by their noise, as a camera's do.
fn tracker_on_gel(presses: Vec<Indenter>) -> Run {
    let mut gel = Gel::new(Setup { seed: 5, ..Setup::default() }).expect("a spread within bounds");
    let mut painted = |presses: &[Indenter], number| {
        let mut picture = vec![0; PICTURE];
        gel.press(presses, 0.0).expect("a shape");
        gel.paint(number, &mut picture).expect("a picture's buffer");
        Array3::from_shape_vec((FINGER.0, FINGER.1, CHANNELS), picture).expect("a picture's values")
    };
    let rest: Vec<_> = (0..30).map(|number| painted(&[], number)).collect();
    let then: Vec<_> = (30..70).map(|number| painted(&presses, number)).collect();
    let mut tracker =
        TouchTracker::new(rest[0].view(), TrackerOptions::default()).expect("a picture of three colours");
    for image in rest.iter().chain(&then) {
        tracker.update(image.view(), None, false).expect("the pictures are alike");
    }
    let mut next = then.into_iter().cycle();
    Box::new(move || {
        let image = next.next().expect("it goes round");
        let touch = tracker.update(black_box(image.view()), None, false).expect("the pictures are alike");
        assert_eq!(touch.in_contact, !presses.is_empty(), "what is counted is not what it is named");
        black_box(touch);
    })
}

/// Muscle activity on a converter's offset: noise of a fixed sequence.
fn emg(rows: usize) -> Vec<f64> {
    let mut noise = pictures::Noise::new(17);
    (0..rows * CHANNELS).map(|_| 2048.0 + f64::from(noise.within(400))).collect()
}

fn lowpass(rows: usize) -> Run {
    let mut filter = ButterworthLowpass::new(1000.0, 50.0, 4, CHANNELS).expect("the paper's filter");
    let (samples, mut out) = (emg(rows), Vec::new());
    Box::new(move || {
        out.clear();
        filter.process(black_box(&samples), &mut out).expect("whole rows");
        black_box(&out);
    })
}

fn intent() -> Run {
    let maxima = [300.0; CHANNELS];
    let mut intent = GraspIntent::new(1000.0, &maxima, 10, Kind::Raw, Preset::Live).expect("maxima above 0");
    let samples = emg(10);
    Box::new(move || {
        black_box(intent.process(black_box(&samples)).expect("whole rows"));
    })
}

fn indenter(shape: Shape, force_n: f64) -> Indenter {
    Indenter { shape, pose_mm: [[1.0, 0.0, 0.0, 0.3], [0.0, 1.0, 0.0, -0.2], [0.0, 0.0, 1.0, 0.0]], force_n }
}

/// A frame of a simulated fingertip: pressed, shaded, with its noise; one with memory was pressed for a second before.
fn gel(indenters: Vec<Indenter>, before: Option<Indenter>) -> Run {
    let setup = Setup { seed: 1, memory: before.is_some(), ..Setup::default() };
    let mut gel = Gel::new(setup).expect("a spread within bounds");
    if let Some(before) = before {
        gel.press(&[before], 0.0).expect("a shape");
        gel.press(&[before], 1.0).expect("a later time");
    }
    let (mut picture, mut number) = (vec![0; PICTURE], 0);
    Box::new(move || {
        number += 1;
        let t_s = 1.0 + number as f64 / 6e6;
        black_box(gel.press(black_box(&indenters), t_s).expect("a shape"));
        // Within one second, so that no drift of the colours falls on the frame that is counted.
        gel.paint(number % 60, &mut picture).expect("a picture's buffer");
        black_box(&picture);
    })
}

fn hand() -> Run {
    let mut controller = HandController::new(PoseSet::default(), Gains::default()).expect("default gains");
    let mut model = JointModel::default();
    let mut angles = *model.angles_rad();
    Box::new(move || {
        let torques = controller.step(black_box(&angles), 4.0, None).expect("a level of the five");
        angles = model.step(&torques).expect("finite torques");
        black_box(&angles);
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_show_what_their_kernels_are_named_for() {
        for size in SIZES {
            for presses in [0, 1, 3] {
                let frame = frame(size, presses);
                let read = reader(size).read(frame.view()).unwrap();
                assert_eq!(read.in_contact, presses > 0, "{size:?} {read:?}");
                let touch = settled(size, presses).update(frame.view(), None, false).unwrap();
                assert_eq!(touch.in_contact, presses > 0, "{size:?} {touch:?}");
            }
            let (frame, baseline) = (frame(size, 1), baseline(size));
            let pair = pair(&frame, &baseline);
            assert!(read_paper(&pair, Order::Bgr, &mut PaperScratch::default()).in_contact);
            for difference in [Difference::Signed, Difference::Rectified, Difference::Absolute] {
                let options = Options { difference, ..Options::default() };
                let m = contact_metrics(&pair, &options, &mut Scratch::default());
                assert!(m.in_contact, "{size:?} {difference:?} {m:?}");
                // At a finger's size the count has to look at pixels: some are above the threshold, not all.
                let some = m.eda > 0 && (m.eda as usize) < size.0 * size.1;
                assert!(some || size != FINGER, "{difference:?} {m:?}");
            }
        }
    }

    #[test]
    fn every_kernel_runs_again_and_has_an_id_of_its_own() {
        let mut ids = std::collections::HashSet::new();
        for kernel in kernels() {
            let mut run = (kernel.make)();
            run();
            run();
            assert!(ids.insert(kernel.id));
        }
    }
}
