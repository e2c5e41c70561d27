//! Reading a frame of a size seen before allocates nothing.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

use ndarray::Array3;
use tega_tactile::{LiveScratch, Order, Outline, Pair, read_live};

struct Counting;

static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call is handed on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: as above.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn a_second_frame_allocates_nothing() {
    let baseline = Array3::<u8>::from_elem((240, 320, 3), 100);
    // Two squares pressed in, one flank lit and one dark each.
    let frame = Array3::from_shape_fn((240, 320, 3), |(y, x, _)| match (y, x) {
        (60..120, 50..90) | (100..150, 200..230) => 160,
        (60..120, 90..130) | (100..150, 230..260) => 40,
        _ => 100,
    });
    let pair = Pair::new(frame.view(), baseline.view()).unwrap();
    let mut scratch = LiveScratch::default();
    let first = read_live(&pair, Order::Bgr, Outline::Dent, &mut scratch);
    assert!(first.in_contact && scratch.patches().len() == 2);
    let before = ALLOCATIONS.load(Ordering::Relaxed);
    let second = read_live(&pair, Order::Bgr, Outline::Dent, &mut scratch);
    let after = ALLOCATIONS.load(Ordering::Relaxed);
    assert_eq!(first, second);
    assert_eq!(after - before, 0);
}
