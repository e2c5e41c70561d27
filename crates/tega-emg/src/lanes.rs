//! Rows of samples as groups of neighbouring channels, one channel to a vector lane.

/// Channels that are worked on together.
pub(crate) const LANES: usize = 4;

/// A group of numbers that are computed with lane by lane, each operation rounded by itself.
pub(crate) trait Lanes: Copy {
    fn all(x: f64) -> Self;
    fn load(from: &[f64; LANES]) -> Self;
    fn store(self, to: &mut [f64; LANES]);
    fn plus(self, other: Self) -> Self;
    fn minus(self, other: Self) -> Self;
    fn times(self, other: Self) -> Self;
    /// 0 where the magnitude is less than `limit`.
    fn without(self, limit: f64) -> Self;
}

/// The plain numbers, for every processor and as what the others have to agree with.
impl Lanes for [f64; LANES] {
    #[inline(always)]
    fn all(x: f64) -> Self {
        [x; LANES]
    }

    #[inline(always)]
    fn load(from: &[f64; LANES]) -> Self {
        *from
    }

    #[inline(always)]
    fn store(self, to: &mut [f64; LANES]) {
        *to = self;
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        std::array::from_fn(|i| self[i] + other[i])
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        std::array::from_fn(|i| self[i] - other[i])
    }

    #[inline(always)]
    fn times(self, other: Self) -> Self {
        std::array::from_fn(|i| self[i] * other[i])
    }

    #[inline(always)]
    fn without(self, limit: f64) -> Self {
        self.map(|x| if x.abs() < limit { 0.0 } else { x })
    }
}

/// The channels of each row from `first` on.
///
/// What stands in a lane beyond the last channel is of no meaning: the next row's first values, or 0 in the last row.
pub(crate) struct LaneRows<'a> {
    rows: &'a [f64],
    channels: usize,
}

impl<'a> LaneRows<'a> {
    #[inline(always)]
    pub(crate) fn new(rows: &'a [f64], channels: usize, first: usize) -> Self {
        Self { rows: rows.get(first..).unwrap_or(&[]), channels }
    }
}

impl Iterator for LaneRows<'_> {
    type Item = [f64; LANES];

    #[inline(always)]
    fn next(&mut self) -> Option<[f64; LANES]> {
        let lanes = if let Some(lanes) = self.rows.first_chunk() {
            *lanes
        } else if self.rows.is_empty() {
            return None;
        } else {
            let mut lanes = [0.0; LANES];
            lanes.iter_mut().zip(self.rows).for_each(|(lane, x)| *lane = *x);
            lanes
        };
        self.rows = self.rows.get(self.channels..).unwrap_or(&[]);
        Some(lanes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_channel_of_every_row_is_seen_once() {
        for channels in 1..=9 {
            let rows: Vec<f64> = (0..channels * 5).map(|i| i as f64).collect();
            for first in (0..channels).step_by(LANES) {
                let seen: Vec<_> = LaneRows::new(&rows, channels, first).collect();
                assert_eq!(seen.len(), 5);
                for (row, lanes) in seen.iter().enumerate() {
                    for channel in first..channels.min(first + LANES) {
                        assert_eq!(lanes[channel - first], rows[row * channels + channel]);
                    }
                }
            }
        }
    }
}
