//! The recursion: one filter run over many channels, four channels to a vector lane group.
//!
//! Transposed direct form II, each channel and sample by the same operations in the same order and without fused
//! multiply-add, so the result does not depend on how a stream is cut up nor on the processor, and compiled for AVX2 as well,
//! where four lanes are one vector.

use crate::butterworth::{MAX_SECTIONS, Section, Sos};
use crate::lanes::{LANES, LaneRows, Lanes};

/// What a buffer of rows has to be longer than its rows, so that a group of lanes can be stored whole at any row.
pub(crate) const MARGIN: usize = LANES - 1;
/// Magnitudes below this count as zero: far under any signal, far over the subnormal numbers, which are slow.
const TINY: f64 = 1e-250;
/// Rows between two sweeps that clear decayed states. Counted from the start of the stream, not of the chunk.
pub(crate) const SWEEP_ROWS: usize = 32;

/// Two delays for each section.
type GroupState = [[Lanes; 2]; MAX_SECTIONS];

/// A filter with its state for a fixed number of channels.
#[derive(Debug, Clone)]
pub(crate) struct BiquadBank {
    sections: Vec<Section>,
    channels: usize,
    groups: Vec<GroupState>,
    pub(crate) rows_to_sweep: usize,
}

impl BiquadBank {
    pub(crate) fn new(sos: &Sos, channels: usize) -> Self {
        let groups = vec![[[Lanes::ZERO; 2]; MAX_SECTIONS]; channels.div_ceil(LANES)];
        Self { sections: sos.sections().to_vec(), channels, groups, rows_to_sweep: SWEEP_ROWS }
    }

    /// Put one channel into the state it would have after an endless constant input, and say what comes out then.
    pub(crate) fn settle(&mut self, channel: usize, input: f64) -> f64 {
        let (lane, Lanes([mut x, ..])) = (channel % LANES, Lanes::all(input).without(TINY));
        let Some(group) = self.groups.get_mut(channel / LANES) else { return 0.0 };
        for (section, state) in self.sections.iter().zip(group) {
            let ([b0, b1, b2], [a1, a2]) = (section.b, section.a);
            let y = x * (((b0 + b1) + b2) / ((1.0 + a1) + a2));
            state[1].0[lane] = b2 * x - a2 * y;
            state[0].0[lane] = (b1 * x + state[1].0[lane]) - a1 * y;
            x = y;
        }
        x
    }

    /// Whether a channel's state is, bit for bit, that of another bank's channel.
    pub(crate) fn is_like(&self, channel: usize, other: &Self, its: usize) -> bool {
        self.state(channel).eq(other.state(its))
    }

    /// Put a channel into the state of another bank's channel, of the same filter.
    pub(crate) fn take_state(&mut self, channel: usize, other: &Self, its: usize) {
        let group = self.groups.get_mut(channel / LANES).into_iter().flatten().flatten();
        for (own, its) in group.zip(other.state(its)) {
            own.0[channel % LANES] = f64::from_bits(its);
        }
    }

    /// The bits of a channel's delays.
    fn state(&self, channel: usize) -> impl Iterator<Item = u64> {
        let group = self.groups.get(channel / LANES).into_iter().flatten().flatten();
        group.map(move |lanes| lanes.0[channel % LANES].to_bits())
    }

    /// Filter whole rows into `out`, which is longer than they are by [`MARGIN`]; what lies there is overwritten.
    pub(crate) fn process(&mut self, rows: &[f64], out: &mut [f64]) {
        process_rows(self, rows, out);
        let since_sweep = SWEEP_ROWS - self.rows_to_sweep + rows.len() / self.channels;
        self.rows_to_sweep = SWEEP_ROWS - since_sweep % SWEEP_ROWS;
    }
}

/// The recursion over every group of lanes.
#[inline(always)]
fn process_rows_plain(bank: &mut BiquadBank, rows: &[f64], out: &mut [f64]) {
    // A last group of fewer channels than lanes spills into the next row, so it goes first and the others write
    // over what it spilt.
    for (index, state) in bank.groups.iter_mut().enumerate().rev() {
        let at = Place { channels: bank.channels, first: index * LANES, rows_to_sweep: bank.rows_to_sweep };
        match *bank.sections {
            [a] => run([a], state, rows, out, at),
            [a, b] => run([a, b], state, rows, out, at),
            [a, b, c] => run([a, b, c], state, rows, out, at),
            [a, b, c, d] => run([a, b, c, d], state, rows, out, at),
            _ => {}
        }
    }
}

tega_simd::dispatched! {
    /// See [`process_rows_plain`].
    process_rows = process_rows_plain, (bank: &mut BiquadBank, rows: &[f64], out: &mut [f64]) -> ()
}

/// Where a group's lanes are in a row, and where in the stream the rows begin.
#[derive(Clone, Copy)]
struct Place {
    channels: usize,
    first: usize,
    rows_to_sweep: usize,
}

/// `S` sections over a group of lanes; the state stays in registers from the first row to the last.
#[inline(always)]
fn run<const S: usize>(
    sections: [Section; S],
    state: &mut GroupState,
    rows: &[f64],
    out: &mut [f64],
    at: Place,
) {
    let sections = sections.map(|s| (s.b.map(Lanes::all), s.a.map(Lanes::all)));
    // Plain indices and copies: an iterator over references would keep the state in memory, a detour that costs as
    // much as the arithmetic.
    let mut z: [[Lanes; 2]; S] = std::array::from_fn(|s| state[s]);
    let mut out = out.get_mut(at.first..).unwrap_or(&mut []);
    let mut rows = LaneRows::new(rows, at.channels, at.first);
    let mut to_sweep = at.rows_to_sweep;
    'rows: loop {
        // A loop of its own up to the next sweep keeps the sweep's comparisons out of the recursion.
        for _ in 0..to_sweep {
            let (Some(row), Some(place)) = (rows.next(), out.first_chunk_mut()) else { break 'rows };
            let mut x = row.without(TINY);
            for s in 0..S {
                let (([b0, b1, b2], [a1, a2]), [z1, z2]) = (sections[s], z[s]);
                let y = b0 * x + z1;
                z[s] = [(b1 * x + z2) - a1 * y, b2 * x - a2 * y];
                x = y;
            }
            *place = x.0;
            out = out.get_mut(at.channels..).unwrap_or(&mut []);
        }
        z = z.map(|pair| pair.map(|z| z.without(TINY)));
        to_sweep = SWEEP_ROWS;
    }
    state[..S].copy_from_slice(&z);
}

#[cfg(test)]
#[allow(clippy::float_cmp)] // Exact values are meant.
mod tests {
    use super::*;
    use crate::EmgError;

    fn filtered(bank: &mut BiquadBank, rows: &[f64]) -> Vec<f64> {
        let mut out = vec![f64::NAN; rows.len() + MARGIN];
        bank.process(rows, &mut out);
        out.truncate(rows.len());
        out
    }

    #[test]
    fn a_constant_comes_out_as_it_went_in_from_the_first_row() -> Result<(), EmgError> {
        for (rate_hz, bound) in [(200.0, 1e-14), (1e3, 1e-13), (3e4, 1e-10), (1e6, 1e-7)] {
            let mut low = BiquadBank::new(&Sos::lowpass(rate_hz, 50.0, 4)?, 1);
            let settled = low.settle(0, 2048.0);
            let rows = filtered(&mut low, &vec![2048.0; 5000]);
            assert!((settled / 2048.0 - 1.0).abs() < 1e-14);
            assert!(rows.iter().all(|y| (y / 2048.0 - 1.0).abs() < bound), "{rate_hz}");
        }
        Ok(())
    }

    #[test]
    fn a_high_pass_settled_on_an_offset_is_silent() -> Result<(), EmgError> {
        let mut high = BiquadBank::new(&Sos::highpass(1000.0, 20.0, 4)?, 1);
        assert_eq!(high.settle(0, 2048.0), 0.0);
        let rows = filtered(&mut high, &[2048.0; 1000]);
        assert!(rows.iter().all(|y| y.abs() < 1e-9));
        Ok(())
    }

    #[test]
    fn a_decayed_state_becomes_zero_and_never_subnormal() -> Result<(), EmgError> {
        let mut bank = BiquadBank::new(&Sos::lowpass(1000.0, 50.0, 4)?, 5);
        let mut rows = vec![0.0; 5 * 40_000];
        rows[..5].fill(1.0);
        rows[5 * 20_000..].fill(f64::MIN_POSITIVE / 8.0);
        let rows = filtered(&mut bank, &rows);
        assert!(rows.iter().all(|y| *y == 0.0 || y.is_normal()));
        assert!(bank.groups.iter().flatten().flatten().all(|z| *z == Lanes::ZERO));
        Ok(())
    }

    #[test]
    fn a_first_sample_that_counts_as_zero_settles_at_zero() -> Result<(), EmgError> {
        let mut bank = BiquadBank::new(&Sos::lowpass(1000.0, 50.0, 4)?, 1);
        let tiny = f64::MIN_POSITIVE / 8.0;
        assert_eq!(bank.settle(0, tiny), 0.0);
        assert_eq!(filtered(&mut bank, &[tiny; 100]), [0.0; 100]);
        Ok(())
    }

    #[test]
    fn every_channel_count_and_order_equals_the_plain_recursion_bit_for_bit() -> Result<(), EmgError> {
        for channels in 1..=9 {
            for order in 1..=8 {
                let sos = Sos::lowpass(500.0, 50.0, order)?;
                let mut bank = BiquadBank::new(&sos, channels);
                let input: Vec<f64> =
                    (0..channels * 70).map(|i| ((i * 7919) % 1013) as f64 - 500.0).collect();
                let rows = filtered(&mut bank, &input);
                for channel in 0..channels {
                    let mut wanted: Vec<f64> =
                        input.iter().skip(channel).step_by(channels).copied().collect();
                    for s in sos.sections() {
                        let (mut z1, mut z2) = (0.0, 0.0);
                        for x in &mut wanted {
                            let y = s.b[0] * *x + z1;
                            z1 = (s.b[1] * *x + z2) - s.a[0] * y;
                            z2 = s.b[2] * *x - s.a[1] * y;
                            *x = y;
                        }
                    }
                    let got: Vec<f64> = rows.iter().skip(channel).step_by(channels).copied().collect();
                    assert_eq!(got, wanted, "{channels} channels, order {order}");
                }
            }
        }
        Ok(())
    }
}
