//! What can be wrong with a frame, a baseline or an option.

use tega_error::{Brief, OutOfRange};

/// An input that the contact metrics cannot be computed from.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TactileError {
    /// Frame and baseline are not the same size.
    #[error("baseline is {baseline_h}x{baseline_w} pixels, frame is {frame_h}x{frame_w} (height x width)")]
    ShapeMismatch {
        /// Frame height in pixels.
        frame_h: usize,
        /// Frame width in pixels.
        frame_w: usize,
        /// Baseline height in pixels.
        baseline_h: usize,
        /// Baseline width in pixels.
        baseline_w: usize,
    },
    /// Frames that are taken together are not of one size.
    #[error("frame is {h}x{w} pixels, the first one is {first_h}x{first_w} (height x width)")]
    Mixed {
        /// Frame height in pixels.
        h: usize,
        /// Frame width in pixels.
        w: usize,
        /// Height of the first frame in pixels.
        first_h: usize,
        /// Its width in pixels.
        first_w: usize,
    },
    /// The last axis does not hold three colour channels.
    #[error("{name} has {channels} channels per pixel, wanted 3")]
    Channels {
        /// The argument.
        name: &'static str,
        /// Channels found.
        channels: usize,
    },
    /// A side is empty or longer than the exact sums allow.
    #[error("frame is {height}x{width} pixels (height x width), wanted 1 to {max} on each side")]
    Size {
        /// Frame height in pixels.
        height: usize,
        /// Frame width in pixels.
        width: usize,
        /// Longest side accepted.
        max: usize,
    },
    /// Grey weights do not add up to one.
    #[error("weights ({}, {}, {}) add up to {}, wanted 1 within 1e-9", Brief(*r), Brief(*g), Brief(*b), Brief(*sum))]
    WeightSum {
        /// Red weight.
        r: f64,
        /// Green weight.
        g: f64,
        /// Blue weight.
        b: f64,
        /// Their sum.
        sum: f64,
    },
    /// A number is out of its range or not finite.
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
    /// Noise cannot be measured from so few frames.
    #[error("{frames} frames were given to measure noise from, wanted {wanted} or more")]
    TooFewFrames {
        /// Frames given.
        frames: usize,
        /// Frames wanted.
        wanted: usize,
    },
    /// Sums over cells do not fit the pictures; `wanted` is 0 where those are not divided into cells of 8 x 8 pixels.
    #[error("sums of {got} cells were given, wanted {wanted}")]
    Cells {
        /// Cells given.
        got: usize,
        /// Cells wanted.
        wanted: usize,
    },
    /// A baseline cannot be estimated from no frames.
    #[error("no frames were given to estimate a baseline from")]
    NoFrames,
}

impl TactileError {
    /// The next step for the person who reads the message; empty where the message says it all.
    pub fn hint(&self) -> &'static str {
        match self {
            Self::ShapeMismatch { .. } => {
                "use a baseline taken by the same sensor in the same mode and orientation"
            }
            Self::Mixed { .. } => "give frames of one sensor in one mode",
            Self::Channels { .. } => "pass colour images of shape (height, width, 3)",
            Self::Size { .. } => "crop or scale the image",
            Self::WeightSum { .. } => {
                "give weights for (red, green, blue) that add up to 1; they are not renormalised"
            }
            Self::OutOfRange(_) => "",
            Self::TooFewFrames { .. } => "record about a second of the untouched gel",
            Self::Cells { .. } => "give three planes of sums over 8 x 8 pixels, or the picture itself",
            Self::NoFrames => "give at least one frame",
        }
    }
}
