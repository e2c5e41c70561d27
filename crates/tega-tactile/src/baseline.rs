//! A no-contact baseline from a recording.
//!
//! The first frames are not to be trusted: a camera starts dark, its buffers hold the last session's contact, and a
//! recording may begin in contact. Nor is the most common picture: a grip may last. What marks a frame without contact
//! is that it is the smoothest: pressing adds slopes of light, and never takes them away.
//!
//! A first pass keeps a thumbnail per frame ([`BaselineSurvey`]); only the frames it chooses are needed in full.

use ndarray::{Array3, ArrayView3, Axis};

use crate::error::TactileError;
use crate::live::{Thumbnail, Thumbnails};

/// Frames whose brightness is further from the recording's median than this share were taken in another light.
const LIT: f64 = 0.05;
/// The same among the chosen frames: light settles over the first few.
const SETTLED: f64 = 0.01;
/// Two frames show the same if no cell differs by more noise units than this.
const ALIKE: f32 = 8.0;
/// A state of the gel is one that at least this many frames show.
const STATE: usize = 3;
/// Fewer frames than this say nothing by their median.
const MEDIAN_OF: usize = 5;
/// A run of frames without contact this long is preferred to those after a later release: a gel that was pressed keeps
/// a trace for seconds.
const RUN: usize = 5;
/// Most quiet frames, and most frames of a whole recording, that a median is taken of.
const MOST_QUIET: usize = 32;
const MOST_FRAMES: usize = 64;
/// The median of all frames must be this much smoother than the quietest state to replace it.
const SMOOTHER: f64 = 0.99;

/// How a baseline was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BaselineSource {
    /// Frames without contact.
    QuietFrames,
    /// The median of frames that all show a contact, each elsewhere.
    MovingContact,
}

/// The frames that a baseline is made of.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BaselineChoice {
    /// Indices of the frames, rising.
    pub frames: Vec<usize>,
    /// Why these.
    pub source: BaselineSource,
}

/// A baseline and where it comes from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EstimatedBaseline {
    /// Per pixel and channel the median of the chosen frames.
    pub image: Array3<u8>,
    /// The frames chosen.
    pub choice: BaselineChoice,
}

/// First pass over a recording: one thumbnail of a few kilobytes a frame.
#[derive(Debug, Default)]
pub struct BaselineSurvey {
    thumbnails: Thumbnails,
    frames: Vec<Thumbnail>,
}

impl BaselineSurvey {
    /// Takes in the next frame.
    ///
    /// # Errors
    /// [`TactileError::Channels`] or [`TactileError::Size`] for a frame that is no colour image,
    /// [`TactileError::Mixed`] where it is not as large as the first.
    pub fn add(&mut self, frame: ArrayView3<'_, u8>) -> Result<(), TactileError> {
        self.frames.push(self.thumbnails.of(frame)?);
        Ok(())
    }

    /// Chooses the frames to make a baseline of.
    ///
    /// # Errors
    /// [`TactileError::NoFrames`] before the first frame.
    pub fn choose(&self) -> Result<BaselineChoice, TactileError> {
        let lit = self.within(&(0..self.frames.len()).collect::<Vec<_>>(), LIT);
        let quiet = self.quietest_state(&lit);
        let all = self.middle(&lit);
        let Some(smoothest) = lit.iter().copied().min_by(|&a, &b| self.rough(a).total_cmp(&self.rough(b)))
        else {
            return Err(TactileError::NoFrames);
        };
        let (frames, source) = match quiet {
            Some(quiet) if self.middle(&quiet).roughness * SMOOTHER <= all.roughness => {
                (self.settled(&quiet), BaselineSource::QuietFrames)
            }
            _ if lit.len() >= MEDIAN_OF => (spread_out(&lit, MOST_FRAMES), BaselineSource::MovingContact),
            _ => (vec![smoothest], BaselineSource::QuietFrames),
        };
        Ok(BaselineChoice { frames, source })
    }

    fn rough(&self, frame: usize) -> f64 {
        self.frames.get(frame).map_or(f64::INFINITY, |thumbnail| thumbnail.roughness)
    }

    /// Those of `frames` whose brightness is within a share of their median.
    fn within(&self, frames: &[usize], share: f64) -> Vec<usize> {
        let light = |frame: usize| self.frames.get(frame).map_or(f64::NAN, |thumbnail| thumbnail.brightness);
        let mut sorted: Vec<f64> = frames.iter().map(|&frame| light(frame)).collect();
        sorted.sort_unstable_by(f64::total_cmp);
        let middle = sorted.get(sorted.len() / 2).copied().unwrap_or_default();
        frames.iter().copied().filter(|&frame| (light(frame) - middle).abs() <= share * middle).collect()
    }

    /// Frames that show the same as the smoothest frame that is not alone in what it shows.
    fn quietest_state(&self, lit: &[usize]) -> Option<Vec<usize>> {
        let mut order = lit.to_vec();
        order.sort_by(|&a, &b| self.rough(a).total_cmp(&self.rough(b)));
        let wanted = STATE.min(lit.len());
        order.truncate((lit.len() / 8).max(8));
        let state = order.into_iter().find_map(|anchor| {
            let anchor = self.frames.get(anchor)?;
            let alike = self.alike(lit, anchor);
            (alike.len() >= wanted).then_some(alike)
        })?;
        // Around the middle of the state instead of one frame of it.
        let alike = self.alike(lit, &self.middle(&state));
        Some(if alike.is_empty() { state } else { alike })
    }

    fn alike(&self, frames: &[usize], anchor: &Thumbnail) -> Vec<usize> {
        let near = |frame: &usize| {
            self.frames.get(*frame).is_some_and(|thumbnail| Thumbnails::distance(thumbnail, anchor).0 < ALIKE)
        };
        frames.iter().copied().filter(near).collect()
    }

    fn middle(&self, frames: &[usize]) -> Thumbnail {
        self.thumbnails.median(&frames.iter().filter_map(|&f| self.frames.get(f)).collect::<Vec<_>>())
    }

    /// Of the frames in one state the first run in settled light, or if no run is long those closest to the middle.
    fn settled(&self, state: &[usize]) -> Vec<usize> {
        let state = self.within(state, SETTLED);
        let runs = state.chunk_by(|a, b| b - a <= 2);
        let chosen = runs.into_iter().find(|run| run.len() >= RUN).unwrap_or(&state);
        let middle = self.middle(chosen);
        let distance = |frame: &usize| {
            self.frames.get(*frame).map_or(f32::MAX, |thumbnail| Thumbnails::distance(thumbnail, &middle).1)
        };
        let mut chosen = chosen.to_vec();
        chosen.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
        chosen.truncate(MOST_QUIET);
        chosen.sort_unstable();
        chosen
    }
}

/// A baseline estimated from a recording's quietest frames; where every frame shows a contact, each elsewhere, from
/// the median of all.
///
/// # Errors
/// [`TactileError::NoFrames`] for an empty recording, and those of [`BaselineSurvey::add`].
///
/// # Examples
/// ```
/// use ndarray::Array3;
/// use tega_tactile::estimate_baseline;
///
/// let frames: Vec<_> = [10, 90, 91, 90].map(|v| Array3::<u8>::from_elem((24, 32, 3), v)).into();
/// let views: Vec<_> = frames.iter().map(|f| f.view()).collect();
/// let baseline = estimate_baseline(&views)?;
/// assert_eq!(baseline.image, frames[1]); // the first frame was dark
/// # Ok::<(), tega_tactile::TactileError>(())
/// ```
pub fn estimate_baseline(frames: &[ArrayView3<'_, u8>]) -> Result<EstimatedBaseline, TactileError> {
    let mut survey = BaselineSurvey::default();
    for frame in frames {
        survey.add(*frame)?;
    }
    let choice = survey.choose()?;
    let chosen: Vec<_> = choice.frames.iter().filter_map(|&i| frames.get(i).copied()).collect();
    let image = median_image(&chosen)?;
    Ok(EstimatedBaseline { image, choice })
}

/// Per pixel and channel the median of images of one shape; of an even number the mean of the two in the middle,
/// halves rounded up.
///
/// # Errors
/// [`TactileError::NoFrames`] for no images, [`TactileError::Mixed`] where they differ in size,
/// [`TactileError::Channels`] where they differ in channels.
pub fn median_image(frames: &[ArrayView3<'_, u8>]) -> Result<Array3<u8>, TactileError> {
    let first = frames.first().ok_or(TactileError::NoFrames)?;
    for frame in frames {
        same_size(first.dim(), frame.dim())?;
    }
    let mut image = Array3::zeros(first.dim());
    let mut column = Vec::with_capacity(frames.len());
    for (y, mut row) in image.axis_iter_mut(Axis(0)).enumerate() {
        let rows: Vec<_> = frames.iter().map(|frame| frame.index_axis(Axis(0), y).to_owned()).collect();
        for ((x, c), out) in row.indexed_iter_mut() {
            column.clear();
            column.extend(rows.iter().filter_map(|row| row.get((x, c))));
            *out = middle_of(&mut column);
        }
    }
    Ok(image)
}

fn middle_of(values: &mut [u8]) -> u8 {
    let n = values.len();
    if n == 0 {
        return 0;
    }
    let (below, upper, _) = values.select_nth_unstable(n / 2);
    let upper = u16::from(*upper);
    let lower =
        if n.is_multiple_of(2) { below.iter().copied().max().map_or(upper, u16::from) } else { upper };
    (u16::midpoint(lower, upper + 1)) as u8
}

/// Fails where two images are not of one height and width.
fn same_size(first: (usize, usize, usize), other: (usize, usize, usize)) -> Result<(), TactileError> {
    if first == other {
        return Ok(());
    }
    if (first.0, first.1) == (other.0, other.1) {
        let channels = if other.2 == 3 { first.2 } else { other.2 };
        return Err(TactileError::Channels { name: "frame", channels });
    }
    Err(TactileError::Mixed { h: other.0, w: other.1, first_h: first.0, first_w: first.1 })
}

/// At most `most` of `frames`, evenly spread.
fn spread_out(frames: &[usize], most: usize) -> Vec<usize> {
    let n = frames.len();
    if n <= most {
        return frames.to_vec();
    }
    (0..most).filter_map(|i| frames.get(i * n / most).copied()).collect()
}
