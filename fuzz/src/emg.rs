//! What the muscle chain owes to any samples at all.

use tega_emg::{BlockMean, ButterworthLowpass, EmgError, GraspIntent, Kind, LEVELS, MAX_ORDER, Preset};
use tega_error::OutOfRange;

use crate::bytes::{Bytes, Target};

/// All of them.
pub const TARGETS: &[Target] = &[("emg_any_chunking_is_the_same", emg_any_chunking_is_the_same)];

/// Rows after which the filter has cleared a state that decays into the slow subnormal numbers.
const SWEEP_ROWS: usize = 32;

/// Settings and samples from a fuzzer's bytes.
struct Stream {
    channels: usize,
    samples: Vec<f64>,
    /// Rows a chunk.
    sizes: [u8; 4],
}

impl Stream {
    fn draw(bytes: &mut Bytes<'_>, channels: usize) -> Self {
        let sizes = bytes.take();
        let mut samples = vec![];
        while !bytes.0.is_empty() && samples.len() < 4096 {
            let value = match bytes.byte() % 8 {
                0 => f64::from_bits(u64::from_le_bytes(bytes.take())),
                1 => bytes.pick(&[
                    f64::NAN,
                    f64::INFINITY,
                    f64::NEG_INFINITY,
                    -0.0,
                    5e-324,
                    1e300,
                    -1.1e300,
                    f64::MAX,
                ]),
                2 => f64::from(bytes.byte()) * 1e-310,
                _ => f64::from(bytes.word() as i16),
            };
            // Runs, so that a channel can go bad and come back.
            let run = if bytes.flag() { channels * bytes.up_to(60) } else { 1 };
            samples.extend(std::iter::repeat_n(value, run.min(4096)));
        }
        samples.truncate(samples.len() / channels * channels);
        Self { channels, samples, sizes }
    }

    /// The samples cut by the drawn sizes in turn, empty chunks among them.
    fn chunks(&self) -> impl Iterator<Item = &[f64]> {
        let mut rest = &self.samples[..];
        let mut sizes = self.sizes.iter().cycle();
        let all_empty = self.sizes == [0; 4];
        std::iter::from_fn(move || {
            let rows = if all_empty { 1 } else { usize::from(*sizes.next()?) };
            let (chunk, later) = rest.split_at((rows * self.channels).min(rest.len()));
            rest = later;
            (!chunk.is_empty() || !rest.is_empty()).then_some(chunk)
        })
    }
}

/// Any bit patterns at any rate: no panic; filter, block means and intent give the same bits for the stream whole, a
/// row at a time and in chunks; levels are levels, and what the filter gives out is finite.
pub fn emg_any_chunking_is_the_same(data: &[u8]) {
    let mut bytes = Bytes(data);
    let rate_hz = if bytes.flag() {
        bytes.pick(&[200.0, 250.0, 500.0, 1000.0, 2000.0, 30_000.0, 1e6, 100.1])
    } else {
        f64::from_bits(u64::from_le_bytes(bytes.take()))
    };
    let (order, channels, tau) = (1 + bytes.up_to(MAX_ORDER - 1), 1 + bytes.up_to(8), 1 + bytes.up_to(63));
    let kind = bytes.pick(&[Kind::Raw, Kind::Rectified, Kind::Envelope]);
    let preset = bytes.pick(&[Preset::Paper, Preset::Live]);
    let maximum = if bytes.flag() {
        f64::from(bytes.word()) + 1.0
    } else {
        f64::from_bits(u64::from_le_bytes(bytes.take()))
    };
    let stream = Stream::draw(&mut bytes, channels);
    let rows: Vec<&[f64]> = stream.samples.chunks(channels).collect();
    let cuts: [Vec<&[f64]>; 3] = [vec![&stream.samples], rows, stream.chunks().collect()];

    let filtered = cuts.each_ref().map(|chunks| filter(chunks, rate_hz, order, channels, tau));
    let intended =
        cuts.each_ref().map(|chunks| intend(chunks, rate_hz, &vec![maximum; channels], tau, kind, preset));
    assert_eq!(filtered[0], filtered[1]);
    assert_eq!(filtered[0], filtered[2]);
    assert_eq!(intended[0], intended[1]);
    assert_eq!(intended[0], intended[2]);
}

/// Bits of all that comes out of the filter and of its block means.
fn filter(chunks: &[&[f64]], rate_hz: f64, order: usize, channels: usize, tau: usize) -> Option<Vec<u64>> {
    let mut lowpass = named(ButterworthLowpass::new(rate_hz, 50.0, order, channels))?;
    let mut blocks = BlockMean::new(tau, channels).unwrap();
    let (mut out, mut means) = (vec![], vec![]);
    for chunk in chunks {
        let from = out.len();
        lowpass.process(chunk, &mut out).unwrap();
        blocks.process(&out[from..], &mut means).unwrap();
    }
    let samples: usize = chunks.iter().map(|chunk| chunk.len()).sum();
    assert_eq!((out.len(), means.len()), (samples, samples / channels / tau * channels));
    assert!(out.iter().chain(&means).all(|value| value.is_finite()));
    for channel in 0..channels {
        let values: Vec<f64> = out.iter().skip(channel).step_by(channels).copied().collect();
        let longest = values.chunk_by(|a, b| a.is_subnormal() && b.is_subnormal()).map(<[f64]>::len).max();
        assert!(longest.is_none_or(|rows| rows <= SWEEP_ROWS), "{longest:?} slow rows of channel {channel}");
    }
    let held = lowpass.held_samples();
    assert!(held.iter().sum::<u64>() <= samples as u64);
    Some(out.into_iter().chain(means).map(f64::to_bits).chain(held).collect())
}

type Intended = (Vec<u8>, Vec<u8>, Vec<usize>, Vec<u64>, bool);

fn intend(
    chunks: &[&[f64]],
    rate_hz: f64,
    maxima: &[f64],
    tau: usize,
    kind: Kind,
    preset: Preset,
) -> Option<Intended> {
    let mut intent = named(GraspIntent::new(rate_hz, maxima, tau, kind, preset))?;
    let (mut fused, mut levels) = (vec![], vec![]);
    for chunk in chunks {
        let blocks = intent.process(chunk).unwrap();
        fused.extend(blocks.fused);
        levels.extend(blocks.levels);
    }
    let samples: usize = chunks.iter().map(|chunk| chunk.len()).sum();
    assert_eq!(fused.len(), samples / maxima.len() / tau);
    assert_eq!(levels.len(), fused.len() * maxima.len());
    assert!(fused.iter().all(|level| (1..=LEVELS).contains(level)));
    assert!(levels.iter().all(|level| *level <= LEVELS));
    Some((fused, levels, intent.bad_channels(), intent.held_samples(), intent.holding()))
}

/// What was made; a refusal has to say which of the drawn settings it is about.
fn named<T>(made: Result<T, EmgError>) -> Option<T> {
    match made {
        Ok(made) => Some(made),
        Err(
            EmgError::OutOfRange(OutOfRange { name: "rate_hz", .. })
            | EmgError::Cutoff { .. }
            | EmgError::UnusableMaximum { .. },
        ) => None,
        Err(error) => panic!("{error}"),
    }
}
