//! After the first frames of a size, reading one allocates nothing.

#![allow(clippy::unwrap_used)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::fmt::Debug;

use ndarray::Array3;
use tega_tactile::{
    Difference, LiveScratch, Options, Order, Outline, Pair, PaperScratch, Scratch, Spread, contact_metrics,
    read_live, read_paper,
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
    let (pair, mut scratch) = (Pair::new(frame.view(), baseline.view()).unwrap(), LiveScratch::default());
    read_live(&pair, Order::Bgr, Outline::Dent, &mut scratch);
    assert_eq!(scratch.patches().len(), 2, "the frames are to show patches");
    for outline in [Outline::Dent, Outline::Contact] {
        nothing_is_allocated(|pair, scratch: &mut LiveScratch| read_live(pair, Order::Bgr, outline, scratch));
    }
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
