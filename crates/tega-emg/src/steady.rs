//! What the `live` preset does beyond the printed law, so that a steady grip is a steady level.
//!
//! A block mean of EMG at constant effort scatters by about a quarter of itself, which is a whole level at full
//! effort. Three steps deal with that, each on what the one before left over:
//!
//! 1. The drive of each channel (block mean over maximum) is smoothed, and the smoothing lets go when effort changes.
//!    Scatter is independent from muscle to muscle while a change of grip moves them together, so it is the channels'
//!    joint deviation from their smoothed drives that decides; a single channel that leaves its own scatter far
//!    behind moves by itself.
//! 2. Levels change a tenth of a level beyond their borders.
//! 3. The fused level changes after two blocks in a row on the same side of it, a single step back against the
//!    change before after four.

use std::cmp::Ordering;

use crate::level::{Intervals, level_of, level_with_hysteresis};

/// Scatter of a block mean at constant effort, as a share of the mean: 0.25 to 0.34 for blocks of 20 to 200 ms,
/// because most of it is slow.
const SCATTER: f64 = 0.28;
/// Scatter at rest, as a share of the maximum: sensor noise and muscle tone.
const SCATTER_AT_REST: f64 = 0.025;
/// Joint deviation, in standard deviations, that moves the smoothed drives half way.
const JOINT_SIGMA: f64 = 1.4;
/// Deviation of one channel alone, in standard deviations, that moves its smoothed drive half way.
const SINGLE_SIGMA: f64 = 3.5;
/// Time over which drives are averaged while nothing changes.
const SMOOTHING_S: f64 = 1.0;
/// Drives beyond this multiple of the maximum say nothing more.
const DRIVE_LIMIT: f64 = 1e3;

/// Smoothed drive and level of every channel.
#[derive(Debug, Clone)]
pub(crate) struct Steady {
    rest_gain: f64,
    cut: Intervals,
    channels: Vec<Option<Channel>>,
    drives: Vec<f64>,
    deviations: Vec<f64>,
}

#[derive(Debug, Clone, Copy)]
struct Channel {
    drive: f64,
    level: u8,
}

impl Steady {
    pub(crate) fn new(block_s: f64, channels: usize, cut: Intervals) -> Self {
        Self {
            cut,
            rest_gain: block_s / (block_s + SMOOTHING_S),
            channels: vec![None; channels],
            drives: vec![0.0; channels],
            deviations: Vec::with_capacity(channels),
        }
    }

    /// Levels of one block. A channel without a vote forgets its past and gets no level (0).
    pub(crate) fn levels(&mut self, means: &[f64], maxima: &[f64], votes: &[bool], levels: &mut [u8]) {
        for ((drive, mean), maximum) in self.drives.iter_mut().zip(means).zip(maxima) {
            *drive = (mean / maximum).clamp(-DRIVE_LIMIT, DRIVE_LIMIT);
        }
        let cut = self.cut;
        let joint = response(self.joint_deviation(votes), JOINT_SIGMA).max(self.rest_gain);
        for (((channel, drive), vote), level) in
            self.channels.iter_mut().zip(&self.drives).zip(votes).zip(levels)
        {
            *channel = vote.then(|| match *channel {
                None => Channel { drive: *drive, level: level_of(*drive, 1.0, cut) },
                Some(past) => past.next(*drive, joint, cut),
            });
            *level = channel.map_or(0, |c| c.level);
        }
    }

    /// The voting channels' mean deviation from their smoothed drives, in standard deviations of that mean.
    fn joint_deviation(&mut self, votes: &[bool]) -> f64 {
        self.deviations.clear();
        for ((channel, drive), vote) in self.channels.iter().zip(&self.drives).zip(votes) {
            if let (Some(past), true) = (channel, vote) {
                self.deviations.push(past.deviation(*drive));
            }
        }
        // Summed by size, so that the order of the channels cannot matter.
        self.deviations.sort_unstable_by(f64::total_cmp);
        self.deviations.iter().sum::<f64>().abs() / (self.deviations.len().max(1) as f64).sqrt()
    }
}

impl Channel {
    fn deviation(self, drive: f64) -> f64 {
        (drive - self.drive) / (SCATTER * self.drive.max(0.0) + SCATTER_AT_REST)
    }

    fn next(self, drive: f64, joint: f64, cut: Intervals) -> Self {
        let gain = joint.max(response(self.deviation(drive), SINGLE_SIGMA));
        let drive = self.drive + gain * (drive - self.drive);
        Self { drive, level: level_with_hysteresis(drive, 1.0, self.level, cut) }
    }
}

/// How far to follow a deviation: hardly at all well below `half`, fully well above.
fn response(deviation: f64, half: f64) -> f64 {
    let ratio = deviation / half;
    let fourth = (ratio * ratio) * (ratio * ratio);
    fourth / (fourth + 1.0)
}

/// Blocks in a row beyond the present fused level, on one side, before it follows.
const BLOCKS_TO_CHANGE: u32 = 2;
/// The same for a single step back against the change before, which is what a flicker is made of.
const BLOCKS_TO_STEP_BACK: u32 = 4;

/// Lets the fused level change once enough blocks in a row ask for it; then the newest of them counts.
///
/// In a fast grip no two blocks need be alike, so blocks count together by the side they are on. Release to level 1
/// is never held up as a step back.
#[derive(Debug, Clone, Default)]
pub(crate) struct Confirm {
    present: Option<u8>,
    /// Side the last blocks were on, and how many of them there were.
    asked: (Option<Ordering>, u32),
    last_change: Option<Ordering>,
}

impl Confirm {
    pub(crate) fn pass(&mut self, level: u8) -> u8 {
        let present = *self.present.get_or_insert(level);
        let side = level.cmp(&present);
        if side == Ordering::Equal {
            self.interrupt();
            return present;
        }
        let blocks = if self.asked.0 == Some(side) { self.asked.1 + 1 } else { 1 };
        self.asked = (Some(side), blocks);
        let step_back = self.last_change == Some(side.reverse()) && level.abs_diff(present) == 1 && level > 1;
        if blocks < if step_back { BLOCKS_TO_STEP_BACK } else { BLOCKS_TO_CHANGE } {
            return present;
        }
        (self.present, self.last_change) = (Some(level), Some(side));
        self.interrupt();
        level
    }

    /// Forget what the last blocks asked for.
    pub(crate) fn interrupt(&mut self) {
        self.asked = (None, 0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Levels after each block of means, of channels that all count.
    fn levels<const N: usize>(blocks: impl IntoIterator<Item = [f64; N]>) -> Vec<[u8; N]> {
        let (mut steady, mut levels) = (Steady::new(0.1, N, Intervals::Four), [0; N]);
        let mut next = |means: [f64; N]| {
            steady.levels(&means, &[1.0; N], &[true; N], &mut levels);
            levels
        };
        blocks.into_iter().map(&mut next).collect()
    }

    #[test]
    fn scatter_about_a_border_leaves_the_level_alone() {
        // Three channels at half effort, ± a quarter of it, out of step with each other.
        let scattered = (0..200usize)
            .map(|block| [0, 1, 2].map(|c| 0.5 + 0.12 * [0.6, -1.0, 1.0, -0.6][(block * (c + 1) + c) % 4]));
        let found = levels(scattered);
        assert!(found[1..].iter().all(|levels| *levels == found[1]), "{found:?}");
    }

    #[test]
    fn a_grip_of_all_channels_and_one_of_one_are_followed_at_once() {
        assert_eq!(levels([[0.05; 3], [0.9; 3], [0.05; 3]])[1..], [[4; 3], [1; 3]]);
        assert_eq!(levels([[0.05; 3], [0.9, 0.05, 0.05]])[1], [4, 1, 1]);
    }

    #[test]
    fn opposite_changes_of_two_channels_do_not_hide_each_other() {
        assert_eq!(levels([[0.5; 2], [1.1, 0.0]])[1], [4, 2]);
    }

    fn passed(levels: &[u8]) -> Vec<u8> {
        let mut confirm = Confirm::default();
        levels.iter().map(|l| confirm.pass(*l)).collect()
    }

    #[test]
    fn a_change_needs_two_blocks_on_one_side() {
        assert_eq!(passed(&[2, 3, 2, 3, 3]), [2, 2, 2, 2, 3]);
        assert_eq!(passed(&[1, 2, 4, 5, 5]), [1, 1, 4, 4, 5]);
        assert_eq!(passed(&[3, 5, 1, 5, 1, 1]), [3, 3, 3, 3, 3, 1]);
    }

    #[test]
    fn a_step_back_needs_four_blocks_but_release_does_not() {
        assert_eq!(passed(&[1, 4, 4, 3, 3, 3, 3]), [1, 1, 4, 4, 4, 4, 3]);
        assert_eq!(passed(&[1, 4, 4, 2, 2]), [1, 1, 4, 4, 2]);
        assert_eq!(passed(&[1, 2, 2, 1, 1]), [1, 1, 2, 2, 1]);
    }

    #[test]
    fn an_interruption_starts_the_count_again() {
        let mut confirm = Confirm::default();
        assert_eq!([confirm.pass(1), confirm.pass(2)], [1, 1]);
        confirm.interrupt();
        assert_eq!([confirm.pass(2), confirm.pass(2)], [1, 2]);
    }

    #[test]
    fn huge_and_negative_drives_are_survived() {
        let mut steady = Steady::new(0.1, 2, Intervals::Four);
        let mut levels = [0; 2];
        for means in [[1e300, -1e300], [-1e300, 1e300], [0.0, 0.0], [0.0, 0.0]] {
            steady.levels(&means, &[1e-300; 2], &[true; 2], &mut levels);
        }
        assert_eq!(levels, [1, 1]);
    }
}
