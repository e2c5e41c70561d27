//! Judges channels that measure no muscle: stuck at one value, or nearly all mains.

use crate::block_mean::MAX_TAU;
use crate::chain::{check_channels, check_rows};
use crate::error::EmgError;
use crate::mains::Mains;
use tega_error::OutOfRange;

/// Fastest source that is judged; the waves of mains take room with the square of the rate.
const MAX_RATE_HZ: f64 = 100_000.0;

/// When a channel is at fault. Times are in samples.
#[derive(Debug, Clone, PartialEq)]
pub struct VoteRules {
    /// From one look to the next.
    pub hop: usize,
    /// Without any change, for a channel to be stuck.
    pub stuck: usize,
    /// Value from which a channel can be stuck, by channel.
    pub stuck_from: Vec<f64>,
    /// Without any change of any channel, for a source to be still; 0 means that it never is.
    pub still: usize,
    /// Over which mains are looked for; 0 means not at all.
    pub mains: usize,
    /// Share of a channel's power, without its mean, from which it is nearly all mains.
    pub mains_share: f64,
    /// Root mean square from which mains count, by channel, in the unit of the samples.
    pub mains_rms: Vec<f64>,
    /// Frequencies of mains, each with all its multiples; of two that fit, the last counts.
    pub lines_hz: Vec<f64>,
    /// Without a fault, until a channel has its vote back.
    pub back: usize,
}

/// What is wrong with a channel.
#[derive(Debug, Clone, Copy)]
pub enum ChannelFault {
    /// It stays at this value.
    Stuck(f64),
    /// It is nearly all mains of this frequency, Hz.
    Mains(f64),
}

impl ChannelFault {
    /// Whether both are the same, to the sign of zero.
    fn is(self, other: Self) -> bool {
        match (self, other) {
            (Self::Stuck(one), Self::Stuck(other)) | (Self::Mains(one), Self::Mains(other)) => {
                one.to_bits() == other.to_bits()
            }
            _ => false,
        }
    }
}

/// Judges the channels of one source as its samples come, at the end of every hop.
///
/// What it says is a function of the samples alone, however they are cut into chunks. Nothing is allocated once it is
/// made.
///
/// # Examples
/// ```
/// use tega_emg::{ChannelFault, ChannelVotes, VoteRules};
/// let rules = VoteRules {
///     hop: 25,
///     stuck: 100,
///     stuck_from: vec![f64::NEG_INFINITY; 2],
///     still: 20,
///     mains: 200,
///     mains_share: 0.92,
///     mains_rms: vec![4.0; 2],
///     lines_hz: vec![50.0, 60.0],
///     back: 500,
/// };
/// let mut votes = ChannelVotes::new(1000.0, rules)?;
/// // The second channel stands still.
/// let samples: Vec<f64> = (0..200).flat_map(|row| [f64::from(row * row % 97), 127.0]).collect();
/// let mut passed = Vec::new();
/// assert!(votes.take(&samples, &mut passed)?);
/// assert!(matches!(votes.faults().collect::<Vec<_>>()[..], [None, Some(ChannelFault::Stuck(127.0))]));
/// assert_eq!(passed.last(), Some(&f64::INFINITY));
/// # Ok::<(), tega_emg::EmgError>(())
/// ```
#[derive(Debug, Clone)]
pub struct ChannelVotes {
    rules: VoteRules,
    mains: Mains,
    past: Past,
    judged: Vec<Judged>,
    /// Rows so far.
    n: usize,
}

#[derive(Debug, Clone, Default)]
struct Judged {
    /// What the present look has found.
    found: Option<ChannelFault>,
    /// What has not been over for long enough.
    fault: Option<ChannelFault>,
    /// Row from which there is a vote again, without another fault.
    back_at: usize,
    /// First row of the fault.
    began: i64,
}

impl ChannelVotes {
    /// Judge a source of `rate_hz` samples per second and channel, with as many channels as the rules have values for.
    ///
    /// # Errors
    /// [`EmgError::OutOfRange`] unless there are 1 to 1024 channels, the rate is above 0 and at most 100,000 Hz, the
    /// hop is 1 sample or more, `stuck` is `still` or more, and the samples looked at are not above 10,000,000;
    /// [`EmgError::Channels`] if the rules have not as many values of one kind as of the other.
    pub fn new(rate_hz: f64, rules: VoteRules) -> Result<Self, EmgError> {
        let channels = rules.stuck_from.len();
        check_channels(channels)?;
        if rules.mains_rms.len() != channels {
            return Err(EmgError::Channels { got: rules.mains_rms.len(), wanted: channels });
        }
        if !(rate_hz > 0.0 && rate_hz <= MAX_RATE_HZ) {
            return Err(OutOfRange::new("rate_hz", rate_hz, "Hz", "above 0, at most 100000").into());
        }
        for (name, samples, fewest) in
            [("hop", rules.hop, 1), ("stuck", rules.stuck, rules.still.max(1)), ("mains", rules.mains, 0)]
        {
            if !(fewest..=MAX_TAU / channels).contains(&samples) {
                let wanted = "1 to 10000000 of all channels together, stuck not less than still";
                return Err(OutOfRange::new(name, samples as f64, "samples", wanted).into());
            }
        }
        let mains =
            Mains::new(rules.mains, rules.mains_share, rules.mains_rms.clone(), &rules.lines_hz, rate_hz);
        let past = Past::new(rules.stuck.max(rules.mains), channels);
        Ok(Self { rules, mains, past, judged: vec![Judged::default(); channels], n: 0 })
    }

    /// Judge the next rows, one column a channel; return whether any channel's fault is another than before them.
    ///
    /// `passed` becomes the rows with each channel infinite while it is at fault, from the first of these rows on that
    /// came after the last look before it was found; it is empty where no channel is at fault.
    ///
    /// # Errors
    /// [`EmgError::Ragged`] if `rows` is not a whole number of rows.
    pub fn take(&mut self, rows: &[f64], passed: &mut Vec<f64>) -> Result<bool, EmgError> {
        let channels = self.judged.len();
        check_rows(rows, channels)?;
        passed.clear();
        let (mut at, mut changed) = (0, false);
        while at < rows.len() {
            let end = rows.len().min(at + self.room() * channels);
            self.past.push(&rows[at..end]);
            self.n += (end - at) / channels;
            if self.n.is_multiple_of(self.rules.hop) {
                changed |= self.judge();
            }
            if self.judged.iter().any(|judged| judged.fault.is_some()) {
                if passed.is_empty() {
                    passed.extend_from_slice(rows);
                }
                for row in passed[at..end].chunks_exact_mut(channels) {
                    let faulty =
                        row.iter_mut().zip(&self.judged).filter(|(_, judged)| judged.fault.is_some());
                    faulty.for_each(|(x, _)| *x = f64::INFINITY);
                }
            }
            at = end;
        }
        Ok(changed)
    }

    /// Number of channels.
    pub fn channels(&self) -> usize {
        self.judged.len()
    }

    /// What is wrong with each channel.
    pub fn faults(&self) -> impl Iterator<Item = Option<ChannelFault>> + '_ {
        self.judged.iter().map(|judged| judged.fault)
    }

    /// Number of the first row of the newest fault there is; below 0 where rows before the first would belong to it.
    pub fn began(&self) -> Option<i64> {
        self.judged.iter().filter(|judged| judged.fault.is_some()).map(|judged| judged.began).max()
    }

    /// Whether no channel has changed lately: each may have been stuck since then.
    pub fn still(&self) -> bool {
        let rows = self.rules.still;
        rows > 0 && (0..self.channels()).all(|channel| self.past.unchanged(channel, rows).is_some())
    }

    /// Rows that are missing to the end of the hop.
    pub fn room(&self) -> usize {
        self.rules.hop - self.n % self.rules.hop
    }

    /// Look at what came until now; return whether any channel's fault has changed.
    fn judge(&mut self) -> bool {
        let Self { rules, mains, past, judged, n } = self;
        for (channel, judged) in judged.iter_mut().enumerate() {
            // What is not a number is not greater.
            let stuck =
                past.unchanged(channel, rules.stuck).filter(|value| *value >= rules.stuck_from[channel]);
            judged.found = stuck.map(ChannelFault::Stuck);
        }
        if rules.mains > 0 {
            mains.find(past.newest(rules.mains), |channel, line_hz| match &mut judged[channel].found {
                Some(ChannelFault::Stuck(_)) => {}
                found => *found = Some(ChannelFault::Mains(line_hz)),
            });
        }
        let mut changed = false;
        for judged in judged {
            if let Some(found) = judged.found {
                let lasted = match found {
                    ChannelFault::Stuck(_) => rules.stuck,
                    ChannelFault::Mains(_) => rules.mains,
                };
                judged.back_at = *n + rules.back;
                let before = judged.fault.replace(found);
                if before.is_none() {
                    // At the end of the hop before, it was not seen yet.
                    judged.began = *n as i64 - (rules.hop + lasted) as i64;
                }
                changed |= !before.is_some_and(|before| before.is(found));
            } else if judged.fault.is_some() && *n >= judged.back_at {
                judged.fault = None;
                changed = true;
            }
        }
        changed
    }
}

/// The newest rows, in one piece; before the first there are rows without a number.
#[derive(Debug, Clone)]
struct Past {
    channels: usize,
    /// Twice as many as are kept, so that they are moved once for all that they hold.
    values: Vec<f64>,
    end: usize,
}

impl Past {
    fn new(rows: usize, channels: usize) -> Self {
        Self { channels, values: vec![f64::NAN; 2 * rows * channels], end: rows * channels }
    }

    fn push(&mut self, mut rows: &[f64]) {
        let kept = self.values.len() / 2;
        while !rows.is_empty() {
            if self.end == self.values.len() {
                self.values.copy_within(kept.., 0);
                self.end = kept;
            }
            let (now, later) = rows.split_at(rows.len().min(self.values.len() - self.end));
            self.values[self.end..self.end + now.len()].copy_from_slice(now);
            self.end += now.len();
            rows = later;
        }
    }

    /// So many rows, no more than are kept.
    fn newest(&self, rows: usize) -> &[f64] {
        &self.values[self.end - rows * self.channels..self.end]
    }

    /// A channel's value, if it has been the same in so many rows; what is missing is not the same as anything.
    fn unchanged(&self, channel: usize, rows: usize) -> Option<f64> {
        let mut values = self.newest(rows).iter().skip(channel).step_by(self.channels).rev();
        let newest = *values.next()?;
        (!newest.is_nan() && values.all(|value| *value == newest)).then_some(newest)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn rules(channels: usize) -> VoteRules {
        VoteRules {
            hop: 5,
            stuck: 16,
            stuck_from: vec![f64::NEG_INFINITY; channels],
            still: 5,
            mains: 40,
            mains_share: 0.92,
            mains_rms: vec![1.0; channels],
            lines_hz: vec![50.0, 60.0],
            back: 20,
        }
    }

    #[test]
    fn a_vote_is_lost_at_the_end_of_a_hop_and_comes_back() -> Result<(), EmgError> {
        let (mut votes, mut passed) = (ChannelVotes::new(200.0, rules(1))?, Vec::new());
        let samples: Vec<f64> = (0..60).map(|i| if i < 12 { 7.0 } else { f64::from(i * i % 31) }).collect();
        assert!(!votes.take(&samples[..10], &mut passed)?);
        assert!(votes.still() && votes.faults().all(|fault| fault.is_none()));
        let mut stuck = vec![7.0; 10];
        assert!(votes.take(&stuck, &mut passed)?);
        assert_eq!((votes.began(), votes.room(), passed.len()), (Some(-1), 5, 10));
        assert!(passed[..5].iter().all(|x| x.is_finite()) && passed[5..].iter().all(|x| x.is_infinite()));
        // The sign of zero is kept; the value is the newest.
        stuck = vec![0.0; 20];
        stuck[19] = -0.0;
        assert!(votes.take(&stuck, &mut passed)?);
        assert!(!votes.take(&[0.5, 3.0, 1.0], &mut passed)?);
        assert!(matches!(votes.faults().next(), Some(Some(ChannelFault::Stuck(x))) if x.is_sign_negative()));
        assert!(votes.take(&samples[12..34], &mut passed)?);
        assert_eq!((votes.began(), votes.still()), (None, false));
        Ok(())
    }

    #[test]
    fn impossible_rules_are_named() {
        for wrong in [
            VoteRules { hop: 0, ..rules(1) },
            VoteRules { stuck: 4, ..rules(1) },
            VoteRules { mains: MAX_TAU + 1, ..rules(1) },
            VoteRules { stuck_from: vec![], ..rules(1) },
        ] {
            assert!(matches!(ChannelVotes::new(200.0, wrong), Err(EmgError::OutOfRange(_))));
        }
        for rate_hz in [0.0, f64::NAN, 2e5] {
            let got = ChannelVotes::new(rate_hz, rules(1));
            assert!(got.is_err_and(|error| error.to_string().starts_with("rate_hz")), "{rate_hz}");
        }
        let uneven = VoteRules { mains_rms: vec![1.0; 2], ..rules(1) };
        assert!(matches!(ChannelVotes::new(200.0, uneven), Err(EmgError::Channels { got: 2, wanted: 1 })));
    }

    fn sample() -> impl Strategy<Value = f64> {
        const ODD: [f64; 5] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -0.0];
        prop_oneof![6 => Just(127.0), 3 => -5.0..5.0, 1 => prop::sample::select(&ODD[..])]
    }

    proptest! {
        #[test]
        fn any_chunking_of_any_samples_is_judged_alike(
            (channels, samples) in (1..=9usize)
                .prop_flat_map(|n| (Just(n), prop::collection::vec(prop::collection::vec(sample(), n), 1..150))),
            chunk in 1..40usize,
        ) {
            let rows = samples.concat();
            let mut whole = ChannelVotes::new(200.0, rules(channels))?;
            let mut parts = whole.clone();
            whole.take(&rows, &mut Vec::new())?;
            for part in rows.chunks(chunk * channels) {
                parts.take(part, &mut Vec::new())?;
            }
            prop_assert_eq!(format!("{:?}", parts.judged), format!("{:?}", whole.judged));
            prop_assert_eq!((parts.began(), parts.still(), parts.room()), (whole.began(), whole.still(), whole.room()));
        }
    }
}
