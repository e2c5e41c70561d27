//! Follow one fingertip from frame to frame: a reading with a memory.
//!
//! The tracker knows what its gel looks like at rest and how much that varies. While nothing touches, it follows slow drift; in contact the memory is
//! frozen. A release is known by its course: a picture that falls quickly from half of the contact's peak to less than a third of it and then
//! hardly changes is the gel's own leftover, and so is what is less than a small share of the peak or stays about the threshold for long. A
//! leftover is not shown; it sinks slowly, and one second later it is taken for the new rest, which is followed quickly at first. What fell
//! and does not sink, or rises again, is a light hold and is felt again.
//!
//! Lags are of first order and take the time between two frames into account; arithmetic runs in one order, so a replay gives the same bits.

use ndarray::ArrayView3;
use tega_error::OutOfRange;

use super::cells::Grid;
use super::colour::Field;
use super::dent::{Dent, Outline};
use super::law::Sums;
use super::light::GelLight;
use super::noise::SensorNoise;
use super::still::{Cells, follow, glance, judge};
use crate::error::TactileError;
use crate::frame::Order;

/// S of a gel at rest before its own is known.
const REST_PRIOR: f64 = 1.4;
/// A contact is this many times the rest.
const OVER_REST: f64 = 1.75;
/// The least S that is a contact, however quiet the sensor.
const LEAST_GATE: f64 = 0.95;
/// A contact ends under this share of what it began at.
const HYSTERESIS: f64 = 0.7;
/// A first look that stays under this share of the threshold needs no second.
const GLANCE: f64 = 0.8;
/// How S is smoothed, seconds.
const SMOOTH_S: f64 = 0.012;
/// How the rest is learned: quickly down, slowly up, so that a press is not taken for it; seconds.
const REST_DOWN_S: f64 = 0.25;
const REST_DOWN_MOST: f64 = 0.5;
const REST_UP_S: f64 = 15.0;
/// How the untouched gel is followed, seconds; at first its frames are averaged. Soon after a release, while a leftover is more than a share of
/// the rest, it is followed quickly.
const FOLLOW_S: f64 = 5.0;
const FOLLOW_SOON_S: f64 = 0.5;
const SOON_SHARE: f64 = 0.1;
/// How many frames the picture of the untouched gel counts for, so that a press in the first frames is not averaged into it.
const FIRST_FRAMES: f64 = 8.0;
/// A release falls from half of the peak to what a gel may keep of it within a short time, and then more slowly than a share of the peak a second.
const HALF: f64 = 0.5;
const KEPT: f64 = 0.3;
const FALL_S: f64 = 0.35;
const SETTLED_PER_S: f64 = 0.4;
/// A fall is over when it goes on at less than this share of its speed.
const SETTLED: f64 = 0.1;
/// A fall is judged after this many times as long as it took: quick ones at once, slow ones later.
const WAIT: f64 = 1.0;
/// While another finger bears a load, most quick falls are the object moving: a release then falls to less than this share of the peak, and
/// is at rest before this many times as long as its fall took.
const KEPT_LOADED: f64 = 0.17;
const WAIT_LOADED: f64 = 2.0;
/// Less than this share of the peak is a trace of the contact, however slowly it fell; so is what stays under a multiple of the threshold for
/// so many seconds.
const TRACE: f64 = 0.13;
const FAINT: f64 = 1.15;
const FAINT_S: f64 = 2.0;
/// Under the threshold that time runs faster, by so much for the whole threshold: at 0.8 of it a contact is over within 0.08 s.
const FAINTER: f64 = 120.0;
/// A gel's leftover sinks: what is not below this share of itself after this time is a light hold after a quick easing, and is felt again.
const SINKS_S: f64 = 0.8;
const SUNK: f64 = 0.88;
const SINKING_S: f64 = 0.1;
/// Nor does a leftover rise: what is over the threshold and over its lowest by this factor is felt again at once.
const RISES: f64 = 1.15;
/// After a release the rest is taken anew once this time is over.
const REZERO_S: f64 = 1.0;
const PENDING_S: f64 = 0.3;
/// What a leftover may still change by after that: this share of the peak, falling with this time constant.
const LEFTOVER: f64 = 0.06;
const LEFTOVER_S: f64 = 1.5;
/// A new contact over a leftover is this much stronger than it, plus this share of the peak before.
const OVER_LEFTOVER: f64 = 1.3;
const OVER_LEFTOVER_SHARE: f64 = 0.03;
/// Shares of the threshold at which the strength is 0 and 1.
const STRENGTH_FROM: f64 = 0.6;
const STRENGTH_FULL: f64 = 2.0;

/// How the tracker of a fingertip is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackerOptions {
    /// Frames a second when no time is given with a frame.
    pub rate_hz: f64,
    /// Order of the colour bytes.
    pub order: Order,
    /// Noise of the sensor; that of a DIGIT where it is not known.
    pub noise: SensorNoise,
    /// Light, scale and stiffness of the gel.
    pub light: GelLight,
    /// What the outline means.
    pub outline: Outline,
    /// Whether the rest is taken anew after a release.
    pub rezero: bool,
}

impl Default for TrackerOptions {
    fn default() -> Self {
        Self {
            rate_hz: 60.0,
            order: Order::default(),
            noise: SensorNoise::default(),
            light: GelLight::default(),
            outline: Outline::default(),
            rezero: true,
        }
    }
}

/// What one frame says of a fingertip's contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touch {
    /// Whether something touches.
    pub in_contact: bool,
    /// Effective deformation area, pixels; 0 without contact.
    pub eda: u32,
    /// Contact concentration: `peak` over the root of `eda`; focal contacts have more of it than broad ones.
    pub cci: f64,
    /// Height of the dent in counts: change of colour times width; rises with the press.
    pub peak: f64,
    /// Depth of the dent, millimetres, as far as light and scale are those of the sensor.
    pub depth_mm: f64,
    /// Normal force, newtons, by the gel's stiffness and the volume pressed in; likewise.
    pub force_n: f64,
    /// Sum of the change of colour over the dent, counts times pixels.
    pub mass: f64,
    /// Middle of the dent (column, row): of its outline in an even light; NaN without contact.
    pub centroid_xy: (f64, f64),
    /// Root mean square distance of the outlined pixels from their mean place, pixels; NaN without contact.
    pub spread: f64,
    /// How sure the contact is: 0 to 1, graded around the threshold.
    pub strength: f64,
    /// Share of the picture that is dented, 0 to 1.
    pub broad: f64,
    /// S: how much of the picture differs from the untouched gel, noise units.
    pub difference: f64,
    /// S from which a contact begins.
    pub threshold: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum State {
    Quiet,
    Contact {
        /// Largest S of this contact.
        peak: f64,
        /// Seconds since S was last over half of it.
        since_half_s: f64,
        /// How long the fall from half took, once S is under what a gel may keep, and how long that is ago.
        fallen: Option<[f64; 2]>,
        /// Seconds since S was over the threshold.
        faint_s: f64,
    },
    Released {
        peak: f64,
        /// S when it was told, a mean of the newest, and the least of that mean.
        first: f64,
        mean: f64,
        lowest: f64,
        least: f64,
        since_s: f64,
        /// Whether it fell, so that what does not sink is a light hold.
        fell: bool,
    },
}

/// Follows one fingertip; see the module.
#[derive(Debug, Clone)]
pub struct TouchTracker {
    options: TrackerOptions,
    cells: Cells,
    /// The untouched gel as it is now, counts a cell.
    gel: Field,
    /// What it may be after a release.
    pending: Field,
    state: State,
    rest: f64,
    smooth: Option<f64>,
    leftover: f64,
    quiet_frames: f64,
    dent: Option<Dent>,
    /// The last frame's depth over that by shading alone.
    deeper: f64,
}

/// Share of the way that a first-order lag of `tau_s` goes in `dt_s`; rational, so that no mathematical library decides a bit.
fn step(dt_s: f64, tau_s: f64) -> f64 {
    dt_s / (tau_s + dt_s)
}

impl TouchTracker {
    /// Makes one from a picture of the untouched gel.
    ///
    /// # Errors
    /// [`TactileError::Channels`] or [`TactileError::Size`] for the picture, [`TactileError::OutOfRange`] for a rate that is not from 0.01 to 1000 Hz.
    pub fn new(baseline: ArrayView3<'_, u8>, options: TrackerOptions) -> Result<Self, TactileError> {
        if !(0.01..=1000.0).contains(&options.rate_hz) {
            return Err(OutOfRange::new("rate_hz", options.rate_hz, "Hz", "0.01 to 1000").into());
        }
        let mut cells = Cells::of(&baseline, options.noise, &options.light, options.order)?;
        let mut gel = Field::default();
        cells.counts(&baseline, &mut gel)?;
        Ok(Self {
            options,
            cells,
            pending: gel.clone(),
            gel,
            state: State::Quiet,
            rest: REST_PRIOR,
            smooth: None,
            leftover: 0.0,
            quiet_frames: FIRST_FRAMES,
            dent: None,
            deeper: 1.0,
        })
    }

    /// Reads the next frame.
    ///
    /// `dt_s` is the time since the frame before where it is not one period; `loaded` says that another finger bears a load, so that no
    /// rest is taken anew.
    ///
    /// # Errors
    /// [`TactileError::Channels`] or [`TactileError::ShapeMismatch`] for the frame, [`TactileError::OutOfRange`] for a time that is not from
    /// 0 to 1e6 s; the tracker is then as before.
    pub fn update(
        &mut self,
        frame: ArrayView3<'_, u8>,
        dt_s: Option<f64>,
        loaded: bool,
    ) -> Result<Touch, TactileError> {
        let dt_s = self.period(dt_s)?;
        self.cells.take(&frame)?;
        Ok(self.read(dt_s, loaded))
    }

    /// Reads the next frame by its sums over cells of 8 x 8 pixels, row by row, one plane for each byte of a pixel: what
    /// [`Self::update`] makes of the frame itself.
    ///
    /// # Errors
    /// [`TactileError::Cells`] where the tracker's pictures are not divided into as many such cells; else as
    /// [`Self::update`].
    pub fn update_sums(
        &mut self,
        sums: [&[i16]; 3],
        dt_s: Option<f64>,
        loaded: bool,
    ) -> Result<Touch, TactileError> {
        let dt_s = self.period(dt_s)?;
        self.cells.take_sums(sums)?;
        Ok(self.read(dt_s, loaded))
    }

    fn period(&self, dt_s: Option<f64>) -> Result<f64, TactileError> {
        let dt_s = dt_s.unwrap_or(1.0 / self.options.rate_hz);
        if !(0.0..=1e6).contains(&dt_s) {
            return Err(OutOfRange::new("dt_s", dt_s, "s", "0 to 1e6").into());
        }
        Ok(dt_s)
    }

    /// Reads the cells that were taken last.
    fn read(&mut self, dt_s: f64, loaded: bool) -> Touch {
        self.leftover *= 1.0 - step(dt_s, LEFTOVER_S);
        let began = (OVER_REST * self.rest).max(LEAST_GATE);
        let threshold = began + self.leftover;
        let mut now = f64::from(glance(&mut self.cells, &self.gel));
        let before = self.smooth.unwrap_or(now);
        let quiet = self.state == State::Quiet && now < GLANCE * threshold && before < GLANCE * threshold;
        if !quiet && self.cells.colour.tells() {
            now = f64::from(judge(&mut self.cells, &self.gel));
        }
        let s = before + step(dt_s, SMOOTH_S) * (now - before);
        self.smooth = Some(s);
        self.advance([before, s], now, dt_s, threshold, loaded);
        self.touch(s, threshold)
    }

    fn advance(&mut self, [before, s]: [f64; 2], now: f64, dt_s: f64, threshold: f64, loaded: bool) {
        match &mut self.state {
            State::Quiet if s > threshold && self.cells.colour.tells() => {
                self.state = State::Contact { peak: s, since_half_s: 0.0, fallen: None, faint_s: 0.0 };
            }
            State::Quiet => self.rest_on(now, dt_s),
            State::Contact { peak, since_half_s, fallen, faint_s } => {
                *peak = peak.max(s);
                *since_half_s = if s >= HALF * *peak { 0.0 } else { *since_half_s + dt_s };
                *faint_s = if s >= FAINT * threshold {
                    (*faint_s - dt_s).max(0.0)
                } else {
                    *faint_s + dt_s * (1.0 + FAINTER * (1.0 - s / threshold).max(0.0))
                };
                *fallen = match *fallen {
                    _ if s >= 1.1 * KEPT * *peak => None,
                    None => (s < KEPT * *peak).then_some([*since_half_s, 0.0]),
                    Some([fall_s, since_s]) => Some([fall_s, since_s + dt_s]),
                };
                let speed = fallen
                    .map_or(SETTLED_PER_S, |[fall_s, _]| SETTLED * (HALF - KEPT) / fall_s.max(dt_s))
                    .min(SETTLED_PER_S);
                let settled = before - s <= speed * dt_s * *peak;
                let fell = fallen.is_some_and(|[fall_s, since_s]| {
                    let rests = !loaded || (s < KEPT_LOADED * *peak && since_s <= WAIT_LOADED * fall_s);
                    fall_s < FALL_S + dt_s && since_s + dt_s >= WAIT * fall_s && rests
                });
                let traces = s < TRACE * *peak || *faint_s > FAINT_S;
                let peak = *peak;
                if s < HYSTERESIS * (threshold - self.leftover) + self.leftover {
                    self.leftover = self.leftover.max(LEFTOVER * peak);
                    self.state = State::Quiet;
                } else if (settled && fell) || traces {
                    self.state = State::Released {
                        peak,
                        first: s,
                        mean: s,
                        lowest: s,
                        least: s,
                        since_s: 0.0,
                        fell: fell && !traces,
                    };
                    self.pend(1.0);
                }
            }
            State::Released { peak, first, mean, lowest, least, since_s, fell } => {
                *least = least.min(s);
                *mean += step(dt_s, SINKING_S) * (s - *mean);
                *lowest = lowest.min(*mean);
                let rises =
                    *fell && *mean > threshold && *mean - self.rest > RISES * (*lowest - self.rest).max(0.0);
                let stays = *fell
                    && *since_s < SINKS_S
                    && *since_s + dt_s >= SINKS_S
                    && *mean - self.rest > SUNK * (*first - self.rest);
                *since_s += dt_s;
                let over = s > threshold.max(OVER_LEFTOVER * *least + OVER_LEFTOVER_SHARE * *peak);
                let (peak, due) = (*peak, *since_s >= REZERO_S);
                self.pend(step(dt_s, PENDING_S));
                if over || stays || rises {
                    self.state = State::Contact { peak: s, since_half_s: 0.0, fallen: None, faint_s: 0.0 };
                } else if due && self.options.rezero && !loaded {
                    self.gel.clone_from(&self.pending);
                    self.leftover = self.leftover.max(LEFTOVER * peak);
                    self.smooth = None;
                    self.quiet_frames = FIRST_FRAMES;
                    self.state = State::Quiet;
                }
            }
        }
    }

    /// Learns from a frame without contact: how much rest varies, and what it looks like now.
    fn rest_on(&mut self, now: f64, dt_s: f64) {
        let lag =
            if now < self.rest { step(dt_s, REST_DOWN_S).min(REST_DOWN_MOST) } else { step(dt_s, REST_UP_S) };
        self.rest += lag * (now - self.rest);
        self.quiet_frames += 1.0;
        let follow_s = if self.leftover > SOON_SHARE * self.rest { FOLLOW_SOON_S } else { FOLLOW_S };
        let share = step(dt_s, follow_s).max(1.0 / self.quiet_frames);
        for (gel, means) in self.gel.iter_mut().zip(&self.cells.means) {
            follow(gel, means, 1.0 / super::cells::UNITS_PER_COUNT, share as f32);
        }
    }

    /// Takes a share of the last frame into what may be the rest.
    fn pend(&mut self, share: f64) {
        for (pending, means) in self.pending.iter_mut().zip(&self.cells.means) {
            follow(pending, means, 1.0 / super::cells::UNITS_PER_COUNT, share as f32);
        }
    }

    fn touch(&mut self, s: f64, threshold: f64) -> Touch {
        let mut touch = Touch {
            in_contact: false,
            eda: 0,
            cci: 0.0,
            peak: 0.0,
            depth_mm: 0.0,
            force_n: 0.0,
            mass: 0.0,
            centroid_xy: (f64::NAN, f64::NAN),
            spread: f64::NAN,
            strength: 0.0,
            broad: 0.0,
            difference: s,
            threshold,
        };
        self.dent = None;
        // Where the rest has just been taken anew, S is still that against the old one.
        if matches!(self.state, State::Released { .. }) || self.smooth.is_none() {
            return touch;
        }
        let sure = (s / threshold - STRENGTH_FROM) / (STRENGTH_FULL - STRENGTH_FROM);
        touch.strength = sure.clamp(0.0, 1.0);
        if !matches!(self.state, State::Contact { .. }) {
            return touch;
        }
        let dent = self.cells.dent(self.options.outline);
        let grid = &self.cells.grid;
        let area = dent.moments.area as f64;
        self.dent = Some(dent);
        if area == 0.0 {
            return touch;
        }
        touch.in_contact = true;
        touch.eda = u32::try_from(dent.moments.area).unwrap_or(u32::MAX);
        let (height, mm_per_unit) = (dent.height(grid), self.cells.reader.mm_per_unit);
        touch.broad = area / (grid.height * grid.width) as f64;
        let sums = Sums {
            shaded_mm: dent.shaded_mm,
            volume_mm3: dent.volume_mm3,
            height_mm: height * mm_per_unit,
            difference_mm: s * mm_per_unit,
            broad: touch.broad,
        };
        touch.peak = height * self.cells.counts_per_unit();
        touch.cci = touch.peak / area.sqrt();
        touch.depth_mm = sums.depth_mm();
        self.deeper = if dent.shaded_mm > 0.0 { touch.depth_mm / dent.shaded_mm } else { 0.0 };
        touch.force_n = sums.volume_mm3() * self.options.light.stiffness_n_mm3;
        touch.mass = dent.mass * self.cells.counts_per_unit();
        touch.centroid_xy = dent.middle;
        touch.spread = dent.moments.spread();
        touch
    }

    fn touches(&self) -> bool {
        self.dent.is_some_and(|dent| dent.moments.area > 0)
    }

    /// Whether the last frame showed a contact that may bear a load: one that has not just fallen.
    pub fn bears_load(&self) -> bool {
        matches!(self.state, State::Contact { fallen: None, .. })
    }

    /// The last frame's mask, row by row, and its height and width; nothing without contact.
    pub fn mask(&self) -> (Vec<bool>, [usize; 2]) {
        let Grid { height, width, .. } = self.cells.grid;
        let mut mask = vec![false; height * width];
        if self.touches() {
            self.cells.paint(self.options.outline, |y, first, end| {
                if let Some(run) = mask.get_mut(y * width + first..y * width + end) {
                    run.fill(true);
                }
            });
        }
        (mask, [height, width])
    }

    /// The last frame's depth by shading, scaled so that its largest is the contact's, millimetres, a value a cell, and the numbers of rows and
    /// columns; 0 without contact.
    pub fn depth_map(&self) -> (Vec<f32>, [usize; 2]) {
        let Grid { rows, cols, .. } = self.cells.grid;
        let by = self.deeper as f32;
        let depth = if self.touches() {
            self.cells.reader.depth_mm.iter().map(|shaded| by * shaded).collect()
        } else {
            vec![0.0; rows * cols]
        };
        (depth, [rows, cols])
    }
}
