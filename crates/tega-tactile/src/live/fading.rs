//! What a released contact leaves in the gel and how it goes back: never a contact.
//!
//! The rest that is taken again after a release has the leftover in it. As that fades, the picture goes back to the gel as it was before the contact,
//! and differs from the rest by an inverted dent. So the change of each cell from the rest towards that former gel, and not beyond it, is
//! explained for a minute: it is taken out before the picture is judged, and the rest follows it quickly, by how much of the whole dent has gone.
//! A press where the last one was goes the other way and is seen whole; beside it nothing is explained.

use super::colour::{Field, LANES, total};
use super::still::Cells;

/// How long a leftover is expected to fade, seconds.
const LASTS_S: f64 = 60.0;
/// How far past the former gel a change is explained, for the share of a broad dent that the fit of the light takes.
const PAST: f32 = 1.25;
/// How quickly the rest follows the dent that goes, seconds.
const FOLLOW_S: f64 = 0.25;
/// A leftover whose mean energy is under this, in noise units, is not followed by itself.
const LEAST_ENERGY: f32 = 1e-3;

/// A leftover that fades; nothing at first.
#[derive(Debug, Clone, Default)]
pub(super) struct Fading {
    /// The rest as it was taken less the gel before the contact, noise units, light taken out.
    whole: Field,
    /// The same in pooled cells.
    pooled: Field,
    energy: f32,
    /// Share of it that has not gone.
    share: f32,
    /// By how much the last picture shows less of it.
    gone: f32,
    left_s: f64,
}

impl Fading {
    /// Whether a leftover may still fade.
    pub fn lasts(&self) -> bool {
        self.left_s > 0.0
    }

    /// Lets time pass without contact.
    pub fn pass(&mut self, dt_s: f64) {
        self.left_s -= dt_s;
    }

    /// Forgets the leftover.
    pub fn clear(&mut self) {
        self.left_s = 0.0;
    }

    /// Begins with a rest, `after`, that was taken again where it was `before`, both in counts. What had not faded of an earlier leftover still may.
    pub fn begin(&mut self, cells: &mut Cells, before: &mut Field, after: &Field) {
        if self.lasts() {
            self.shift(cells, before, self.share);
        }
        cells.change_between(after, before);
        self.whole.clone_from(&cells.white);
        for (pooled, whole) in self.pooled.iter_mut().zip(&self.whole) {
            cells.colour.pooled(whole, &cells.grid, pooled);
        }
        self.energy = product(&self.pooled, &self.pooled);
        (self.share, self.gone, self.left_s) = (1.0, 0.0, LASTS_S);
    }

    /// Moves a gel in counts towards the one before the contact, by a share of the whole leftover.
    fn shift(&self, cells: &Cells, gel: &mut Field, share: f32) {
        for ((gel, whole), noise) in gel.iter_mut().zip(&self.whole).zip(cells.noise.arranged(cells.order)) {
            gel.iter_mut().zip(whole).for_each(|(gel, whole)| *gel -= share * noise * whole);
        }
    }

    /// Takes out of the last change what a fading leftover explains of it.
    pub fn explain(&self, white: &mut Field) {
        let most = -PAST * self.share;
        for (white, whole) in white.iter_mut().zip(&self.whole) {
            explained(white, whole, most);
        }
    }

    /// Measures how much of the dent has gone since the rest followed it last, by the pooled change as it was just judged.
    pub fn measure(&mut self, cells: &Cells) {
        let faint = self.energy < LEAST_ENERGY * cells.grid.cells() as f32;
        let gone = -product(&self.pooled, cells.colour.left()) / self.energy;
        self.gone = if faint { 0.0 } else { gone.clamp(0.0, self.share) };
    }

    /// Lets the rest follow the dent that goes.
    pub fn follow(&mut self, cells: &Cells, gel: &mut Field, dt_s: f64) {
        let step = (dt_s / (FOLLOW_S + dt_s)) as f32 * self.gone;
        if step > 0.0 {
            self.shift(cells, gel, step);
            self.share -= step;
        }
    }
}

/// Brings each change nearer to 0, by at most a share of another value of the same sign as that.
fn explained(white: &mut [f32], whole: &[f32], share: f32) {
    for (white, whole) in white.iter_mut().zip(whole) {
        let end = share * whole;
        *white -= white.clamp(end.min(0.0), end.max(0.0));
    }
}

/// Sum of the products of two fields of pooled cells: the same bits whether blue or red comes first.
fn product(a: &Field, b: &Field) -> f32 {
    let [first, middle, last] = [0, 1, 2].map(|c| total(&products(&a[c], &b[c])));
    (first + last) + middle
}

/// Products of two planes, summed side by side.
fn products(a: &[f32], b: &[f32]) -> [f32; LANES] {
    let mut sums = [0f32; LANES];
    for (a, b) in a.as_chunks::<LANES>().0.iter().zip(b.as_chunks::<LANES>().0) {
        for lane in 0..LANES {
            sums[lane] += a[lane] * b[lane];
        }
    }
    sums
}
