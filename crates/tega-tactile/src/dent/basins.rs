//! Cells of the response grouped around its peaks: a watershed from the highest cell down.
//!
//! Two basins that meet at a saddle of more than `SADDLE` of the lower peak are one.

use super::cells::Grid;

/// Cells under this response belong to nothing: the border between contact and noise.
pub(super) const LOW: f32 = 6.0;
/// Saddles above this share of the lower peak do not part two basins.
const SADDLE: f32 = 0.55;
/// Buckets of the sort, in eighths of a noise unit above `LOW`.
const BUCKETS: usize = 2048;
const BUCKETS_PER_UNIT: f32 = 8.0;

/// A local maximum and, after merging, the basin it leads.
#[derive(Debug, Clone, Copy)]
pub(super) struct Peak {
    pub height: f32,
    /// Index of the cell.
    pub cell: usize,
    parent: u16,
}

/// Which basin each cell belongs to.
#[derive(Debug, Default)]
pub(super) struct Basins {
    /// Cells above `LOW`, highest first.
    pub cells: Vec<u32>,
    /// Basin of every cell plus one, 0 for none, with a border of one cell around the grid.
    labels: Vec<u16>,
    pub peaks: Vec<Peak>,
    buckets: Vec<u32>,
    stride: usize,
}

impl Basins {
    /// Groups the cells of `length`.
    pub fn find(&mut self, length: &[f32], grid: &Grid) {
        self.sort(length);
        self.stride = grid.cols + 2;
        self.labels.clear();
        self.labels.resize(self.stride * (grid.rows + 2), 0);
        self.peaks.clear();
        for i in 0..self.cells.len() {
            let Some(&cell) = self.cells.get(i) else { return };
            self.flood(cell as usize, length, grid);
        }
    }

    /// Basin of a cell, an index into `peaks`.
    pub fn of(&self, cell: usize, grid: &Grid) -> Option<usize> {
        let label = *self.labels.get(self.padded(cell, grid))?;
        (label > 0).then(|| self.root(label))
    }

    /// Whether a peak leads a basin of its own.
    pub fn leads(&self, peak: usize) -> bool {
        self.peaks.get(peak).is_some_and(|p| usize::from(p.parent) == peak)
    }

    fn padded(&self, cell: usize, grid: &Grid) -> usize {
        (cell / grid.cols + 1) * self.stride + cell % grid.cols + 1
    }

    fn root(&self, label: u16) -> usize {
        let mut at = usize::from(label) - 1;
        while let Some(peak) = self.peaks.get(at) {
            let parent = usize::from(peak.parent);
            if parent == at {
                break;
            }
            at = parent;
        }
        at
    }

    fn flood(&mut self, cell: usize, length: &[f32], grid: &Grid) {
        let at = self.padded(cell, grid);
        let height = length.get(cell).copied().unwrap_or_default();
        let mut highest: Option<usize> = None;
        let mut seen = [u16::MAX; 8];
        let neighbours = [
            at - self.stride - 1,
            at - self.stride,
            at - self.stride + 1,
            at - 1,
            at + 1,
            at + self.stride - 1,
            at + self.stride,
            at + self.stride + 1,
        ];
        for (neighbour, seen) in neighbours.iter().zip(&mut seen) {
            let label = self.labels.get(*neighbour).copied().unwrap_or_default();
            if label == 0 {
                continue;
            }
            let root = self.root(label);
            *seen = root as u16;
            if highest.is_none_or(|best| self.peak_of(root) > self.peak_of(best)) {
                highest = Some(root);
            }
        }
        let lead = highest.unwrap_or(self.peaks.len());
        if highest.is_none() {
            self.peaks.push(Peak { height, cell, parent: lead as u16 });
        }
        for root in seen.into_iter().filter(|&root| root != u16::MAX && usize::from(root) != lead) {
            if height >= SADDLE * self.peak_of(usize::from(root))
                && let Some(peak) = self.peaks.get_mut(usize::from(root))
            {
                peak.parent = lead as u16;
            }
        }
        if let Some(label) = self.labels.get_mut(at) {
            *label = lead as u16 + 1;
        }
    }

    fn peak_of(&self, root: usize) -> f32 {
        self.peaks.get(root).map_or(0.0, |peak| peak.height)
    }

    /// Cells above `LOW` by falling height, to an eighth of a unit; equals in the order of the grid.
    fn sort(&mut self, length: &[f32]) {
        let bucket = |e: f32| BUCKETS - 1 - (((e - LOW) * BUCKETS_PER_UNIT) as usize).min(BUCKETS - 1);
        self.buckets.clear();
        self.buckets.resize(BUCKETS + 1, 0);
        let mut count = 0;
        for &e in length.iter().filter(|&&e| e >= LOW) {
            self.buckets[bucket(e) + 1] += 1;
            count += 1;
        }
        let mut total = 0;
        for start in &mut self.buckets {
            total += *start;
            *start = total;
        }
        self.cells.clear();
        self.cells.resize(count, 0);
        for (cell, &e) in length.iter().enumerate().filter(|(_, e)| **e >= LOW) {
            let next = &mut self.buckets[bucket(e)];
            if let Some(slot) = self.cells.get_mut(*next as usize) {
                *slot = cell as u32;
            }
            *next += 1;
        }
    }
}
