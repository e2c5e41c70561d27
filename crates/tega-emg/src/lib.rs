//! EMG samples to grasp level (Eq 10 to 13).
//!
//! Samples are rows of one `f64` a channel in any unit. A [`GraspIntent`] conditions them as their [`Kind`] asks,
//! low-passes them at 50 Hz, averages every τ samples, puts each channel on a level from 1 (open) to 5 (full closure)
//! of its maximum and lets the channels vote. The parts are here on their own as well. Everything streams: results
//! are bit-identical however a recording is cut into chunks. [`ChannelVotes`] finds the channels that measure no muscle.
//!
//! ```
//! use tega_emg::{channel_maxima, GraspIntent, Kind, Preset};
//! // One second of a square-wave "contraction" on a mid-rail offset, 1 kHz, one channel.
//! let squeeze: Vec<f64> = (0..1000).map(|i| 2048.0 + if i / 5 % 2 == 0 { 300.0 } else { -300.0 }).collect();
//! let maxima = channel_maxima(&squeeze, 1, 1000.0, 100, Kind::Raw, 95.0)?;
//! let mut intent = GraspIntent::new(1000.0, &maxima, 100, Kind::Raw, Preset::Live)?;
//! assert_eq!(intent.process(&[2048.0; 300])?.fused, [1, 1, 1]);
//! assert_eq!(intent.process(&squeeze)?.fused.last(), Some(&5));
//! # Ok::<(), tega_emg::EmgError>(())
//! ```
#![deny(unsafe_code)] // allowed in what `dispatched!` writes

mod bank;
mod block_mean;
mod butterworth;
mod calibrate;
mod chain;
mod error;
mod fusion;
mod guard;
mod intent;
mod lanes;
mod level;
mod lowpass;
mod mains;
mod pieces;
mod steady;
mod votes;

pub use block_mean::{BlockMean, MAX_TAU};
pub use butterworth::{CUTOFF_MARGIN, MAX_ORDER, Section, Sos};
pub use calibrate::channel_maxima;
pub use chain::{Kind, LOWPASS_HZ, OFFSET_HZ, ORDER};
pub use error::EmgError;
pub use fusion::{Fusion, fuse_levels};
pub use guard::LARGEST_SAMPLE;
pub use intent::{Blocks, GraspIntent, LIVE_SHARE, Preset, Rules};
pub use level::{Intervals, LEVELS, grasp_level};
pub use lowpass::ButterworthLowpass;
pub use votes::{ChannelFault, ChannelVotes, VoteRules};
