//! Rows of samples as groups of neighbouring channels, one channel to a vector lane.

use std::ops::{Add, Mul, Sub};

/// Channels that are worked on together.
pub(crate) const LANES: usize = 4;

/// A group of numbers that are computed with lane by lane, each operation rounded by itself.
///
/// Plain numbers: the compiler makes vectors of them, and neither fuses multiplications with additions nor reorders them,
/// so that every processor gives the same bits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Lanes(pub(crate) [f64; LANES]);

impl Lanes {
    pub(crate) const ZERO: Self = Self([0.0; LANES]);

    #[inline(always)]
    pub(crate) fn all(x: f64) -> Self {
        Self([x; LANES])
    }

    #[inline(always)]
    pub(crate) fn over(self, divisor: f64) -> Self {
        Self(self.0.map(|x| x / divisor))
    }

    /// 0 where the magnitude is less than `limit`.
    #[inline(always)]
    pub(crate) fn without(self, limit: f64) -> Self {
        Self(self.0.map(|x| if x.abs() < limit { 0.0 } else { x }))
    }
}

impl Add for Lanes {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] + other.0[i]))
    }
}

impl Sub for Lanes {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] - other.0[i]))
    }
}

impl Mul for Lanes {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] * other.0[i]))
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
    type Item = Lanes;

    #[inline(always)]
    fn next(&mut self) -> Option<Lanes> {
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
        Some(Lanes(lanes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lanes_are_computed_one_by_one() {
        let lanes = Lanes([7.0, 1.0, -3.0, 0.0]);
        assert_eq!(lanes.over(2.0), Lanes([3.5, 0.5, -1.5, 0.0]));
        assert_eq!(lanes.without(3.0), Lanes([7.0, 0.0, -3.0, 0.0]));
    }

    #[test]
    fn every_channel_of_every_row_is_seen_once() {
        for channels in 1..=9 {
            let rows: Vec<f64> = (0..channels * 5).map(|i| i as f64).collect();
            for first in (0..channels).step_by(LANES) {
                let seen: Vec<_> = LaneRows::new(&rows, channels, first).collect();
                assert_eq!(seen.len(), 5);
                for (row, lanes) in seen.iter().enumerate() {
                    for channel in first..channels.min(first + LANES) {
                        assert_eq!(lanes.0[channel - first], rows[row * channels + channel]);
                    }
                }
            }
        }
    }
}
