//! The outline of a contact: all pixels where a field of one value a cell, drawn in straight lines between the cells' middles, is over a level.
//!
//! The number of pixels changes smoothly with the field: no search, no switch between one piece and two.

use super::cells::Grid;

/// Sums over the pixels of a mask.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Moments {
    pub area: u64,
    pub x: u64,
    pub y: u64,
    pub square: u64,
}

impl Moments {
    /// Adds `n` pixels from column `x` on in a row.
    fn add_run(&mut self, x: usize, y: usize, n: usize) {
        let (x, y, n) = (x as u64, y as u64, n as u64);
        let last = n.saturating_sub(1);
        let run = n * x + n * last / 2;
        self.area += n;
        self.x += run;
        self.y += n * y;
        // Σ (x + k)² for k from 0 to n - 1, and y² each.
        self.square += n * x * x + x * n * last + n * last * (2 * last + 1) / 6 + n * y * y;
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

/// Pixels between the middles of two neighbouring cells along one side of the picture: the cells, the first pixel, the last one excluded.
#[derive(Debug, Clone, Copy)]
struct Span {
    cells: [usize; 2],
    first: usize,
    end: usize,
}

fn spans(cells: usize, side: usize, length: usize) -> impl Iterator<Item = Span> {
    let edge = move |k: usize| {
        if k == 0 {
            0
        } else if k > cells {
            length
        } else {
            ((k - 1) * side + side / 2).min(length)
        }
    };
    (0..=cells).map(move |k| Span {
        cells: [k.saturating_sub(1), k.min(cells - 1)],
        first: edge(k),
        end: edge(k + 1),
    })
}

/// Share of the way from the first cell's middle to the second's.
fn share(pixel: usize, span: &Span, side: usize) -> f32 {
    if span.cells[0] == span.cells[1] {
        return 0.0;
    }
    (pixel as f32 + 0.5) / side as f32 - 0.5 - span.cells[0] as f32
}

/// Counts the pixels above a level; `paint` is told every run of them: (row, first column, last column excluded).
pub(super) fn outline(
    field: &[f32],
    level: f32,
    grid: &Grid,
    mut paint: impl FnMut(usize, usize, usize),
) -> Moments {
    let mut moments = Moments::default();
    if grid.cells() == 0 {
        return moments;
    }
    let row_of = |r: usize| field.get(r * grid.cols..(r + 1) * grid.cols).unwrap_or_default();
    for down in spans(grid.rows, grid.side, grid.height) {
        let (upper, lower) = (row_of(down.cells[0]), row_of(down.cells[1]));
        for across in spans(grid.cols, grid.side, grid.width) {
            let [l, r] = across.cells;
            let corners = [upper[l], upper[r], lower[l], lower[r]];
            let above = corners.iter().filter(|v| **v > level).count();
            if above == 0 {
                continue;
            }
            for y in down.first..down.end {
                if above == 4 {
                    moments.add_run(across.first, y, across.end - across.first);
                    paint(y, across.first, across.end);
                    continue;
                }
                let fy = share(y, &down, grid.side);
                let (left, right) = (
                    corners[0] + fy * (corners[2] - corners[0]),
                    corners[1] + fy * (corners[3] - corners[1]),
                );
                // Along a row the field is a straight line: above the level on one side of it.
                let over = |x: usize| left + share(x, &across, grid.side) * (right - left) > level;
                let n = (across.first..across.end).filter(|x| over(*x)).count();
                if n > 0 {
                    let first = if right > left { across.end - n } else { across.first };
                    moments.add_run(first, y, n);
                    paint(y, first, first + n);
                }
            }
        }
    }
    moments
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
                    moments.add_run(x, y, 1);
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
            let got = outline(&field, 7.013, &grid, |y, a, b| mask[y * width..][a..b].fill(true));
            let (wanted, slow_mask) = slow(&field, 7.013, &grid);
            prop_assert_eq!(mask, slow_mask);
            prop_assert_eq!(got, wanted);
        }
    }
}
