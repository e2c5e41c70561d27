//! Filter a long stretch of one or two channels as several pieces at once, each in lanes of its own.
//!
//! A recursion waits for its last row, so one channel fills one lane of four and no more. Each piece but the first starts
//! early, from zero: after enough rows a filter has forgotten how it began, to the last bit as a rule. Whether it has is
//! looked at: a piece counts if the state it has at its beginning is, bit for bit, the state in which the piece before it
//! ends. What follows a piece that does not count is filtered row by row, so every result has the bits of one run.

use std::array::from_fn;
use std::f64::consts::LN_2;

use crate::bank::{BiquadBank, MARGIN, SWEEP_ROWS};
use crate::butterworth::{Section, Sos};
use crate::lanes::LANES;

/// How often over the first rows have to make what a filter began with less than the last bit of a number. By then
/// states that differ by rounding alone have met: within 2.2 times at 50 Hz of 1 kHz, order 4.
const TIMES: f64 = 4.0;
/// Rows of a piece that count, over those that it starts early by: fewer do not pay, more would leave the caches.
const SHARES: [usize; 2] = [2, 8];
/// Most rows that a piece starts early by: filters that remember longer run row by row.
const MOST_EARLY: f64 = 4096.0;

/// Rows that are handed to the lanes at a time: whole sweeps.
const BLOCK: usize = 4 * SWEEP_ROWS;

/// A filter for short and long stretches.
#[derive(Debug, Clone)]
pub(crate) struct LongBank {
    bank: BiquadBank,
    pieces: Option<Pieces>,
}

/// How a long stretch is divided, and what filters the pieces: each is a few channels of `lanes`.
#[derive(Debug, Clone)]
struct Pieces {
    /// Rows that a piece starts early by: whole blocks.
    early: usize,
    n: usize,
    channels: usize,
    lanes: BiquadBank,
}

impl LongBank {
    pub(crate) fn new(sos: &Sos, channels: usize) -> Self {
        Self { bank: BiquadBank::new(sos, channels), pieces: Pieces::of(sos, channels) }
    }

    /// As [`BiquadBank::settle`].
    pub(crate) fn settle(&mut self, channel: usize, input: f64) -> f64 {
        self.bank.settle(channel, input)
    }

    /// How many rows at least, and at most, are filtered in pieces when they come at once, if any are.
    pub(crate) fn stretch(&self) -> Option<[usize; 2]> {
        let pieces = self.pieces.as_ref()?;
        Some(SHARES.map(|share| SWEEP_ROWS + (pieces.n * share + 1) * pieces.early))
    }

    /// As [`BiquadBank::process`], whose bits these are.
    pub(crate) fn process(&mut self, rows: &[f64], out: &mut [f64]) {
        let mut done = 0;
        if let (Some([least, _]), Some(pieces)) = (self.stretch(), &self.pieces)
            && rows.len() >= least * pieces.channels
        {
            // Pieces begin where the bank has just swept.
            done = self.bank.rows_to_sweep * pieces.channels;
            self.bank.process(&rows[..done], out);
            done += pieces.filter(&mut self.bank, &rows[done..], &mut out[done..]);
        }
        self.bank.process(&rows[done..], &mut out[done..]);
    }
}

impl Pieces {
    /// None where the channels leave no lanes for a second piece, or the filter remembers too long.
    fn of(sos: &Sos, channels: usize) -> Option<Self> {
        let slowest = sos.sections().iter().map(radius).fold(0.0, f64::max);
        let early = TIMES * f64::from(f64::MANTISSA_DIGITS) * LN_2 / -slowest.ln();
        let n = LANES / channels;
        // Below 0 where rounding has put a pole on the circle.
        (n > 1 && (0.0..=MOST_EARLY).contains(&early)).then(|| {
            let (early, lanes) =
                ((early as usize + 1).next_multiple_of(BLOCK), BiquadBank::new(sos, n * channels));
            Self { early, n, channels, lanes }
        })
    }

    /// Rows that each piece of a stretch counts: whole blocks.
    fn counted(&self, rows: usize) -> usize {
        (rows.saturating_sub(self.early) / self.n) / BLOCK * BLOCK
    }

    /// Filters a stretch and says how many of its values count: those of all pieces, or those before one that does not.
    fn filter(&self, bank: &mut BiquadBank, rows: &[f64], out: &mut [f64]) -> usize {
        match self.channels {
            1 => self.filter_channels::<1>(bank, rows, out),
            _ => self.filter_channels::<2>(bank, rows, out),
        }
    }

    fn filter_channels<const CHANNELS: usize>(
        &self,
        bank: &mut BiquadBank,
        rows: &[f64],
        out: &mut [f64],
    ) -> usize {
        let (rows, out) = (rows.as_chunks::<CHANNELS>().0, out.as_chunks_mut::<CHANNELS>().0);
        let (early, n, counted) = (self.early, self.n, self.counted(rows.len()));
        let mut lanes = self.lanes.clone();
        (0..CHANNELS).for_each(|channel| lanes.take_state(channel, bank, channel));
        let mut begun = lanes.clone();
        let mut read = [[0.0; LANES]; BLOCK];
        let mut written = [0.0; BLOCK * LANES + MARGIN];
        for from in (0..early + counted).step_by(BLOCK) {
            if from == early {
                begun.clone_from(&lanes);
            }
            let parts: [_; LANES] = from_fn(|lane| &rows[lane / CHANNELS * counted + from..][..BLOCK]);
            for (i, lanes) in read.iter_mut().enumerate() {
                *lanes = from_fn(|lane| parts[lane][i][lane % CHANNELS]);
            }
            lanes.process(read.as_flattened(), &mut written);
            // What a piece computes before it counts is the piece before's.
            for piece in 0..if from < early { 1 } else { n } {
                let written = written.as_chunks::<LANES>().0.iter();
                for (row, lanes) in out[piece * counted + from..].iter_mut().zip(written) {
                    row.copy_from_slice(&lanes[piece * CHANNELS..][..CHANNELS]);
                }
            }
        }
        let counts = |lane: usize| begun.is_like(lane, &lanes, lane - CHANNELS);
        let good = (1..n).take_while(|piece| (0..CHANNELS).all(|c| counts(piece * CHANNELS + c)));
        let last = good.count();
        (0..CHANNELS).for_each(|channel| bank.take_state(channel, &lanes, last * CHANNELS + channel));
        ((last + 1) * counted + early) * CHANNELS
    }
}

/// Distance of the poles from 0: the factor by which a section forgets from row to row.
fn radius(section: &Section) -> f64 {
    let [a1, a2] = section.a;
    let discriminant = a1 * a1 - 4.0 * a2;
    if discriminant < 0.0 { a2.sqrt() } else { f64::midpoint(a1.abs(), discriminant.sqrt()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::EmgError;
    use crate::butterworth::Sos;

    /// Noise of an EMG's kind, n values.
    fn noise(n: usize) -> Vec<f64> {
        let mut seed = 1_u64;
        let mut next = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 40) as f64 / 1e3 - 8e3
        };
        (0..n).map(|_| next()).collect()
    }

    /// Rows that each piece of a test's stretch counts.
    const ROWS: usize = 20 * BLOCK;

    /// One stretch, row by row and in pieces: the rows that count, and whether all bits are the same.
    fn both(sos: &Sos, channels: usize, rows: impl Fn(usize) -> Vec<f64>) -> (usize, bool, Pieces) {
        let pieces = Pieces::of(sos, channels).unwrap();
        let rows = rows((pieces.n * ROWS + pieces.early) * channels);
        let (mut by_row, mut in_pieces) = (BiquadBank::new(sos, channels), BiquadBank::new(sos, channels));
        let (mut wanted, mut got) = (vec![0.0; rows.len() + MARGIN], vec![0.0; rows.len() + MARGIN]);
        let counted = pieces.filter(&mut in_pieces, &rows, &mut got);
        by_row.process(&rows[..counted], &mut wanted);
        let bits = |values: &[f64]| values[..counted].iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        let same_state = (0..channels).all(|channel| by_row.is_like(channel, &in_pieces, channel));
        (counted / channels, bits(&wanted) == bits(&got) && same_state, pieces)
    }

    #[test]
    fn pieces_are_one_run_bit_for_bit() -> Result<(), EmgError> {
        for channels in [1, 2] {
            for (cutoff_hz, order) in [(20.0, 2), (50.0, 1), (50.0, 4), (50.0, 8), (200.0, 3), (450.0, 4)] {
                let (counted, same, pieces) = both(&Sos::lowpass(1000.0, cutoff_hz, order)?, channels, noise);
                assert!(same, "{channels} channels, {cutoff_hz} Hz, order {order}");
                assert_eq!(counted, pieces.n * ROWS + pieces.early, "{cutoff_hz} Hz, order {order}");
            }
        }
        Ok(())
    }

    #[test]
    fn a_piece_whose_beginning_is_remembered_does_not_count() -> Result<(), EmgError> {
        // The last sample before the second piece starts, from zero: its answer has not died away where that one counts.
        let pulse = |n| {
            let mut rows = vec![0.0; n];
            rows[ROWS - 1] = 1.0;
            rows
        };
        let (counted, same, pieces) = both(&Sos::lowpass(1000.0, 50.0, 4)?, 1, pulse);
        assert!(same);
        assert_eq!(counted, ROWS + pieces.early);
        Ok(())
    }

    #[test]
    fn slow_filters_and_many_channels_run_row_by_row() -> Result<(), EmgError> {
        assert!(Pieces::of(&Sos::lowpass(1000.0, 50.0, 4)?, 3).is_none());
        for cutoff_hz in [1e-3, 1.0] {
            assert!(Pieces::of(&Sos::lowpass(1000.0, cutoff_hz, 4)?, 1).is_none());
        }
        Ok(())
    }

    #[test]
    fn a_stream_of_any_chunks_is_one_run() -> Result<(), EmgError> {
        let sos = Sos::lowpass(1000.0, 50.0, 4)?;
        let rows = noise(70_000);
        let (mut by_row, mut long) = (BiquadBank::new(&sos, 1), LongBank::new(&sos, 1));
        let (mut wanted, mut got) = (vec![0.0; rows.len() + MARGIN], vec![0.0; rows.len() + MARGIN]);
        by_row.process(&rows, &mut wanted);
        let mut from = 0;
        for n in [7, 31_000, 100, 38_893] {
            long.process(&rows[from..from + n], &mut got[from..]);
            from += n;
        }
        assert_eq!((from, got[..from] == wanted[..from]), (rows.len(), true));
        Ok(())
    }
}
