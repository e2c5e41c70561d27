//! Eq 12 and 13: one level from the channels' levels.

use crate::error::EmgError;
use crate::level::LEVELS;
use tega_error::{OutOfRange, UnknownChoice, choice};

/// The level most channels agree on (Eq 12), else the mean of all, rounded down (Eq 13).
///
/// For three channels this is the printed rule. For any number the level with the most votes wins; where two or more
/// levels share the most votes, the mean decides.
///
/// # Errors
/// [`EmgError::NoLevels`] for an empty slice; [`EmgError::OutOfRange`] for a level that is not 1 to 5.
///
/// # Examples
/// ```
/// assert_eq!(tega_emg::fuse_levels(&[2, 2, 5])?, 2);
/// assert_eq!(tega_emg::fuse_levels(&[1, 2, 5])?, 2);
/// # Ok::<(), tega_emg::EmgError>(())
/// ```
pub fn fuse_levels(levels: &[u8]) -> Result<u8, EmgError> {
    if let Some(&level) = levels.iter().find(|l| !(1..=LEVELS).contains(*l)) {
        return Err(OutOfRange::new("level", f64::from(level), "", "1 to 5").into());
    }
    fuse(levels.iter().map(|level| (*level, 1.0)), Fusion::Floor).ok_or(EmgError::NoLevels)
}

/// How the channels' levels become one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Fusion {
    /// The level with the most votes (Eq 12); where several have as many, the mean rounded down (Eq 13).
    #[default]
    Floor,
    /// The same with the mean rounded to the nearest level, a half upward.
    Round,
    /// The median of the levels, the lower of two; no vote.
    Median,
}

impl Fusion {
    /// Read a rule from its name.
    ///
    /// # Errors
    /// [`UnknownChoice`] unless it is `floor`, `round` or `median`.
    pub fn parse(name: &str) -> Result<Self, UnknownChoice> {
        choice("fusion", name, &[("floor", Self::Floor), ("round", Self::Round), ("median", Self::Median)])
    }
}

/// Of a mean that is a whole number but for rounding, this much is forgiven.
const ROUNDING: f64 = 1e-9;

/// Fuse levels known to be 1 to 5, each with its channel's weight; no weight at all gives nothing.
pub(crate) fn fuse(levels: impl Iterator<Item = (u8, f64)>, fusion: Fusion) -> Option<u8> {
    let mut votes = [0.0; LEVELS as usize + 1];
    for (level, weight) in levels {
        votes[usize::from(level)] += weight;
    }
    let all: f64 = votes.iter().sum();
    if all <= 0.0 {
        return None;
    }
    if fusion == Fusion::Median {
        let mut below = 0.0;
        return (1..=LEVELS).find(|level| {
            below += votes[usize::from(*level)];
            below >= all / 2.0
        });
    }
    let most = votes.iter().copied().fold(0.0, f64::max);
    let mut winners = (1..=LEVELS).filter(|level| votes[usize::from(*level)] >= most);
    if let (Some(winner), None) = (winners.next(), winners.next()) {
        return Some(winner);
    }
    let sum: f64 = (1..=LEVELS).map(|level| f64::from(level) * votes[usize::from(level)]).sum();
    let half = if fusion == Fusion::Round { 0.5 } else { 0.0 };
    Some(((sum / all + half + ROUNDING).floor() as u8).clamp(1, LEVELS))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_majority_wins_and_without_one_the_mean_is_rounded_down() {
        let cases: [(&[u8], u8); 10] = [
            (&[2, 2, 5], 2),
            (&[1, 1, 5], 1),
            (&[1, 2, 5], 2),
            (&[1, 5, 5], 5),
            (&[1, 4, 5], 3),
            (&[4], 4),
            (&[2, 5], 3),
            (&[1, 1, 2, 3, 5], 1),
            (&[1, 1, 5, 5], 3),
            (&[1, 1, 4, 4, 5], 3),
        ];
        for (levels, fused) in cases {
            assert_eq!(fuse_levels(levels), Ok(fused), "{levels:?}");
        }
    }

    #[test]
    fn nothing_and_nonsense_are_named() {
        assert_eq!(fuse_levels(&[]), Err(EmgError::NoLevels));
        for level in [0, 6, 255] {
            assert!(fuse_levels(&[1, level]).is_err_and(|error| error.to_string().starts_with("level")));
        }
    }

    #[test]
    fn a_half_is_rounded_up_and_the_median_needs_no_vote() {
        let fused = |levels: &[u8], fusion| fuse(levels.iter().map(|l| (*l, 1.0)), fusion);
        assert_eq!(fused(&[1, 4, 5], Fusion::Floor), Some(3));
        assert_eq!(fused(&[1, 2, 5], Fusion::Round), Some(3));
        assert_eq!(fused(&[2, 5], Fusion::Round), Some(4));
        assert_eq!(fused(&[1, 1, 5], Fusion::Median), Some(1));
        assert_eq!(fused(&[1, 4, 5], Fusion::Median), Some(4));
        assert_eq!(fused(&[2, 5], Fusion::Median), Some(2));
        assert_eq!(fused(&[], Fusion::Median), None);
    }

    #[test]
    fn a_channel_counts_by_its_weight() {
        let fused = |fusion| fuse([(1, 1.0), (1, 1.0), (5, 3.0)].into_iter(), fusion);
        assert_eq!([Fusion::Floor, Fusion::Round, Fusion::Median].map(fused), [Some(5); 3]);
        assert_eq!(fuse([(1, 0.0), (4, 1.0)].into_iter(), Fusion::Floor), Some(4));
        assert_eq!(fuse([(3, 0.0)].into_iter(), Fusion::Floor), None);
        assert_eq!(fuse([(2, 0.1), (3, 0.1), (4, 0.1)].into_iter(), Fusion::Floor), Some(3));
    }
}
