//! A stream gives the same bits however it is cut.

use proptest::prelude::*;
use tega_emg::{BlockMean, ButterworthLowpass, EmgError, GraspIntent, Kind, Preset};

const CHANNELS: usize = 3;

/// Rows of samples in chunks; single samples are lost, and one channel for a while.
fn chunks() -> impl Strategy<Value = Vec<Vec<f64>>> {
    let sample = prop_oneof![30 => -1e4..1e4, 1 => Just(f64::NAN), 1 => Just(f64::INFINITY), 1 => Just(0.0)];
    let chunk =
        (0..90usize).prop_flat_map(move |rows| prop::collection::vec(sample.clone(), rows * CHANNELS));
    (prop::collection::vec(chunk, 0..6), 0..300usize, 0..60usize).prop_map(|(mut chunks, from, rows)| {
        let lost = chunks.iter_mut().flatten().step_by(CHANNELS).skip(from).take(rows);
        lost.for_each(|x| *x = f64::NAN);
        chunks
    })
}

proptest! {
    #[test]
    fn filter_and_block_mean(chunks in chunks(), tau in 1..40usize, order in 1..=8usize) {
        let run = |chunks: &[Vec<f64>]| -> Result<Vec<u64>, EmgError> {
            let mut lowpass = ButterworthLowpass::new(200.0, 50.0, order, CHANNELS)?;
            let mut blocks = BlockMean::new(tau, CHANNELS)?;
            let (mut filtered, mut means) = (Vec::new(), Vec::new());
            for chunk in chunks {
                filtered.clear();
                lowpass.process(chunk, &mut filtered)?;
                blocks.process(&filtered, &mut means)?;
            }
            Ok(means.into_iter().map(f64::to_bits).collect())
        };
        prop_assert_eq!(run(&chunks)?, run(&[chunks.concat()])?);
    }

    #[test]
    fn intent(chunks in chunks(), tau in 1..40usize, raw: bool, live: bool) {
        let kind = if raw { Kind::Raw } else { Kind::Rectified };
        let preset = if live { Preset::Live } else { Preset::Paper };
        let run = |chunks: &[Vec<f64>]| -> Result<_, EmgError> {
            let mut intent = GraspIntent::new(200.0, &[3e3; CHANNELS], tau, kind, preset)?;
            let (mut fused, mut levels) = (Vec::new(), Vec::new());
            for chunk in chunks {
                let blocks = intent.process(chunk)?;
                fused.extend(blocks.fused);
                levels.extend(blocks.levels);
            }
            Ok((fused, levels, intent.bad_channels(), intent.held_samples(), intent.holding()))
        };
        let (fused, levels, ..) = run(&chunks)?;
        prop_assert!(fused.iter().all(|l| (1..=5).contains(l)) && levels.iter().all(|l| *l <= 5));
        prop_assert_eq!(run(&chunks)?, run(&[chunks.concat()])?);
    }
}
