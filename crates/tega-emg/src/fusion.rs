//! Eq 12 and 13: one level from the channels' levels.

use crate::error::EmgError;
use crate::level::LEVELS;

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
        return Err(EmgError::OutOfRange {
            name: "level",
            value: f64::from(level),
            unit: "",
            wanted: "1 to 5",
        });
    }
    vote(levels.iter().copied()).ok_or(EmgError::NoLevels)
}

/// The vote of levels known to be 1 to 5; nobody voting gives nothing.
pub(crate) fn vote(levels: impl Iterator<Item = u8>) -> Option<u8> {
    let mut votes = [0usize; LEVELS as usize + 1];
    let (mut sum, mut count) = (0, 0);
    for level in levels {
        votes[usize::from(level)] += 1;
        sum += usize::from(level);
        count += 1;
    }
    let most = votes.into_iter().max().unwrap_or(0);
    let mut winners = (1..=LEVELS).filter(|l| votes[usize::from(*l)] == most);
    match (count, winners.next(), winners.next()) {
        (0, _, _) => None,
        (_, Some(winner), None) => Some(winner),
        _ => Some((sum / count) as u8),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_majority_wins_and_three_different_levels_take_the_mean_rounded_down() {
        for (levels, fused) in
            [([2, 2, 5], 2), ([1, 1, 5], 1), ([1, 2, 5], 2), ([1, 5, 5], 5), ([1, 4, 5], 3)]
        {
            assert_eq!(fuse_levels(&levels), Ok(fused));
        }
    }

    #[test]
    fn any_number_of_channels_may_vote() {
        assert_eq!(fuse_levels(&[4]), Ok(4));
        assert_eq!(fuse_levels(&[2, 5]), Ok(3));
        assert_eq!(fuse_levels(&[1, 1, 2, 3, 5]), Ok(1));
        assert_eq!(fuse_levels(&[1, 1, 5, 5]), Ok(3));
        assert_eq!(fuse_levels(&[1, 1, 4, 4, 5]), Ok(3));
    }

    #[test]
    fn nothing_and_nonsense_are_named() {
        assert_eq!(fuse_levels(&[]), Err(EmgError::NoLevels));
        for level in [0, 6, 255] {
            assert!(matches!(fuse_levels(&[1, level]), Err(EmgError::OutOfRange { name: "level", .. })));
        }
    }
}
