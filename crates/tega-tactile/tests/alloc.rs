//! After the first frames of a size, reading one allocates nothing.

#![allow(clippy::unwrap_used)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::fmt::Debug;

use ndarray::Array3;
use tega_tactile::{
    Difference, LiveReader, LiveScratch, Options, Order, Outline, Pair, PaperScratch, Scratch, SensorNoise,
    Spread, TouchTracker, TrackerOptions, contact_metrics, read_live, read_paper,
};

struct Counting;

thread_local! {
    /// Allocations of this thread: tests run side by side.
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
}

fn count() {
    // A thread that is ending has no counter any more.
    let _ = ALLOCATIONS.try_with(|n| n.set(n.get() + 1));
}

// SAFETY: every call is handed on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: as above.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: as above.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: as above.
        unsafe { System.realloc(pointer, layout, size) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const SIZE: (usize, usize) = (240, 320);

/// A gel, dotted or plain.
fn baseline(dots: bool) -> Array3<u8> {
    Array3::from_shape_fn((SIZE.0, SIZE.1, 3), |(y, x, c)| {
        let shade = 90 + 10 * c + x / 8 + y / 12;
        if dots && y % 24 < 8 && x % 24 < 8 { 20 } else { shade as u8 }
    })
}

/// The gel with squares pressed in at these corners, one flank lit and one dark each.
fn frame(baseline: &Array3<u8>, corners: &[(usize, usize)]) -> Array3<u8> {
    let mut frame = baseline.clone();
    for ((y, x, _), value) in frame.indexed_iter_mut() {
        for &(top, left) in corners {
            if (top..top + 50).contains(&y) && (left..left + 40).contains(&x) {
                *value = if x < left + 20 { 180 } else { 40 };
            }
        }
    }
    frame
}

/// What a gel may keep of that press.
fn kept(baseline: &Array3<u8>, share: f32) -> Array3<u8> {
    let mut kept = frame(baseline, &[(60, 50)]);
    kept.zip_mut_with(baseline, |kept, gel| {
        *kept = (f32::from(*gel) + share * (f32::from(*kept) - f32::from(*gel))) as u8;
    });
    kept
}

/// Reads every frame once to size the buffers, then counts what a second round allocates.
fn nothing_is_allocated<S: Default, R: PartialEq + Debug>(mut read: impl FnMut(&Pair<'_>, &mut S) -> R) {
    let mut scratch = S::default();
    for dots in [false, true] {
        let baseline = baseline(dots);
        let frames = [&[][..], &[(60, 50)], &[(60, 50), (100, 200)], &[(20, 20), (150, 130), (90, 260)]]
            .map(|corners| frame(&baseline, corners));
        let pairs = frames.each_ref().map(|frame| Pair::new(frame.view(), baseline.view()).unwrap());
        let first = pairs.each_ref().map(|pair| read(pair, &mut scratch));
        for (pair, first) in pairs.iter().zip(first) {
            let before = ALLOCATIONS.get();
            let again = read(pair, &mut scratch);
            let after = ALLOCATIONS.get();
            assert_eq!(after - before, 0, "{again:?}");
            assert_eq!(format!("{again:?}"), format!("{first:?}"));
        }
    }
}

#[test]
fn the_counter_counts() {
    let before = ALLOCATIONS.get();
    drop(std::hint::black_box(vec![0u8; 100]));
    assert!(ALLOCATIONS.get() > before);
}

#[test]
fn live() {
    let baseline = baseline(false);
    let frame = frame(&baseline, &[(60, 50), (100, 200)]);
    let noise = SensorNoise::default();
    for outline in [Outline::Dent, Outline::Contact] {
        nothing_is_allocated(|pair, scratch: &mut LiveScratch| {
            read_live(pair, Order::Bgr, outline, noise, scratch).unwrap()
        });
        let mut reader = LiveReader::new(baseline.view(), Order::Bgr, outline, noise).unwrap();
        assert!(reader.mask(frame.view()).unwrap().0.in_contact, "the frames are to show contacts");
        let before = ALLOCATIONS.get();
        for image in [&frame, &baseline, &frame] {
            reader.read(image.view()).unwrap();
            reader.mask(image.view()).unwrap();
            assert!(reader.pressure_map().all(f32::is_finite));
        }
        assert_eq!(ALLOCATIONS.get() - before, 0);
    }
}

/// Quiet, in contact, released, taken again: with strides of its own too.
#[test]
fn tracker() {
    let baseline = baseline(false);
    let pressed = frame(&baseline, &[(60, 50)]);
    // What a gel keeps of a press sinks.
    let (kept, sunk) = (kept(&baseline, 0.15), kept(&baseline, 0.1));
    let mut turned = baseline.view();
    turned.invert_axis(ndarray::Axis(0));
    let turned = turned.to_owned();
    let mut tracker = TouchTracker::new(baseline.view(), TrackerOptions::default()).unwrap();
    let mut shown = [0; 2];
    for round in 0..3 {
        let before = ALLOCATIONS.get();
        for (image, frames) in [(&baseline, 30), (&pressed, 30), (&kept, 8), (&sunk, 112)] {
            for _ in 0..frames {
                let touch = tracker.update(image.view(), None, false).unwrap();
                shown[usize::from(touch.in_contact)] += 1;
            }
        }
        let allocated = ALLOCATIONS.get() - before;
        assert!(round == 0 || allocated == 0, "{allocated}");
        let mut view = turned.view();
        view.invert_axis(ndarray::Axis(0));
        tracker.update(view, None, false).unwrap();
    }
    assert!(shown[0] > 3 * 90 && shown[1] > 3 * 25, "{shown:?}");
}

#[test]
fn paper() {
    nothing_is_allocated(|pair, scratch: &mut PaperScratch| read_paper(pair, Order::Bgr, scratch));
}

#[test]
fn the_printed_equations() {
    for difference in [Difference::Signed, Difference::Rectified, Difference::Absolute] {
        for spread in [Spread::Spatial, Spread::Intensity] {
            let options = Options { difference, spread, ..Options::default() };
            nothing_is_allocated(|pair, scratch: &mut Scratch| contact_metrics(pair, &options, scratch));
        }
    }
}
