//! Pictures from a fuzzer's bytes: raw noise alone would never look like a gel, so shapes are drawn too.

use ndarray::{Array3, Axis, Slice};

use crate::bytes::Bytes;

/// Draws a frame and its baseline, which share what most of a sensor's picture shares.
pub fn pair(bytes: &mut Bytes<'_>, height: usize, width: usize) -> (Array3<u8>, Array3<u8>) {
    let colour: [u8; 3] = bytes.take();
    let mut baseline = Array3::from_shape_fn((height, width, 3), |(_, _, c)| colour[c]);
    draw(bytes, &mut baseline);
    let mut frame = baseline.clone();
    draw(bytes, &mut frame);
    (frame, baseline)
}

/// Up to seven shapes.
pub fn draw(bytes: &mut Bytes<'_>, picture: &mut Array3<u8>) {
    for _ in 0..bytes.up_to(7) {
        let (height, width, _) = picture.dim();
        match bytes.up_to(4) {
            0 => {
                let (y, x) = (bytes.up_to(height - 1), bytes.up_to(width - 1));
                let (rows, cols) = (bytes.up_to(height - y), bytes.up_to(width - x));
                let colour: [u8; 3] = bytes.take();
                let inside = |at: usize, from: usize, count: usize| at >= from && at < from + count;
                set(
                    picture,
                    |at_y, at_x, c, value| {
                        if inside(at_y, y, rows) && inside(at_x, x, cols) { colour[c] } else { value }
                    },
                );
            }
            1 => {
                let (seed, amplitude) = (u64::from(bytes.word()), bytes.byte());
                change(picture, |y, x, c| {
                    let mixed = ((y * 4096 + x) as u64 * 4 + c as u64 + 1)
                        .wrapping_mul(0x9E37_79B9_7F4A_7C15 ^ seed << 17);
                    (mixed >> 40) as i32 % (2 * i32::from(amplitude) + 1) - i32::from(amplitude)
                });
            }
            2 => {
                let [across, down, by] = bytes.take().map(|byte: u8| i32::from(byte as i8));
                change(picture, |y, x, c| (across * x as i32 + down * y as i32) / 64 + by * c as i32);
            }
            3 => dent(bytes, picture),
            _ => {
                let tile: [u8; 24] = bytes.take();
                set(picture, |y, x, c, _| tile[(y * 5 + x * 3 + c) % 24]);
            }
        }
    }
}

fn change(picture: &mut Array3<u8>, by: impl Fn(usize, usize, usize) -> i32) {
    set(picture, |y, x, c, value| (i32::from(value) + by(y, x, c)).clamp(0, 255) as u8);
}

/// Sets every byte from its place and its value.
fn set(picture: &mut Array3<u8>, to: impl Fn(usize, usize, usize, u8) -> u8) {
    let width = picture.dim().1;
    let bytes = picture.as_slice_mut().expect("drawn before it is laid out otherwise");
    for (y, row) in bytes.chunks_exact_mut(3 * width).enumerate() {
        for (x, pixel) in row.as_chunks_mut::<3>().0.iter_mut().enumerate() {
            for (c, value) in pixel.iter_mut().enumerate() {
                *value = to(y, x, c, *value);
            }
        }
    }
}

/// A cone's flanks, each channel lit from another side.
fn dent(bytes: &mut Bytes<'_>, picture: &mut Array3<u8>) {
    let (height, width, _) = picture.dim();
    let (cy, cx) = (bytes.up_to(height - 1) as i32, bytes.up_to(width - 1) as i32);
    let (radius, steep) = (1 + i32::from(bytes.byte()), i32::from(bytes.byte() as i8));
    change(picture, |y, x, c| {
        let (dy, dx) = (y as i32 - cy, x as i32 - cx);
        if dx * dx + dy * dy > radius * radius {
            return 0;
        }
        let [lx, ly] = [[2, 0], [-1, 2], [-1, -2]][c];
        steep * (lx * dx + ly * dy) / (2 * radius)
    });
}

/// The same picture with its bytes laid out in memory another way.
pub fn laid_out(picture: Array3<u8>, how: u8) -> Array3<u8> {
    let mut picture = picture;
    if how & 1 != 0 {
        picture = picture.permuted_axes([2, 0, 1]).as_standard_layout().into_owned().permuted_axes([1, 2, 0]);
    }
    for axis in (0..3).filter(|axis| how & (2 << axis) != 0) {
        let mut turned = picture.view();
        turned.invert_axis(Axis(axis));
        picture = turned.as_standard_layout().into_owned();
        picture.invert_axis(Axis(axis));
    }
    if how & 16 != 0 {
        let (height, width, _) = picture.dim();
        let mut sparse = Array3::from_elem((height, 2 * width, 3), 77);
        sparse.slice_axis_inplace(Axis(1), Slice::new(0, None, 2));
        sparse.assign(&picture);
        picture = sparse;
    }
    picture
}
