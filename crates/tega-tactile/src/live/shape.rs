//! The outline of a contact: all pixels where a field of one value a cell, drawn in straight lines between the cells' middles, is over a level.
//!
//! The number of pixels changes smoothly with the field: no search, no switch between one piece and two.

use std::ops::Range;

use super::cells::Grid;
use super::colour::LANES;

/// Sums over the pixels of a mask.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Moments {
    pub area: u64,
    pub x: u64,
    pub y: u64,
    pub square: u64,
}

/// Sum and sum of squares of `n` whole numbers from `first` on.
#[inline(always)]
fn powers(first: usize, n: usize) -> [u64; 2] {
    let (first, n) = (first as u64, n as u64);
    let pairs = n * n.saturating_sub(1);
    [n * first + pairs / 2, n * first * first + pairs * first + pairs * (2 * n).saturating_sub(1) / 6]
}

impl Moments {
    /// Adds a rectangle of pixels, given by its columns and rows.
    #[inline(always)]
    fn add(&mut self, columns: Range<usize>, rows: Range<usize>) {
        let (width, height) = (columns.len(), rows.len());
        let [x, x_square] = powers(columns.start, width);
        let [y, y_square] = powers(rows.start, height);
        let (width, height) = (width as u64, height as u64);
        self.area += width * height;
        self.x += height * x;
        self.y += width * y;
        self.square += height * x_square + width * y_square;
    }

    /// Mean place (x, y).
    pub fn centroid(&self) -> (f64, f64) {
        let n = self.area as f64;
        (self.x as f64 / n, self.y as f64 / n)
    }

    /// Root mean square distance from the mean place.
    pub fn spread(&self) -> f64 {
        let (x, y) = self.centroid();
        (self.square as f64 / self.area as f64 - x * x - y * y).max(0.0).sqrt()
    }
}

/// Pixels between the middles of two neighbouring cells along one side of the picture.
#[derive(Debug, Clone)]
struct Span {
    cells: [usize; 2],
    pixels: Range<usize>,
    /// Its own of [`Side::shares`].
    shares: Range<usize>,
}

/// One side of the picture, cut at the middles of its cells.
#[derive(Debug, Clone, Default)]
struct Side {
    spans: Vec<Span>,
    /// Share of the way from the middle of a pixel's first cell to that of its second; no number past the end of a span.
    shares: Vec<[f32; LANES]>,
}

impl Side {
    fn of(cells: usize, side: usize, length: usize) -> Self {
        let edge = |k: usize| match k {
            0 => 0,
            k if k > cells => length,
            k => ((k - 1) * side + side / 2).min(length),
        };
        let (mut spans, mut shares) = (Vec::with_capacity(cells + 1), vec![]);
        for k in 0..=cells {
            let (pixels, between) =
                (edge(k)..edge(k + 1), [k.saturating_sub(1), k.min(cells.saturating_sub(1))]);
            let [first, second] = between;
            let share = |pixel: usize| (pixel as f32 + 0.5) / side as f32 - 0.5 - first as f32;
            let before = shares.len();
            for start in pixels.clone().step_by(LANES) {
                shares.push(std::array::from_fn(|lane| match start + lane {
                    pixel if pixel >= pixels.end => f32::NAN,
                    pixel => {
                        if first == second {
                            0.0
                        } else {
                            share(pixel)
                        }
                    }
                }));
            }
            spans.push(Span { cells: between, pixels, shares: before..shares.len() });
        }
        Self { spans, shares }
    }

    fn shares_of(&self, span: &Span) -> &[[f32; LANES]] {
        self.shares.get(span.shares.clone()).unwrap_or_default()
    }
}

/// Outlines fields of one value a cell; made once for a grid.
#[derive(Debug, Clone, Default)]
pub(super) struct Outliner {
    cols: usize,
    down: Side,
    across: Side,
}

impl Outliner {
    /// An outliner of fields over this grid.
    pub fn of(grid: &Grid) -> Self {
        let Grid { height, width, side, rows, cols } = *grid;
        if grid.cells() == 0 {
            return Self::default();
        }
        Self { cols, down: Side::of(rows, side, height), across: Side::of(cols, side, width) }
    }

    /// Sums over the pixels above a level.
    #[inline(always)]
    fn measure(&self, field: &[f32], level: f32) -> Moments {
        self.paint(field, level, |_, _, _| {})
    }

    /// The same, and `paint` takes every run of pixels: (row, first column, last column excluded).
    #[inline(always)]
    pub fn paint(&self, field: &[f32], level: f32, mut paint: impl FnMut(usize, usize, usize)) -> Moments {
        let mut moments = Moments::default();
        let row_of = |r: usize| field.get(r * self.cols..(r + 1) * self.cols).unwrap_or_default();
        let mut upper_any = any_above(row_of(0), level);
        for below in &self.down.spans {
            let (Span { cells: [upper, lower], pixels: rows, .. }, down) =
                (below, self.down.shares_of(below));
            let (upper, lower) = (row_of(*upper), row_of(*lower));
            let lower_any = any_above(lower, level);
            if !std::mem::replace(&mut upper_any, lower_any) && !lower_any {
                continue;
            }
            // A corner of every span is one of the next span too.
            let above = |k: usize| [upper[k], lower[k]].map(|v| u8::from(v > level)).iter().sum::<u8>();
            let touched = |k: usize| above(k) > 0;
            let Some(first) = (0..self.cols).position(touched) else { continue };
            let end = (0..self.cols).rposition(touched).map_or(0, |last| last + 2);
            let spans = self.across.spans.get(first..end).unwrap_or_default();
            let mut left_above = above(first.saturating_sub(1));
            // Spans that are above the level at every corner are taken together.
            let mut whole: Option<Range<usize>> = None;
            for beside in spans {
                let Span { cells: [l, r], pixels: columns, .. } = beside;
                let right_above = above(*r);
                let corners = left_above + right_above;
                left_above = right_above;
                if corners == 4 {
                    whole.get_or_insert_with(|| columns.clone()).end = columns.end;
                    continue;
                }
                add_whole(&mut moments, whole.take(), rows, &mut paint);
                if corners == 0 {
                    continue;
                }
                let ends = [[upper[*l], lower[*l]], [upper[*r], lower[*r]]];
                for (down, first) in down.iter().zip(rows.clone().step_by(LANES)) {
                    let runs = Runs::of(ends, down, self.across.shares_of(beside), columns.len(), level);
                    runs.add(&mut moments, columns.start, first);
                    for (y, (n, skip)) in (first..).zip(runs.lengths.into_iter().zip(runs.skips)) {
                        if n > 0 {
                            let start = columns.start + skip as usize;
                            paint(y, start, start + n as usize);
                        }
                    }
                }
            }
            add_whole(&mut moments, whole, rows, &mut paint);
        }
        moments
    }
}

tega_simd::dispatched! {
    /// See [`Outliner::measure`].
    outline = Outliner::measure, (outliner: &Outliner, field: &[f32], level: f32) -> Moments
}

/// Adds columns that are above the level in all of these rows, where there are any.
#[inline(always)]
fn add_whole(
    moments: &mut Moments,
    columns: Option<Range<usize>>,
    rows: &Range<usize>,
    paint: &mut impl FnMut(usize, usize, usize),
) {
    if let Some(columns) = columns {
        rows.clone().for_each(|y| paint(y, columns.start, columns.end));
        moments.add(columns, rows.clone());
    }
}

/// Whether any value is above a level; looks at all of them, many at once.
#[inline(always)]
pub(super) fn any_above(values: &[f32], level: f32) -> bool {
    values.iter().map(|v| u32::from(*v > level)).sum::<u32>() > 0
}

/// Up to [`LANES`] rows of pixels between four cells: in each, how many pixels are above the level, and how many before them are not.
///
/// Along a row the field is a straight line: above the level on one side of it.
struct Runs {
    lengths: [u32; LANES],
    skips: [u32; LANES],
}

impl Runs {
    /// The runs between cells left and right, upper and lower, at shares of the way `down` and `across`, the latter for `width` pixels.
    #[inline(always)]
    fn of(
        [left, right]: [[f32; 2]; 2],
        down: &[f32; LANES],
        across: &[[f32; LANES]],
        width: usize,
        level: f32,
    ) -> Self {
        // A share that is no number is above nothing.
        let at = |[upper, lower]: [f32; 2]| down.map(|share| upper + share * (lower - upper));
        let (left, right) = (at(left), at(right));
        let rise: [f32; LANES] = std::array::from_fn(|lane| right[lane] - left[lane]);
        let mut lengths = [0u32; LANES];
        for share in across.as_flattened().iter().take(width) {
            for lane in 0..LANES {
                lengths[lane] += u32::from(left[lane] + share * rise[lane] > level);
            }
        }
        let mut skips = [0u32; LANES];
        for lane in 0..LANES {
            skips[lane] = if right[lane] > left[lane] { width as u32 - lengths[lane] } else { 0 };
        }
        Self { lengths, skips }
    }

    /// Adds the pixels, the first of which lies in this column and row.
    #[inline(always)]
    fn add(&self, moments: &mut Moments, column: usize, row: usize) {
        // Sums over n pixels from s on: of 1, of twice their place and of six times its square, whole in 32 bits.
        let mut sums = [0u32; 5];
        for (lane, (&n, &s)) in self.lengths.iter().zip(&self.skips).enumerate() {
            let (y, pairs) = (lane as u32, n * n - n);
            let squares = 2 * pairs * n - pairs;
            let terms = [n, 2 * n * s + pairs, n * y, 6 * (n * s * s + pairs * s) + squares, n * y * y];
            sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
        }
        let [n, x, y, x_square, y_square] = sums.map(u64::from);
        let (x, x_square) = (x / 2, x_square / 6);
        let (column, row) = (column as u64, row as u64);
        moments.area += n;
        moments.x += n * column + x;
        moments.y += n * row + y;
        moments.square += (n * column + 2 * x) * column + x_square + (n * row + 2 * y) * row + y_square;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn slow(field: &[f32], level: f32, grid: &Grid) -> (Moments, Vec<bool>) {
        let at = |pixel: usize, cells: usize| {
            let place = ((pixel as f32 + 0.5) / grid.side as f32 - 0.5).clamp(0.0, (cells - 1) as f32);
            let first = (place.floor() as usize).min(cells.saturating_sub(2));
            (first, (first + 1).min(cells - 1), place - first as f32)
        };
        let (mut moments, mut mask) = (Moments::default(), vec![]);
        for y in 0..grid.height {
            for x in 0..grid.width {
                let ((r0, r1, fy), (c0, c1, fx)) = (at(y, grid.rows), at(x, grid.cols));
                let line = |r: usize| field[r * grid.cols + c0] * (1.0 - fx) + field[r * grid.cols + c1] * fx;
                let inside = line(r0) * (1.0 - fy) + line(r1) * fy > level;
                mask.push(inside);
                if inside {
                    moments.add(x..x + 1, y..y + 1);
                }
            }
        }
        (moments, mask)
    }

    proptest! {
        #[test]
        fn pixels_are_those_of_straight_lines_between_the_cells(
            height in 1usize..90, width in 1usize..90, seed in any::<u64>(), side in 1usize..9
        ) {
            let grid = Grid { height, width, side, rows: height.div_ceil(side), cols: width.div_ceil(side) };
            let mut state = seed;
            // Values that no rounding brings near the level.
            let field: Vec<f32> = (0..grid.cells()).map(|_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                (state >> 60) as f32
            }).collect();
            let mut mask = vec![false; height * width];
            let got =
                Outliner::of(&grid).paint(&field, 7.013, |y, a, b| mask[y * width..][a..b].fill(true));
            let (wanted, slow_mask) = slow(&field, 7.013, &grid);
            prop_assert_eq!(mask, slow_mask);
            prop_assert_eq!(got, wanted);
            prop_assert_eq!(outline(&Outliner::of(&grid), &field, 7.013), wanted);
        }
    }
}
