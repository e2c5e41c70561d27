//! Sum the weighted differences of two rows of pixels: the row kernels of equations 1 to 6, for the instruction set in use.
//!
//! The plain forms are here; those written for one instruction set by hand are the files below. All compute on integers,
//! so that every path gives the same bits.

/// A kernel's difference as a constant of the row kernels.
const SIGNED: u8 = 0;
const RECTIFIED: u8 = 1;
const ABSOLUTE: u8 = 2;

/// Calls the row kernel made for a kernel's difference and squares, and for what more it is made for.
macro_rules! rows_by_reading {
    ($kernel:ident, $rows_of:ident $(::<$($more:literal),*>)? ($($arg:ident),*)) => {
        match ($kernel.difference, $kernel.squares) {
            (Difference::Signed, false) => $rows_of::<SIGNED, false $($(, $more)*)?>($kernel, $($arg),*),
            (Difference::Signed, true) => $rows_of::<SIGNED, true $($(, $more)*)?>($kernel, $($arg),*),
            (Difference::Rectified, false) => $rows_of::<RECTIFIED, false $($(, $more)*)?>($kernel, $($arg),*),
            (Difference::Rectified, true) => $rows_of::<RECTIFIED, true $($(, $more)*)?>($kernel, $($arg),*),
            (Difference::Absolute, false) => $rows_of::<ABSOLUTE, false $($(, $more)*)?>($kernel, $($arg),*),
            (Difference::Absolute, true) => $rows_of::<ABSOLUTE, true $($(, $more)*)?>($kernel, $($arg),*),
        }
    };
}

/// Calls what is made for a kernel's difference, and for what more it is made for.
macro_rules! by_reading {
    ($kernel:ident, $count_of:ident $(::<$($more:literal),*>)? ($($arg:ident),*)) => {
        match $kernel.difference {
            Difference::Signed => $count_of::<SIGNED $($(, $more)*)?>($($arg),*),
            Difference::Rectified => $count_of::<RECTIFIED $($(, $more)*)?>($($arg),*),
            Difference::Absolute => $count_of::<ABSOLUTE $($(, $more)*)?>($($arg),*),
        }
    };
}

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod factors;
#[cfg(target_arch = "aarch64")]
mod neon;

use tega_simd::{Isa, isa};

use crate::frame::Difference;

/// Pixels of the narrowest row that is read by vectors of 256 bits.
#[cfg(target_arch = "x86_64")]
const STEP: usize = 32;
/// Pixels of the largest picture whose levels are kept: more would leave the processor's caches.
#[cfg(target_arch = "x86_64")]
const MOST_KEPT: usize = 1 << 19;
/// Largest Σ|weight| for which no row sum of grey values overflows an `i32` lane (512 pixels a lane in the widest row).
pub(crate) const MAX_WEIGHT_SUM: i32 = 16_000;
/// Largest |weight|: it stays in the range of 16-bit multiplication.
pub(crate) const MAX_WEIGHT: i32 = 8_191;

/// One row of frame and baseline: interleaved bytes.
pub(crate) type Images<'r> = [&'r [u8]; 2];

/// What one row says.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Row {
    /// Σ n.
    pub sum: i64,
    /// Σ n², where asked for.
    pub squares: i64,
    /// What no n falls below: the smallest n where differences have a sign and no levels are kept, else what the
    /// weights alone say.
    pub min: i32,
    /// Largest n.
    pub max: i32,
}

/// Weights, difference and whether squares are wanted: what a row kernel needs to know.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Kernel {
    pub weights: [i32; 3],
    pub difference: Difference,
    pub squares: bool,
    /// One set of factors of the weights, where there is one.
    #[cfg(target_arch = "x86_64")]
    factors: Option<factors::Factors>,
}

impl Kernel {
    /// A kernel, for whose weights factors are sought: [`Scratch`](crate::Scratch) keeps it from frame to frame.
    pub(crate) fn new(weights: [i32; 3], difference: Difference, squares: bool) -> Self {
        Self {
            weights,
            difference,
            squares,
            #[cfg(target_arch = "x86_64")]
            factors: factors::Factors::of(weights),
        }
    }

    /// The kernel of the same weights for another difference, with squares or without.
    pub(crate) fn reading(self, difference: Difference, squares: bool) -> Self {
        Self { difference, squares, ..self }
    }

    /// The grey value of one pixel, in parts of the weights.
    #[inline(always)]
    pub(crate) fn grey(&self, frame: [u8; 3], baseline: [u8; 3]) -> i32 {
        let d = |c: usize| i32::from(self.difference.of(frame[c], baseline[c]));
        self.weights[0] * d(0) + self.weights[1] * d(1) + self.weights[2] * d(2)
    }

    /// What no grey value falls below.
    pub(crate) fn least(&self) -> i32 {
        match self.difference {
            Difference::Signed => -255 * self.reach(),
            Difference::Rectified | Difference::Absolute => {
                self.weights.iter().map(|weight| 255 * weight.min(&0)).sum()
            }
        }
    }

    /// Sums one row and adds it to the columns; the plain form that the vector forms are tested against.
    pub(crate) fn row(&self, frame: &[u8], baseline: &[u8], columns: &mut [i32]) -> Row {
        let signed = self.difference == Difference::Signed;
        let min = if signed { i32::MAX } else { self.least() };
        let mut row = Row { sum: 0, squares: 0, min, max: i32::MIN };
        let pixels = frame.as_chunks::<3>().0.iter().zip(baseline.as_chunks::<3>().0);
        for ((f, b), column) in pixels.zip(columns) {
            let n = self.grey(*f, *b);
            *column += n;
            row.sum += i64::from(n);
            if self.squares {
                row.squares += i64::from(n) * i64::from(n);
            }
            if signed {
                row.min = row.min.min(n);
            }
            row.max = row.max.max(n);
        }
        row
    }

    /// Words that the levels of a row are kept in, so that they are counted without a second reading; those that stand
    /// for no pixel are 0. Kept where that pays, and levels below 0 are rare or of no matter, as thresholds seldom are.
    #[cfg(target_arch = "x86_64")]
    pub(crate) fn kept_in_row(&self, width: usize, height: usize) -> usize {
        let pays = isa() != Isa::Baseline && self.factors.is_some() && width >= STEP;
        let least = self.difference == Difference::Signed || self.least() == 0;
        if pays && least && width * height <= MOST_KEPT { avx2::kept_in_row(width) } else { 0 }
    }

    /// Words that the levels of a row are kept in: none, since no kernel here keeps them.
    #[cfg(not(target_arch = "x86_64"))]
    #[expect(clippy::unused_self, reason = "as where levels are kept")]
    pub(crate) fn kept_in_row(&self, _width: usize, _height: usize) -> usize {
        0
    }

    /// Where a row first has a grey value.
    #[allow(unsafe_code)]
    pub(crate) fn first_place(&self, images: Images<'_>, level: i32) -> Option<usize> {
        #[cfg(target_arch = "x86_64")]
        if let width @ STEP.. = images[0].len() / 3
            && isa() == Isa::Avx2
        {
            // SAFETY: as in `rows`.
            return unsafe { avx2::first_place(self, images, width, level) };
        }
        let mut pixels = images[0].as_chunks::<3>().0.iter().zip(images[1].as_chunks::<3>().0);
        pixels.position(|(f, b)| self.grey(*f, *b) == level)
    }

    /// Number of kept levels at or above grey value `first`, 1 to 65,535.
    #[allow(unsafe_code)]
    pub(crate) fn count_kept(kept: &[u16], first: u16) -> u32 {
        #[cfg(target_arch = "x86_64")]
        if isa() == Isa::Avx2 {
            // SAFETY: as in `rows`.
            return unsafe { avx2::count_kept(kept, first) };
        }
        count_words(kept, first)
    }

    /// The same for as many rows as are asked for; the plain form as well.
    fn rows_plain<'r>(
        &self,
        images: &mut impl Iterator<Item = Images<'r>>,
        columns: &mut [i32],
        rows: &mut [Row],
    ) {
        for (row, [frame, baseline]) in rows.iter_mut().zip(images) {
            *row = self.row(frame, baseline, columns);
        }
    }

    /// Number of pixels of some rows at or above grey value `first`; the plain form.
    fn count_plain<'r>(&self, images: impl Iterator<Item = Images<'r>>, first: i32) -> u32 {
        let above = |[frame, baseline]: Images<'r>| -> u32 {
            let pixels = frame.as_chunks::<3>().0.iter().zip(baseline.as_chunks::<3>().0);
            pixels.map(|(f, b)| u32::from(self.grey(*f, *b) >= first)).sum()
        };
        images.map(above).sum()
    }

    /// [`Kernel::rows_plain`] for the instruction set in use; each of the images' rows has `columns.len()` pixels. `kept`
    /// takes the levels, [`Kernel::kept_in_row`] words a row, in an order of its own.
    #[allow(unsafe_code)]
    pub(crate) fn rows<'r>(
        &self,
        images: &mut impl Iterator<Item = Images<'r>>,
        columns: &mut [i32],
        rows: &mut [Row],
        kept: &mut [u16],
    ) {
        #[cfg(target_arch = "x86_64")]
        if isa() == Isa::Avx2 && columns.len() >= STEP {
            // SAFETY: `isa` reports a set only after the processor itself said that it has it.
            return unsafe { avx2::rows(self, images, columns, rows, kept) };
        }
        #[cfg(target_arch = "aarch64")]
        if isa() == Isa::Neon && columns.len() >= neon::LANES {
            return neon::rows(self, images, columns, rows);
        }
        let _ = kept;
        self.rows_plain(images, columns, rows);
    }

    /// [`Kernel::count_plain`] for the instruction set in use, of rows of `width` pixels. `kept` is empty, or these rows'
    /// kept levels: a step without a 65,535 has no pixel that is more.
    #[allow(unsafe_code)]
    pub(crate) fn count<'r>(
        &self,
        images: impl Iterator<Item = Images<'r>>,
        width: usize,
        kept: &[u16],
        first: i32,
    ) -> u32 {
        #[cfg(target_arch = "x86_64")]
        if isa() == Isa::Avx2 && width >= STEP {
            // SAFETY: as in `rows`.
            return unsafe { avx2::count(self, images, width, kept, first) };
        }
        #[cfg(target_arch = "aarch64")]
        if isa() == Isa::Neon && width >= neon::LANES {
            return neon::count(self, images, width, first);
        }
        let _ = (width, kept);
        self.count_plain(images, first)
    }

    /// Σ |weight|.
    pub(crate) fn reach(&self) -> i32 {
        self.weights.iter().map(|weight| weight.abs()).sum()
    }
}

/// Number of words at or above `first`.
#[inline(always)]
fn count_words(words: &[u16], first: u16) -> u32 {
    // In words, so that as many are compared at once as a vector holds.
    let count = |words: &[u16]| words.iter().map(|word| u16::from(*word >= first)).sum::<u16>();
    words.chunks(usize::from(u16::MAX)).map(|words| u32::from(count(words))).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn differences() -> impl Strategy<Value = Difference> {
        prop_oneof![Just(Difference::Signed), Just(Difference::Rectified), Just(Difference::Absolute)]
    }

    fn weights() -> impl Strategy<Value = [i32; 3]> {
        prop_oneof![
            Just([114, 587, 299]),
            Just([1, 40, 7]),
            Just([MAX_WEIGHT, -MAX_WEIGHT / 2, -MAX_WEIGHT / 3]),
            [-5000_i32..5000, -5000_i32..5000, -5000_i32..5000],
        ]
    }

    /// The pixels of frame and baseline.
    type Pixels = Vec<([u8; 3], [u8; 3])>;

    /// A width, of every tail, the pixels from one row to the next, and the pixels: any, or all near the baseline's.
    fn pictures() -> impl Strategy<Value = (usize, usize, Pixels)> {
        let sizes = (prop_oneof![1_usize..=4 * STEP, Just(240), Just(309)], 1_usize..12, 0_usize..40);
        sizes.prop_flat_map(|(width, height, gap)| {
            let near = (any::<[u8; 3]>(), 0_u8..16).prop_map(|(b, d)| (b.map(|c| c.saturating_add(d)), b));
            let n = (width + gap) * height;
            let pixels = prop_oneof![
                prop::collection::vec(any::<([u8; 3], [u8; 3])>(), n),
                prop::collection::vec(near, n),
            ];
            (Just(width), Just(width + gap), pixels)
        })
    }

    proptest! {
        #[test]
        fn the_dispatched_kernels_equal_the_plain_ones(
            (width, stride, pixels) in pictures(),
            weights in weights(),
            difference in differences(),
            squares in any::<bool>(),
            first in prop_oneof![-3_000_000_i32..3_000_000, 0_i32..70_000, 0_i32..500, Just(i32::MIN), Just(i32::MAX)],
        ) {
            let (frame, baseline): (Vec<_>, Vec<_>) = pixels.into_iter().unzip();
            let height = frame.len() / stride;
            let images = || {
                (0..height).map(|y| [&frame, &baseline].map(|image| image[y * stride..][..width].as_flattened()))
            };
            let kernel = Kernel::new(weights, difference, squares);
            let mut plain = vec![7; width];
            let mut fast = plain.clone();
            let mut wanted = vec![Row::default(); height];
            let mut rows = wanted.clone();
            kernel.rows_plain(&mut images(), &mut plain, &mut wanted);
            let mut kept = vec![7; kernel.kept_in_row(width, height) * height];
            kernel.rows(&mut images(), &mut fast, &mut rows, &mut kept);
            if !kept.is_empty() {
                for row in &mut wanted {
                    row.min = kernel.least();
                }
            }
            prop_assert_eq!(&rows, &wanted);
            let above = kernel.count_plain(images(), first);
            if !kept.is_empty() && (1..=65_535).contains(&first) {
                prop_assert_eq!(Kernel::count_kept(&kept, first as u16), above);
            }
            prop_assert_eq!(fast, plain);
            prop_assert_eq!(kernel.count(images(), width, &kept, first), above);
            for (row, images) in rows.iter().zip(images()) {
                let [frame, baseline] = images.map(|row| row.as_chunks::<3>().0);
                let place = (0..width).position(|x| kernel.grey(frame[x], baseline[x]) == row.max);
                prop_assert_eq!(kernel.first_place(images, row.max), place);
                prop_assert_eq!(kernel.first_place(images, row.max + 1), None);
            }
        }
    }

    #[test]
    fn extreme_rows_do_not_overflow() {
        for width in [4095, 4096] {
            let (frame, baseline) = (vec![255; 3 * width], vec![0; 3 * width]);
            let kernel = Kernel::new([5334, 5333, 5333], Difference::Signed, true);
            let mut rows = [Row::default(); 3];
            let images = [[&frame[..], &baseline]; 3];
            kernel.rows(&mut images.into_iter(), &mut vec![0; width], &mut rows, &mut []);
            assert_eq!(rows, [kernel.row(&frame, &baseline, &mut vec![0; width]); 3]);
            assert_eq!(rows[0].sum, width as i64 * 255 * 16_000);
            assert_eq!(Kernel::count_kept(&vec![9; width << 8], 9), (width as u32) << 8);
        }
    }
}
