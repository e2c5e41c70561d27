//! Gains of lines of cells, each the same along its line: what bands of light have.

/// Larger gains are no bands.
const MOST: f32 = 0.04;

/// Weighted sums of a line of cells each, and the gain that they make.
#[derive(Debug, Clone, Default)]
pub struct Lines {
    pub products: Vec<f32>,
    pub squares: Vec<f32>,
    pub gain: Vec<f32>,
}

impl Lines {
    pub fn clear(&mut self, n: usize) {
        for values in [&mut self.products, &mut self.squares, &mut self.gain] {
            values.clear();
            values.resize(n, 0.0);
        }
    }

    /// Gains where each line's is held against a prior of this many noise units squared.
    pub fn solve(&mut self, held: f32) {
        for ((gain, product), square) in self.gain.iter_mut().zip(&self.products).zip(&self.squares) {
            *gain = (product / (square + held)).clamp(-MOST, MOST);
        }
    }

    /// Adds to each line half of what its neighbours have.
    pub fn spread(&mut self) {
        for values in [&mut self.products, &mut self.squares] {
            let mut before = 0.0;
            for k in 0..values.len() {
                let (own, after) = (values[k], values.get(k + 1).copied().unwrap_or_default());
                values[k] = own + 0.5 * (before + after);
                before = own;
            }
        }
    }

    /// Takes the straight line out of the gains: that is a change of light.
    pub fn level(&mut self) {
        let n = self.gain.len() as f32;
        let at = |k: usize| k as f32 - 0.5 * (n - 1.0);
        let mean = self.gain.iter().sum::<f32>() / n;
        let rise = self.gain.iter().enumerate().map(|(k, g)| at(k) * g).sum::<f32>();
        let rise = rise / (n * (n * n - 1.0) / 12.0).max(f32::MIN_POSITIVE);
        self.gain.iter_mut().enumerate().for_each(|(k, g)| *g -= mean + rise * at(k));
    }
}
