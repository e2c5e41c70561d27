//! Cells of the response grouped around its peaks: a watershed from the highest cell down.
//!
//! Two basins that meet at a saddle of more than `SADDLE` of the lower peak are one.

use super::cells::Grid;
use crate::simd;

/// Cells under this response belong to nothing: the border between contact and noise.
pub(super) const LOW: f32 = 6.0;
/// Saddles above this share of the lower peak do not part two basins.
const SADDLE: f32 = 0.65;
/// Buckets of the sort, in quarters of a noise unit above `LOW`.
const BUCKETS: usize = 512;
const BUCKETS_PER_UNIT: f32 = 4.0;

/// A local maximum and, after merging, the basin it leads.
#[derive(Debug, Clone, Copy)]
pub(super) struct Peak {
    pub height: f32,
    parent: u16,
}

/// A cell above `LOW`.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Cell {
    pub x: u16,
    pub y: u16,
}

/// Which basin each cell belongs to.
#[derive(Debug, Default)]
pub(super) struct Basins {
    /// Cells above `LOW`, highest first.
    pub cells: Vec<Cell>,
    /// Peak of every cell plus one, 0 for none, with a border of one cell around the grid.
    labels: Vec<i16>,
    pub peaks: Vec<Peak>,
    buckets: Vec<u32>,
    keys: Vec<u16>,
}

impl Basins {
    /// Groups the cells of `length`.
    #[inline(never)]
    pub fn find(&mut self, length: &[f32], grid: &Grid) {
        self.sort(length, grid);
        self.labels.clear();
        self.labels.resize(grid.padded_cells(), 0);
        self.peaks.clear();
        for i in 0..self.cells.len() {
            let Some(&cell) = self.cells.get(i) else { return };
            let height = length.get(grid.index(cell)).copied().unwrap_or_default();
            self.flood(grid.padded_index(cell), height, grid.stride());
        }
    }

    /// The peak that a cell was given to, an index into `peaks`; see [`Self::lead_of`].
    #[inline]
    pub fn peak_of(&self, cell: Cell, grid: &Grid) -> Option<usize> {
        self.labels.get(grid.padded_index(cell)).and_then(|&label| (label as usize).checked_sub(1))
    }

    /// The peak that leads the basin a peak ended up in.
    pub fn lead_of(&self, peak: usize) -> usize {
        self.root(peak as i16 + 1)
    }

    /// Whether a peak leads a basin of its own.
    pub fn leads(&self, peak: usize) -> bool {
        self.peaks.get(peak).is_some_and(|p| usize::from(p.parent) == peak)
    }

    fn root(&self, label: i16) -> usize {
        let mut at = label as usize - 1;
        while let Some(peak) = self.peaks.get(at) {
            let parent = usize::from(peak.parent);
            if parent == at {
                break;
            }
            at = parent;
        }
        at
    }

    /// Gives the cell at `at` to a basin around it, or to one of its own.
    fn flood(&mut self, at: usize, height: f32, stride: usize) {
        let three = |from: usize| match self.labels.get(from..from + 3) {
            Some(&[a, b, c]) => [a, b, c],
            _ => [0; 3],
        };
        let ([a, b, c], [d, _, e], [f, g, h]) =
            (three(at - stride - 1), three(at - 1), three(at + stride - 1));
        let around = [a, b, c, d, e, f, g, h];
        let most = around.into_iter().fold(0, i16::max);
        let least = around
            .into_iter()
            .fold(i16::MAX, |least, label| least.min(if label == 0 { i16::MAX } else { label }));
        let lead = if most == 0 {
            self.peaks.push(Peak { height, parent: self.peaks.len() as u16 });
            self.peaks.len() - 1
        } else if least == most {
            self.root(most)
        } else {
            self.meet(around, height)
        };
        if let Some(label) = self.labels.get_mut(at) {
            *label = lead as i16 + 1;
        }
    }

    /// Several labels meet at a cell of this height: the highest basin takes it, and those with no saddle to speak of.
    fn meet(&mut self, around: [i16; 8], height: f32) -> usize {
        let mut roots = [0; 8];
        let mut n = 0;
        let mut before = 0;
        for label in around {
            if label != 0 && label != before {
                let root = self.root(label);
                if !roots.iter().take(n).any(|&known| known == root) {
                    roots[n] = root;
                    n += 1;
                }
                before = label;
            }
        }
        let peak = |root: usize| self.peaks.get(root).map_or(0.0, |peak| peak.height);
        let roots = roots.get(..n).unwrap_or_default();
        let lead =
            roots.iter().copied().reduce(|best, root| if peak(root) > peak(best) { root } else { best });
        let lead = lead.unwrap_or_default();
        for &root in roots.iter().filter(|&&root| root != lead) {
            if let Some(peak) = self.peaks.get_mut(root)
                && height >= SADDLE * peak.height
            {
                peak.parent = lead as u16;
            }
        }
        lead
    }

    /// Cells above `LOW` by falling height, to a quarter of a unit; equals in the order of the grid.
    fn sort(&mut self, length: &[f32], grid: &Grid) {
        self.keys.resize(grid.cells(), 0);
        simd::sort_keys(length, &mut self.keys);
        self.buckets.clear();
        self.buckets.resize(BUCKETS + 1, 0);
        for &key in &self.keys {
            if let Some(count) = self.buckets.get_mut(usize::from(key) + 1) {
                *count += 1;
            }
        }
        let mut total = 0;
        for start in &mut self.buckets {
            total += *start;
            *start = total;
        }
        self.cells.clear();
        self.cells.resize(total as usize, Cell::default());
        for (y, row) in self.keys.chunks_exact(grid.cols).enumerate() {
            for (x, &key) in row.iter().enumerate().filter(|(_, key)| **key < BUCKETS as u16) {
                let next = &mut self.buckets[usize::from(key)];
                if let Some(slot) = self.cells.get_mut(*next as usize) {
                    *slot = Cell { x: x as u16, y: y as u16 };
                }
                *next += 1;
            }
        }
    }
}

/// The bucket of every cell, lowest for the highest; [`BUCKETS`] for one under [`LOW`].
#[inline(always)]
pub(crate) fn sort_keys(length: &[f32], keys: &mut [u16]) {
    for (key, &e) in keys.iter_mut().zip(length) {
        let above = ((e - LOW) * BUCKETS_PER_UNIT).clamp(0.0, (BUCKETS - 1) as f32) as i32;
        *key = if e >= LOW { (BUCKETS as i32 - 1 - above) as u16 } else { BUCKETS as u16 };
    }
}
