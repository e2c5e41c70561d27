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

/// Sets the pixels whose middle is within `polygon`.
pub(super) fn fill(polygon: &Polygon, grid: &Grid, mask: &mut [u8]) -> Filled {
    let side = grid.side as f32;
    let points = polygon.points.map(|[x, y]| [(x + 0.5) * side - 0.5, (y + 0.5) * side - 0.5]);
    let (mut top, mut bottom) = (f32::MAX, f32::MIN);
    for [_, y] in points {
        top = top.min(y);
        bottom = bottom.max(y);
    }
    let mut filled = Filled { left: usize::MAX, top: usize::MAX, ..Filled::default() };
    let rows = top.ceil().max(0.0) as usize..((bottom.floor() + 1.0).max(0.0) as usize).min(grid.height);
    for y in rows {
        let Some(row) = mask.get_mut(y * grid.width..(y + 1) * grid.width) else { continue };
        let mut crossings = [0f32; RAYS];
        let found = cross(&points, y as f32, &mut crossings);
        for pair in found.chunks_exact(2) {
            let first = pair[0].ceil().max(0.0) as usize;
            let end = (pair[1].ceil().max(0.0) as usize).min(grid.width);
            if first < end {
                filled.add(row, y, first, end);
            }
        }
    }
    filled
}

/// Where the polygon crosses the row, from left to right.
fn cross<'a>(points: &[[f32; 2]; RAYS], y: f32, crossings: &'a mut [f32; RAYS]) -> &'a [f32] {
    let mut n = 0;
    let mut before = points[RAYS - 1];
    for &point in points {
        let ([x0, y0], [x1, y1]) = (before, point);
        if (y0 < y) != (y1 < y) {
            crossings[n] = x0 + (y - y0) * (x1 - x0) / (y1 - y0);
            n += 1;
        }
        before = point;
    }
    let found = &mut crossings[..n];
    found.sort_unstable_by(f32::total_cmp);
    found
}

impl Filled {
    fn add(&mut self, row: &mut [u8], y: usize, first: usize, end: usize) {
        self.left = self.left.min(first);
        self.right = self.right.max(end - 1);
        self.top = self.top.min(y);
        self.bottom = self.bottom.max(y);
        let y = y as f64;
        let Some(span) = row.get_mut(first..end) else { return };
        let taken: usize = span.iter().map(|&m| usize::from(m)).sum();
        if taken == 0 {
            span.fill(1);
            let (n, a, b) = ((end - first) as f64, first as f64, end as f64 - 1.0);
            let sum_x = n * (a + b) / 2.0;
            // Sum of squares of a run: n (mean² + (n² - 1) / 12).
            let mean = (a + b) / 2.0;
            self.area += (end - first) as u32;
            self.x += sum_x;
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
