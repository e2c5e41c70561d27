//! The recursion: one filter run over many channels, four channels to a vector lane group.
//!
//! Transposed direct form II, each channel and sample by the same operations in the same order and without fused
//! multiply-add, so the result does not depend on how a stream is cut up nor on the instruction set.

use crate::butterworth::{MAX_SECTIONS, Section, Sos};

const LANES: usize = 4;
/// Magnitudes below this count as zero: far under any signal, far over the subnormal numbers, which are slow.
const TINY: f64 = 1e-250;
/// Rows between two sweeps that clear decayed states. Counted from the start of the stream, not of the chunk.
const SWEEP_ROWS: usize = 32;

type Lanes = [f64; LANES];
/// Two delays for each section.
type GroupState = [[Lanes; 2]; MAX_SECTIONS];

/// A filter with its state for a fixed number of channels.
#[derive(Debug, Clone)]
pub(crate) struct BiquadBank {
    sections: Vec<Section>,
    channels: usize,
    groups: Vec<GroupState>,
    rows_to_sweep: usize,
}

impl BiquadBank {
    pub(crate) fn new(sos: &Sos, channels: usize) -> Self {
        let groups = vec![[[[0.0; LANES]; 2]; MAX_SECTIONS]; channels.div_ceil(LANES)];
        Self { sections: sos.sections().to_vec(), channels, groups, rows_to_sweep: SWEEP_ROWS }
    }

    /// Put one channel into the state it would have after an endless constant input, and say what comes out then.
    pub(crate) fn settle(&mut self, channel: usize, input: f64) -> f64 {
        let (lane, mut x) = (channel % LANES, input);
        let Some(group) = self.groups.get_mut(channel / LANES) else { return 0.0 };
        for (section, state) in self.sections.iter().zip(group) {
            let ([b0, b1, b2], [a1, a2]) = (section.b, section.a);
            let y = x * (((b0 + b1) + b2) / ((1.0 + a1) + a2));
            state[1][lane] = b2 * x - a2 * y;
            state[0][lane] = (b1 * x + state[1][lane]) - a1 * y;
            x = y;
        }
        x
    }

    /// Filter whole rows in place.
    pub(crate) fn process(&mut self, mut rows: &mut [f64]) {
        while !rows.is_empty() {
            let n = (rows.len() / self.channels).min(self.rows_to_sweep);
            let (now, later) = rows.split_at_mut(n * self.channels);
            for (index, state) in self.groups.iter_mut().enumerate() {
                let first = index * LANES;
                match (self.channels - first).min(LANES) {
                    1 => by_order::<1>(&self.sections, state, now, self.channels, first),
                    2 => by_order::<2>(&self.sections, state, now, self.channels, first),
                    3 => by_order::<3>(&self.sections, state, now, self.channels, first),
                    _ => by_order::<4>(&self.sections, state, now, self.channels, first),
                }
            }
            self.rows_to_sweep -= n;
            if self.rows_to_sweep == 0 {
                self.rows_to_sweep = SWEEP_ROWS;
                self.groups.iter_mut().flatten().flatten().flatten().for_each(|z| *z = without_tiny(*z));
            }
            rows = later;
        }
    }
}

fn without_tiny(x: f64) -> f64 {
    if x.abs() < TINY { 0.0 } else { x }
}

fn by_order<const WIDTH: usize>(
    sections: &[Section],
    state: &mut GroupState,
    rows: &mut [f64],
    channels: usize,
    first: usize,
) {
    match *sections {
        [a] => run::<1, WIDTH>([a], state, rows, channels, first),
        [a, b] => run::<2, WIDTH>([a, b], state, rows, channels, first),
        [a, b, c] => run::<3, WIDTH>([a, b, c], state, rows, channels, first),
        [a, b, c, d] => run::<4, WIDTH>([a, b, c, d], state, rows, channels, first),
        _ => {}
    }
}

/// `S` sections over `WIDTH` neighbouring channels; the state lives in registers for the whole call.
fn run<const S: usize, const WIDTH: usize>(
    sections: [Section; S],
    state: &mut GroupState,
    rows: &mut [f64],
    channels: usize,
    first: usize,
) {
    let mut z = [[[0.0; LANES]; 2]; S];
    z.copy_from_slice(&state[..S]);
    for row in rows.chunks_exact_mut(channels) {
        let lanes = &mut row[first..first + WIDTH];
        let mut x = [0.0; LANES];
        for i in 0..WIDTH {
            x[i] = without_tiny(lanes[i]);
        }
        for (section, [z1, z2]) in sections.iter().zip(&mut z) {
            let ([b0, b1, b2], [a1, a2]) = (section.b, section.a);
            for i in 0..LANES {
                let y = b0 * x[i] + z1[i];
                z1[i] = (b1 * x[i] + z2[i]) - a1 * y;
                z2[i] = b2 * x[i] - a2 * y;
                x[i] = y;
            }
        }
        lanes.copy_from_slice(&x[..WIDTH]);
    }
    state[..S].copy_from_slice(&z);
}

#[cfg(test)]
#[allow(clippy::float_cmp)] // Exact values are meant.
mod tests {
    use super::*;
    use crate::EmgError;

    #[test]
    fn a_constant_comes_out_as_it_went_in_from_the_first_row() -> Result<(), EmgError> {
        for (rate_hz, bound) in [(200.0, 1e-14), (1e3, 1e-13), (3e4, 1e-10), (1e6, 1e-7)] {
            let mut low = BiquadBank::new(&Sos::lowpass(rate_hz, 50.0, 4)?, 1);
            let settled = low.settle(0, 2048.0);
            let mut rows = vec![2048.0; 5000];
            low.process(&mut rows);
            assert!((settled / 2048.0 - 1.0).abs() < 1e-14);
            assert!(rows.iter().all(|y| (y / 2048.0 - 1.0).abs() < bound), "{rate_hz}");
        }
        Ok(())
    }

    #[test]
    fn a_high_pass_settled_on_an_offset_is_silent() -> Result<(), EmgError> {
        let mut high = BiquadBank::new(&Sos::highpass(1000.0, 20.0, 4)?, 1);
        assert_eq!(high.settle(0, 2048.0), 0.0);
        let mut rows = vec![2048.0; 1000];
        high.process(&mut rows);
        assert!(rows.iter().all(|y| y.abs() < 1e-9));
        Ok(())
    }

    #[test]
    fn a_decayed_state_becomes_zero_and_never_subnormal() -> Result<(), EmgError> {
        let mut bank = BiquadBank::new(&Sos::lowpass(1000.0, 50.0, 4)?, 5);
        let mut rows = vec![0.0; 5 * 40_000];
        rows[..5].fill(1.0);
        rows[5 * 20_000..].fill(f64::MIN_POSITIVE / 8.0);
        bank.process(&mut rows);
        assert!(rows.iter().all(|y| *y == 0.0 || y.is_normal()));
        assert!(bank.groups.iter().flatten().flatten().flatten().all(|z| *z == 0.0));
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
                let mut rows = input.clone();
                bank.process(&mut rows);
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
