//! Borrowed colour images and the difference between a frame and its baseline.

use std::ops::Range;

use ndarray::{ArrayView2, ArrayView3, ArrayViewMut3, Axis};

use crate::error::TactileError;

/// Longest side, in pixels, for which every sum in this crate is exact.
pub const MAX_SIDE: usize = 4096;

/// Order of the three bytes of a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Order {
    /// Blue first, as `OpenCV` delivers.
    #[default]
    Bgr,
    /// Red first.
    Rgb,
}

impl Order {
    /// `(r, g, b)` arranged as the bytes of a pixel lie.
    pub(crate) fn arrange<T>(self, rgb: [T; 3]) -> [T; 3] {
        let [r, g, b] = rgb;
        match self {
            Self::Bgr => [b, g, r],
            Self::Rgb => [r, g, b],
        }
    }
}

/// How the difference between frame and baseline is taken, per channel and before weighting (readings A5, A8).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Difference {
    /// `frame - baseline`, as printed.
    #[default]
    Signed,
    /// `max(frame - baseline, 0)`.
    Rectified,
    /// `|frame - baseline|`.
    Absolute,
}

/// A frame and the baseline it is compared with: the same size, borrowed, any strides.
#[derive(Debug, Clone, Copy)]
pub struct Pair<'a> {
    frame: ArrayView3<'a, u8>,
    baseline: ArrayView3<'a, u8>,
}

impl<'a> Pair<'a> {
    /// Checks that both are `(height, width, 3)` and the same size.
    ///
    /// # Errors
    /// [`TactileError::Channels`], [`TactileError::Size`] or [`TactileError::ShapeMismatch`].
    pub fn new(frame: ArrayView3<'a, u8>, baseline: ArrayView3<'a, u8>) -> Result<Self, TactileError> {
        let (height, width, channels) = frame.dim();
        let (baseline_h, baseline_w, baseline_channels) = baseline.dim();
        if channels != 3 {
            return Err(TactileError::Channels { name: "frame", channels });
        }
        if baseline_channels != 3 {
            return Err(TactileError::Channels { name: "baseline", channels: baseline_channels });
        }
        if height == 0 || width == 0 || height > MAX_SIDE || width > MAX_SIDE {
            return Err(TactileError::Size { height, width, max: MAX_SIDE });
        }
        if (baseline_h, baseline_w) != (height, width) {
            return Err(TactileError::ShapeMismatch {
                frame_h: height,
                frame_w: width,
                baseline_h,
                baseline_w,
            });
        }
        Ok(Self { frame, baseline })
    }

    /// The frame.
    pub fn frame(&self) -> ArrayView3<'a, u8> {
        self.frame
    }

    /// The baseline.
    pub fn baseline(&self) -> ArrayView3<'a, u8> {
        self.baseline
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.frame.len_of(Axis(0))
    }

    /// Width in pixels.
    pub fn width(&self) -> usize {
        self.frame.len_of(Axis(1))
    }

    /// Calls `visit(y, frame_row, baseline_row)` for every row, top down; rows are interleaved bytes, `3 * width` long.
    ///
    /// Rows that lie contiguous in memory are lent as they are, others are gathered one at a time.
    pub(crate) fn for_each_row(&self, mut visit: impl FnMut(usize, &[u8], &[u8])) {
        let mut gathered = (Vec::new(), Vec::new());
        for (y, (frame, baseline)) in self.frame.outer_iter().zip(self.baseline.outer_iter()).enumerate() {
            let frame = row_bytes(&frame, &mut gathered.0);
            let baseline = row_bytes(&baseline, &mut gathered.1);
            visit(y, frame, baseline);
        }
    }

    /// The same images with every row contiguous in memory: as they are where they are like that, else copied.
    pub(crate) fn with_whole_rows<'s>(&'s self, copies: &'s mut [Vec<u8>; 2]) -> Pair<'s> {
        let [frame, baseline] = copies;
        Pair {
            frame: whole_rows(self.frame.view(), frame),
            baseline: whole_rows(self.baseline.view(), baseline),
        }
    }

    /// Rows `ys` of frame and baseline, of images whose rows are contiguous: interleaved bytes.
    pub(crate) fn rows(&self, ys: Range<usize>) -> impl Iterator<Item = [&'a [u8]; 2]> + use<'a> {
        let [frame, baseline] = [self.frame, self.baseline].map(lines);
        let row = |image: ArrayView2<'a, u8>, y: usize| {
            (y < image.nrows()).then(|| image.index_axis_move(Axis(0), y).to_slice()).flatten()
        };
        ys.map_while(move |y| Some([row(frame, y)?, row(baseline, y)?]))
    }

    /// Signed channel differences of one pixel; `None` outside the image.
    pub(crate) fn difference_at(&self, x: usize, y: usize, difference: Difference) -> Option<[i16; 3]> {
        let mut out = [0; 3];
        for (c, d) in out.iter_mut().enumerate() {
            *d = difference.of(*self.frame.get((y, x, c))?, *self.baseline.get((y, x, c))?);
        }
        Some(out)
    }
}

/// An image whose rows are contiguous: itself, or a copy.
pub(crate) fn whole_rows<'s>(image: ArrayView3<'s, u8>, copy: &'s mut Vec<u8>) -> ArrayView3<'s, u8> {
    if image.outer_iter().next().is_none_or(|row| row.as_slice().is_some()) {
        return image;
    }
    copy.resize(image.len(), 0);
    if let Ok(mut whole) = ArrayViewMut3::from_shape(image.dim(), &mut *copy) {
        whole.assign(&image);
    }
    ArrayView3::from_shape(image.dim(), &*copy).unwrap_or(image)
}

/// The rows of an image whose rows are contiguous, as bytes: checking that takes fewer steps than for rows of pixels.
pub(crate) fn lines(mut image: ArrayView3<'_, u8>) -> ArrayView2<'_, u8> {
    image.merge_axes(Axis(1), Axis(2));
    image.index_axis_move(Axis(1), 0)
}

pub(crate) fn row_bytes<'r>(row: &'r ArrayView2<'_, u8>, gathered: &'r mut Vec<u8>) -> &'r [u8] {
    if let Some(bytes) = row.as_slice() {
        bytes
    } else {
        gathered.clear();
        gathered.extend(row.iter());
        gathered
    }
}

impl Difference {
    /// The difference of one channel.
    #[inline]
    pub(crate) fn of(self, frame: u8, baseline: u8) -> i16 {
        let d = i16::from(frame) - i16::from(baseline);
        match self {
            Self::Signed => d,
            Self::Rectified => d.max(0),
            Self::Absolute => d.abs(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array3, s};

    #[test]
    fn sizes_and_channels_are_checked() {
        let a = Array3::<u8>::zeros((4, 5, 3));
        assert!(Pair::new(a.view(), a.view()).is_ok());
        let other = Array3::<u8>::zeros((5, 4, 3));
        assert!(matches!(Pair::new(a.view(), other.view()), Err(TactileError::ShapeMismatch { .. })));
        let grey = Array3::<u8>::zeros((4, 5, 1));
        assert!(matches!(Pair::new(a.view(), grey.view()), Err(TactileError::Channels { .. })));
        let empty = Array3::<u8>::zeros((0, 5, 3));
        assert!(matches!(Pair::new(empty.view(), empty.view()), Err(TactileError::Size { .. })));
    }

    #[test]
    fn rows_of_any_stride_read_the_same() {
        let a = Array3::from_shape_fn((3, 4, 3), |(y, x, c)| (y * 20 + x * 3 + c) as u8);
        let mut flipped = a.view();
        (0..3).for_each(|axis| flipped.invert_axis(Axis(axis)));
        let straight = flipped.to_owned();
        let mut seen = Vec::new();
        let pair = Pair::new(flipped, straight.view()).unwrap();
        pair.for_each_row(|_, f, b| seen.push(f == b));
        assert_eq!(seen, [true; 3]);
        let mut copies = [Vec::new(), Vec::new()];
        let whole = pair.with_whole_rows(&mut copies);
        assert_eq!(whole.rows(1..3).filter(|[f, b]| f == b).count(), 2);
        let mut unused = [Vec::new(), Vec::new()];
        let cut = a.slice(s![..2, 1.., ..]);
        assert_eq!(Pair::new(cut, cut).unwrap().with_whole_rows(&mut unused).rows(0..9).count(), 2);
        assert!(unused.iter().all(Vec::is_empty));
    }

    #[test]
    fn differences_do_not_wrap() {
        assert_eq!(Difference::Signed.of(90, 100), -10);
        assert_eq!(Difference::Rectified.of(90, 100), 0);
        assert_eq!(Difference::Absolute.of(90, 100), 10);
    }
}
