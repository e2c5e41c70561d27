//! What is printed on a gel, without the light on it: the picture's grain in grey.
//!
//! Shading is smooth, what is printed is not. With S the mean of the four pixels some steps away, (I - S)² leaves nothing of any
//! cubic surface. It runs on integers: 64 units a count, which a sixteen-bit number holds whatever the picture is.

use ndarray::ArrayView3;

use crate::frame::{Order, row_bytes};

/// Quarters of a count in red, green and blue: ITU-R BT.601 over 64.
const WEIGHTS: [u16; 3] = [19, 38, 7];
/// Units of the grain a count.
pub(super) const UNITS_PER_COUNT: f32 = 64.0;

/// Rows and columns of pixels, ends excluded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Part {
    pub rows: [usize; 2],
    pub cols: [usize; 2],
}

/// The grain of a picture's part; 0 near the picture's border.
#[derive(Debug, Clone, Default)]
pub(super) struct Grain {
    height: usize,
    width: usize,
    /// Pixels from one to its neighbours in S.
    step: usize,
    /// Quarters of a count; known a little farther around the part.
    pub grey: Vec<i16>,
    once: Vec<i16>,
    pub twice: Vec<i16>,
    gathered: Vec<u8>,
}

impl Grain {
    pub fn new(height: usize, width: usize, step: usize) -> Self {
        let plane = vec![0; height * width];
        Self {
            height,
            width,
            step,
            grey: plane.clone(),
            once: plane.clone(),
            twice: plane,
            gathered: Vec::new(),
        }
    }

    /// Takes a part of a picture of this size.
    pub fn take(&mut self, image: ArrayView3<'_, u8>, order: Order, part: Part) {
        let far = 2 * self.step;
        let wide = self.around(part, far);
        for (y, row) in image.outer_iter().enumerate().skip(wide.rows[0]).take(wide.rows[1] - wide.rows[0]) {
            let bytes = row_bytes(&row, &mut self.gathered);
            let at = y * self.width;
            let (from, to) = (wide.cols[0], wide.cols[1]);
            grey(
                bytes.get(3 * from..3 * to).unwrap_or_default(),
                order.arrange(WEIGHTS),
                &mut self.grey[at + from..at + to],
            );
        }
        let inner = self.inside(self.around(part, self.step), self.step);
        less(&self.grey, &mut self.once, self.width, self.step, inner);
        let part = self.inside(part, far);
        less(&self.once, &mut self.twice, self.width, self.step, part);
    }

    /// A part and what lies so far around it.
    fn around(&self, part: Part, far: usize) -> Part {
        let wider = |[from, to]: [usize; 2], size: usize| [from.saturating_sub(far), (to + far).min(size)];
        Part { rows: wider(part.rows, self.height), cols: wider(part.cols, self.width) }
    }

    /// What of a part is so far from the border.
    fn inside(&self, part: Part, far: usize) -> Part {
        let less = |[from, to]: [usize; 2], size: usize| {
            let to = to.min(size.saturating_sub(far));
            [from.max(far).min(to), to]
        };
        Part { rows: less(part.rows, self.height), cols: less(part.cols, self.width) }
    }
}

/// Quarters of a count.
#[inline(always)]
fn grey_plain(bytes: &[u8], [a, b, c]: [u16; 3], out: &mut [i16]) {
    for (out, pixel) in out.iter_mut().zip(bytes.as_chunks::<3>().0) {
        let [x, y, z] = pixel.map(u16::from);
        *out = ((a * x + b * y + c * z) >> 4) as i16;
    }
}

/// Four times a pixel less its four neighbours some steps away.
#[inline(always)]
fn less_plain(from: &[i16], to: &mut [i16], width: usize, step: usize, part: Part) {
    let [c0, c1] = part.cols;
    for y in part.rows[0]..part.rows[1] {
        let at = y * width;
        let line = |row: usize, shift: usize| &from[row * width + shift..][..c1 - c0];
        let (up, down) = (line(y - step, c0), line(y + step, c0));
        let (left, here, right) = (line(y, c0 - step), line(y, c0), line(y, c0 + step));
        let out = &mut to[at + c0..at + c1];
        for k in 0..out.len() {
            let around = up[k].wrapping_add(down[k]).wrapping_add(left[k].wrapping_add(right[k]));
            out[k] = here[k].wrapping_mul(4).wrapping_sub(around);
        }
    }
}

tega_simd::dispatched! {
    /// See [`grey_plain`].
    grey = grey_plain, (bytes: &[u8], weights: [u16; 3], out: &mut [i16]) -> ()
}

tega_simd::dispatched! {
    /// See [`less_plain`].
    less = less_plain, (from: &[i16], to: &mut [i16], width: usize, step: usize, part: Part) -> ()
}
