//! Where pixels lie between the wide cells of shear.

use crate::picture::WIDTH;
use crate::shear::WIDE_PX;

/// The cell before each pixel of a row, and how far the pixel is on the way to the next one.
pub(crate) const BESIDE: [usize; WIDTH] = {
    let mut beside = [0; WIDTH];
    let mut x = 0;
    while x < WIDTH {
        beside[x] = place(x).0;
        x += 1;
    }
    beside
};
pub(crate) const ACROSS: [f32; WIDTH] = {
    let mut across = [0.0; WIDTH];
    let mut x = 0;
    while x < WIDTH {
        across[x] = place(x).1;
        x += 1;
    }
    across
};

/// The cell before a pixel, and how far the pixel is on the way to the next one.
pub(crate) const fn place(pixel: usize) -> (usize, f32) {
    // The middle of cell c is pixel 8 c - 4.5.
    let at = (pixel as f32 + 4.5) / WIDE_PX as f32;
    (at as usize, at - (at as usize) as f32)
}
