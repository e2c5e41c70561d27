//! Cells of the response grouped around its peaks: a watershed from the highest cell down.
//!
//! Two basins that meet at a saddle of more than `SADDLE` of the lower peak are one.

use super::cells::Grid;

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
    /// Basin of every cell plus one, 0 for none, with a border of one cell around the grid.
    labels: Vec<u16>,
    pub peaks: Vec<Peak>,
    buckets: Vec<u32>,
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

    /// Basin of a cell, an index into `peaks`.
    pub fn of(&self, cell: Cell, grid: &Grid) -> Option<usize> {
        let label = *self.labels.get(grid.padded_index(cell))?;
        (label > 0).then(|| self.root(label))
    }

    /// Whether a peak leads a basin of its own.
    pub fn leads(&self, peak: usize) -> bool {
        self.peaks.get(peak).is_some_and(|p| usize::from(p.parent) == peak)
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

    /// Gives the cell at `at` to a basin around it, or to one of its own.
    fn flood(&mut self, at: usize, height: f32, stride: usize) {
        let three = |from: usize| match self.labels.get(from..from + 3) {
            Some(&[a, b, c]) => [a, b, c],
            _ => [0; 3],
        };
        let ([a, b, c], [d, _, e], [f, g, h]) =
            (three(at - stride - 1), three(at - 1), three(at + stride - 1));
        let around = [a, b, c, d, e, f, g, h];
        let any = around.into_iter().fold(0, u16::max);
        let lead = if any == 0 {
            let lead = self.peaks.len();
            self.peaks.push(Peak { height, parent: lead as u16 });
            lead
        } else if around.into_iter().all(|label| label == 0 || label == any) {
            self.root(any)
        } else {
            self.meet(around, height)
        };
        if let Some(label) = self.labels.get_mut(at) {
            *label = lead as u16 + 1;
        }
    }

    /// Several labels meet at a cell of this height: the highest basin takes it, and those with no saddle to speak of.
    fn meet(&mut self, around: [u16; 8], height: f32) -> usize {
        let roots = around.map(|label| if label == 0 { None } else { Some(self.root(label)) });
        let peak = |root: usize| self.peaks.get(root).map_or(0.0, |peak| peak.height);
        let mut lead = None;
        for root in roots.into_iter().flatten() {
            if lead.is_none_or(|best| peak(root) > peak(best)) {
                lead = Some(root);
            }
        }
        let lead = lead.unwrap_or_default();
        for root in roots.into_iter().flatten().filter(|&root| root != lead) {
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
        self.cells.resize(count, Cell::default());
        for (y, row) in length.chunks_exact(grid.cols).enumerate() {
            for (x, &e) in row.iter().enumerate().filter(|(_, e)| **e >= LOW) {
                let next = &mut self.buckets[bucket(e)];
                if let Some(slot) = self.cells.get_mut(*next as usize) {
                    *slot = Cell { x: x as u16, y: y as u16 };
                }
                *next += 1;
            }
        }
    }
}
