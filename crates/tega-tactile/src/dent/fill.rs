//! Polygons on cells to pixels: scan lines, counted as they are filled.

use super::cells::Grid;
use super::outline::{Polygon, RAYS};

/// What one patch added to the mask: sums over pixels that no patch before it had.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Filled {
    pub area: u32,
    /// Sums of x, y and of x² + y².
    pub x: f64,
    pub y: f64,
    pub square: f64,
    /// First and last column and row, of all its pixels.
    pub left: usize,
    pub top: usize,
    pub right: usize,
    pub bottom: usize,
}

/// Where the outline crosses one row of pixels: the number of crossings, and the first two.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Crossings {
    count: u32,
    x: [f32; 2],
}

/// Sets the pixels whose middle is within `polygon`; `rows` is a buffer.
pub(super) fn fill(polygon: &Polygon, grid: &Grid, rows: &mut Vec<Crossings>, mask: &mut [u8]) -> Filled {
    let side = grid.side as f32;
    let points = polygon.points.map(|[x, y]| [(x + 0.5) * side - 0.5, (y + 0.5) * side - 0.5]);
    rows.clear();
    rows.resize(grid.height, Crossings::default());
    let mut before = points[RAYS - 1];
    let (mut top, mut bottom) = (grid.height, 0);
    for &point in &points {
        let ([x0, y0], [x1, y1]) = if before[1] <= point[1] { (before, point) } else { (point, before) };
        before = point;
        let (first, end) = (rounded_up(y0, grid.height), rounded_up(y1, grid.height));
        if first >= end {
            continue;
        }
        top = top.min(first);
        bottom = bottom.max(end);
        let slope = (x1 - x0) / (y1 - y0);
        for (y, row) in (first..end).zip(rows.iter_mut().skip(first)) {
            if let Some(x) = row.x.get_mut(row.count as usize) {
                *x = x0 + (y as f32 - y0) * slope;
            }
            row.count += 1;
        }
    }
    let mut filled = Filled { left: usize::MAX, top: usize::MAX, ..Filled::default() };
    for (y, crossings) in (top..bottom).zip(rows.iter().skip(top)) {
        let Some(row) = mask.get_mut(y * grid.width..(y + 1) * grid.width) else { continue };
        if crossings.count == 2 {
            let [a, b] = crossings.x;
            filled.span(row, y, a.min(b), a.max(b));
        } else {
            let mut all = [0f32; RAYS];
            for pair in cross(&points, y as f32, &mut all).chunks_exact(2) {
                filled.span(row, y, pair[0], pair[1]);
            }
        }
    }
    filled
}

/// The first integer not below `v`, within 0 to `most`.
fn rounded_up(v: f32, most: usize) -> usize {
    let down = v.max(0.0) as usize;
    (down + usize::from(v > down as f32)).min(most)
}

/// Where the polygon crosses the row, from left to right.
fn cross<'a>(points: &[[f32; 2]; RAYS], y: f32, crossings: &'a mut [f32; RAYS]) -> &'a [f32] {
    let mut n = 0;
    let mut before = points[RAYS - 1];
    for &point in points {
        let ([x0, y0], [x1, y1]) = if before[1] <= point[1] { (before, point) } else { (point, before) };
        before = point;
        if y0 <= y && y < y1 {
            crossings[n] = x0 + (y - y0) * ((x1 - x0) / (y1 - y0));
            n += 1;
        }
    }
    let found = &mut crossings[..n];
    found.sort_unstable_by(f32::total_cmp);
    found
}

impl Filled {
    /// Adds the pixels of row `y` from `from` up to `to`.
    fn span(&mut self, row: &mut [u8], y: usize, from: f32, to: f32) {
        let (first, end) = (rounded_up(from, row.len()), rounded_up(to, row.len()));
        if first >= end {
            return;
        }
        self.left = self.left.min(first);
        self.right = self.right.max(end - 1);
        self.top = self.top.min(y);
        self.bottom = self.bottom.max(y);
        let y = y as f64;
        let Some(span) = row.get_mut(first..end) else { return };
        let taken = span.iter().fold(0, |all, &m| all | m);
        if taken == 0 {
            span.fill(1);
            let (n, a, b) = ((end - first) as f64, first as f64, end as f64 - 1.0);
            // Sum of squares of a run: n (mean² + (n² - 1) / 12).
            let mean = f64::midpoint(a, b);
            self.area += (end - first) as u32;
            self.x += n * mean;
            self.y += n * y;
            self.square += n * (mean * mean + (n * n - 1.0) / 12.0 + y * y);
            return;
        }
        for (x, pixel) in (first..end).zip(span).filter(|(_, pixel)| **pixel == 0) {
            *pixel = 1;
            let x = x as f64;
            self.area += 1;
            self.x += x;
            self.y += y;
            self.square += x * x + y * y;
        }
    }
}
