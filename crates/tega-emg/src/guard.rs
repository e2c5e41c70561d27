//! Samples that are no samples: hold the last good value, count, and say when a channel has gone bad.

/// Magnitudes above this would overflow inside a filter and are treated like infinities.
pub const LARGEST_SAMPLE: f64 = 1e300;

/// Holds the last good value of each channel. A channel is bad once `patience` samples in a row were bad, or at an
/// infinite one, and good again once as many in a row were good.
#[derive(Debug, Clone)]
pub(crate) struct Guard {
    patience: usize,
    channels: Vec<Channel>,
    /// Every channel has had a good sample, is good, and its last sample was good: the usual case.
    calm: bool,
}

#[derive(Debug, Clone, Default)]
struct Channel {
    last: Option<f64>,
    run: usize,
    bad: bool,
    restart: bool,
    was_bad: bool,
    held: u64,
}

fn is_good(x: f64) -> bool {
    x.abs() <= LARGEST_SAMPLE
}

/// Whether no sample has to be replaced; all of them are looked at, which vectors do faster than stopping early.
fn all_good(samples: &[f64]) -> bool {
    samples.iter().fold(true, |good, x| good & is_good(*x))
}

/// The first rows in which no sample has to be replaced; looked for `held` values at a time, so that no row that has to
/// be held is looked at more than twice.
fn first_good(rows: &[f64], held: usize, width: usize) -> &[f64] {
    if rows.len() <= held {
        return if all_good(rows) { rows } else { &[] };
    }
    let at_a_time = (held / width).max(1) * width;
    &rows[..rows.chunks(at_a_time).take_while(|rows| all_good(rows)).map(<[f64]>::len).sum()]
}

impl Guard {
    /// `patience` is in samples; `usize::MAX` means a channel never goes bad.
    pub(crate) fn new(channels: usize, patience: usize) -> Self {
        Self { patience: patience.max(1), channels: vec![Channel::default(); channels], calm: false }
    }

    /// The rows to go on with: `rows` as they are, or copied into `held` with their bad samples replaced.
    ///
    /// It stops before a row at which a channel has to start afresh (its first good sample, or the first good one
    /// after it went bad), so that such a row is always the first of a call: [`Guard::restarts`] then names it.
    /// Until its first good sample a channel reads 0.
    pub(crate) fn take<'a>(&mut self, rows: &'a [f64], held: &'a mut [f64]) -> &'a [f64] {
        let width = self.channels.len();
        self.channels.iter_mut().for_each(|c| c.restart = false);
        if self.calm {
            let good = first_good(rows, held.len(), width);
            if let Some(last) = good.rchunks_exact(width).next() {
                self.channels.iter_mut().zip(last).for_each(|(c, x)| c.last = Some(*x));
                return good;
            }
        }
        self.calm = false;
        let mut taken = 0;
        for (row, out) in rows.chunks_exact(width).zip(held.chunks_exact_mut(width)) {
            if taken > 0 && self.channels.iter().zip(row).any(|(c, x)| c.must_restart(*x)) {
                return &held[..taken];
            }
            for ((channel, x), y) in self.channels.iter_mut().zip(row).zip(out) {
                *y = channel.take(*x, self.patience);
            }
            taken += width;
        }
        self.calm = self.channels.iter().all(|c| c.last.is_some() && !c.bad && c.run == 0);
        &held[..taken]
    }

    /// Channels that start afresh with the first row of the last [`Guard::take`].
    pub(crate) fn restarts(&self) -> impl Iterator<Item = usize> + '_ {
        self.channels.iter().enumerate().filter(|(_, c)| c.restart).map(|(i, _)| i)
    }

    pub(crate) fn is_bad(&self, channel: usize) -> bool {
        self.channels.get(channel).is_some_and(|c| c.bad)
    }

    /// Whether a channel was bad at any time since this was last asked.
    pub(crate) fn take_was_bad(&mut self, channel: usize) -> bool {
        self.channels.get_mut(channel).is_some_and(|c| std::mem::replace(&mut c.was_bad, c.bad))
    }

    /// Bad samples so far, by channel.
    pub(crate) fn held(&self) -> Vec<u64> {
        self.channels.iter().map(|c| c.held).collect()
    }
}

impl Channel {
    fn must_restart(&self, x: f64) -> bool {
        // While bad, `run` counts good samples: the first of them is the restart.
        is_good(x) && (self.last.is_none() || (self.bad && self.run == 0))
    }

    fn take(&mut self, x: f64, patience: usize) -> f64 {
        self.restart = self.restart || self.must_restart(x);
        let good = is_good(x);
        // `run` counts the samples in a row that contradict the present verdict.
        self.run = if good == self.bad { self.run.saturating_add(1) } else { 0 };
        if self.run >= patience {
            (self.bad, self.run) = (!self.bad, 0);
        }
        if x.is_infinite() {
            // Whoever sends it knows that the channel is at fault: nothing is waited for.
            (self.bad, self.run) = (true, 0);
        }
        self.was_bad |= self.bad;
        if good {
            self.last = Some(x);
        } else {
            self.held += 1;
        }
        self.last.unwrap_or(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOST: f64 = f64::NAN;

    fn take(guard: &mut Guard, rows: &[f64]) -> (Vec<f64>, Vec<usize>) {
        let mut held = vec![0.0; rows.len()];
        let taken = guard.take(rows, &mut held).to_vec();
        (taken, guard.restarts().collect())
    }

    #[test]
    fn a_channel_restarts_at_its_first_good_sample_and_after_having_been_bad() {
        let mut guard = Guard::new(1, 2);
        assert_eq!(take(&mut guard, &[LOST, 1.0]), (vec![0.0], vec![]));
        assert_eq!(take(&mut guard, &[1.0, 2.0]), (vec![1.0, 2.0], vec![0]));
        assert_eq!(take(&mut guard, &[3.0, LOST, 4.0]), (vec![3.0, 3.0, 4.0], vec![]));
        assert_eq!(take(&mut guard, &[LOST, LOST, 5.0]), (vec![4.0, 4.0], vec![]));
        assert!(guard.is_bad(0));
        // All good again, which alone must not be taken for business as usual.
        assert_eq!(take(&mut guard, &[5.0, 6.0, 7.0]), (vec![5.0, 6.0, 7.0], vec![0]));
        assert!(!guard.is_bad(0) && guard.take_was_bad(0) && !guard.take_was_bad(0));
        assert_eq!(guard.held(), [4]);
    }

    #[test]
    fn an_infinite_sample_makes_a_channel_bad_at_once() {
        let mut guard = Guard::new(2, 3);
        let (taken, _) = take(&mut guard, &[1.0, 1.0, f64::INFINITY, LOST, 4.0, 4.0]);
        assert_eq!(taken, [1.0, 1.0, 1.0, 1.0]);
        assert!(guard.is_bad(0) && !guard.is_bad(1));
        take(&mut guard, &[5.0; 6]);
        assert!(!guard.is_bad(0) && guard.take_was_bad(0) && !guard.take_was_bad(1));
    }

    #[test]
    fn a_bad_channel_needs_an_unbroken_run_of_good_samples() {
        let mut guard = Guard::new(1, 2);
        take(&mut guard, &[1.0]);
        take(&mut guard, &[f64::INFINITY, -2e300]);
        for sample in [2.0, LOST, 3.0] {
            take(&mut guard, &[sample]);
            assert!(guard.is_bad(0));
        }
        take(&mut guard, &[4.0]);
        assert!(!guard.is_bad(0));
    }
}
