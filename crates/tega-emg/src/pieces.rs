//! Filter a long stretch of one channel as four pieces at once, each in a lane of its own.
//!
//! A recursion waits for its last sample, so one channel fills one lane of four and no more. Each piece but the first starts
//! early, from zero: after enough samples a filter has forgotten how it began, to the last bit as a rule. Whether it has is
//! looked at: a piece counts if the state it has at its beginning is, bit for bit, the state in which the piece before it
//! ends. What follows a piece that does not count is filtered sample by sample, so every result has the bits of one run.

use std::array::from_fn;
use std::f64::consts::LN_2;

use crate::bank::{BiquadBank, MARGIN, SWEEP_ROWS};
use crate::butterworth::{Section, Sos};
use crate::lanes::LANES;

/// How often over the first samples have to make what a filter began with less than the last bit of a number: by then
/// states that differ by rounding alone have met as a rule.
const TIMES: f64 = 4.0;
/// Samples of a piece that count, over those that it starts early by: fewer do not pay, more would leave the caches.
const SHARES: [usize; 2] = [2, 8];
/// Most samples that a piece starts early by: filters that remember longer run sample by sample.
const MOST_EARLY: f64 = 4096.0;
/// Samples of each piece that are filtered at a time: whole sweeps.
const BLOCK: usize = 4 * SWEEP_ROWS;

/// A filter for short and long stretches.
#[derive(Debug, Clone)]
pub(crate) struct LongBank {
    bank: BiquadBank,
    pieces: Option<Pieces>,
}

/// What filters the pieces of a long stretch.
#[derive(Debug, Clone)]
struct Pieces {
    /// Samples that a piece starts early by: whole blocks.
    early: usize,
    /// The filter at rest, a piece a channel.
    lanes: BiquadBank,
}

impl LongBank {
    pub(crate) fn new(sos: &Sos, channels: usize) -> Self {
        let pieces = if channels == 1 { Pieces::of(sos) } else { None };
        Self { bank: BiquadBank::new(sos, channels), pieces }
    }

    /// As [`BiquadBank::settle`].
    pub(crate) fn settle(&mut self, channel: usize, input: f64) -> f64 {
        self.bank.settle(channel, input)
    }

    /// How many rows at least, and at most, are filtered in pieces when they come at once, if any are.
    pub(crate) fn stretch(&self) -> Option<[usize; 2]> {
        self.pieces.as_ref().map(Pieces::stretch)
    }

    /// As [`BiquadBank::process`], whose bits these are.
    pub(crate) fn process(&mut self, rows: &[f64], out: &mut [f64]) {
        let mut done = 0;
        if let Some(pieces) = &self.pieces
            && rows.len() >= pieces.stretch()[0]
        {
            // Pieces begin where the bank has just swept.
            done = self.bank.rows_to_sweep;
            self.bank.process(&rows[..done], out);
            done += pieces.filter(&mut self.bank, &rows[done..], &mut out[done..]);
        }
        self.bank.process(&rows[done..], &mut out[done..]);
    }
}

impl Pieces {
    /// None where the filter remembers too long.
    fn of(sos: &Sos) -> Option<Self> {
        let slowest = sos.sections().iter().map(radius).fold(0.0, f64::max);
        let early = TIMES * f64::from(f64::MANTISSA_DIGITS) * LN_2 / -slowest.ln();
        // Below 0 where rounding has put a pole on the circle.
        (0.0..=MOST_EARLY).contains(&early).then(|| Self {
            early: (early as usize + 1).next_multiple_of(BLOCK),
            lanes: BiquadBank::new(sos, LANES),
        })
    }

    fn stretch(&self) -> [usize; 2] {
        SHARES.map(|share| SWEEP_ROWS + (LANES * share + 1) * self.early)
    }

    /// Filters a stretch and says how many of its samples count: those of all pieces, or those before one that does not.
    fn filter(&self, bank: &mut BiquadBank, samples: &[f64], out: &mut [f64]) -> usize {
        let early = self.early;
        let counted = samples.len().saturating_sub(early) / LANES / BLOCK * BLOCK;
        let mut lanes = self.lanes.clone();
        lanes.take_state(0, bank, 0);
        let mut begun = lanes.clone();
        let mut read = [[0.0; LANES]; BLOCK];
        let mut written = [0.0; BLOCK * LANES + MARGIN];
        for from in (0..early + counted).step_by(BLOCK) {
            if from == early {
                begun.clone_from(&lanes);
            }
            let pieces: [_; LANES] = from_fn(|piece| &samples[piece * counted + from..][..BLOCK]);
            for (i, lanes) in read.iter_mut().enumerate() {
                *lanes = from_fn(|piece| pieces[piece][i]);
            }
            lanes.process(read.as_flattened(), &mut written);
            // What a piece computes before it counts is the piece before's.
            for piece in 0..if from < early { 1 } else { LANES } {
                let written = written.as_chunks::<LANES>().0.iter();
                for (sample, lanes) in out[piece * counted + from..].iter_mut().zip(written) {
                    *sample = lanes[piece];
                }
            }
        }
        let last = (1..LANES).take_while(|piece| begun.is_like(*piece, &lanes, piece - 1)).count();
        bank.take_state(0, &lanes, last);
        (last + 1) * counted + early
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

    /// Samples that each piece of a test's stretch counts.
    const COUNTED: usize = 20 * BLOCK;

    /// One stretch, sample by sample and in pieces: the samples that count, whether all bits are the same, and how early
    /// pieces start.
    fn both(sos: &Sos, samples: impl Fn(usize) -> Vec<f64>) -> (usize, bool, usize) {
        let pieces = Pieces::of(sos).unwrap();
        let samples = samples(LANES * COUNTED + pieces.early);
        let (mut by_sample, mut in_pieces) = (BiquadBank::new(sos, 1), BiquadBank::new(sos, 1));
        let (mut wanted, mut got) = (vec![0.0; samples.len() + MARGIN], vec![0.0; samples.len() + MARGIN]);
        let counted = pieces.filter(&mut in_pieces, &samples, &mut got);
        by_sample.process(&samples[..counted], &mut wanted);
        let bits = |values: &[f64]| values[..counted].iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        (counted, bits(&wanted) == bits(&got) && by_sample.is_like(0, &in_pieces, 0), pieces.early)
    }

    #[test]
    fn pieces_are_one_run_bit_for_bit() -> Result<(), EmgError> {
        for (cutoff_hz, order) in [(20.0, 2), (50.0, 1), (50.0, 4), (50.0, 8), (200.0, 3), (450.0, 4)] {
            let (counted, same, early) = both(&Sos::lowpass(1000.0, cutoff_hz, order)?, noise);
            assert!(same, "{cutoff_hz} Hz, order {order}");
            assert_eq!(counted, LANES * COUNTED + early, "{cutoff_hz} Hz, order {order}");
        }
        Ok(())
    }

    #[test]
    fn a_piece_whose_beginning_is_remembered_does_not_count() -> Result<(), EmgError> {
        // The last sample before the second piece starts, from zero: its answer has not died away where that one counts.
        let pulse = |n| {
            let mut samples = vec![0.0; n];
            samples[COUNTED - 1] = 1.0;
            samples
        };
        let (counted, same, early) = both(&Sos::lowpass(1000.0, 50.0, 4)?, pulse);
        assert!(same);
        assert_eq!(counted, COUNTED + early);
        Ok(())
    }

    #[test]
    fn slow_filters_and_more_channels_run_row_by_row() -> Result<(), EmgError> {
        for (cutoff_hz, channels) in [(50.0, 2), (1.0, 1), (1e-3, 1)] {
            let bank = LongBank::new(&Sos::lowpass(1000.0, cutoff_hz, 4)?, channels);
            assert_eq!(bank.stretch(), None, "{cutoff_hz} Hz, {channels} channels");
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
