//! Follow one fingertip from frame to frame: a reading with a memory.
//!
//! The tracker knows what its gel looks like at rest and how much that varies. While nothing touches, it follows slow drift; in contact the memory is
//! frozen. A release is known by its course: a picture that falls quickly from half of the contact's peak to less than a third of it and then
//! hardly changes is the gel's own leftover, and so is what is less than a small share of the peak or stays about the threshold for long. A
//! leftover is not shown; it sinks slowly, and one second later it is taken for the new rest, which is followed quickly at first. What fell
//! and does not sink, or rises again, is a light hold and is felt again.
//!
//! Lags are of first order and take the time between two frames into account; arithmetic runs in one order, so a replay gives the same bits.

mod report;

use ndarray::ArrayView3;
use tega_error::OutOfRange;

use super::colour::Field;
use super::course::{Ends, Held, Now, State, Then, step};
use super::dent::Dent;
use super::fading::Fading;
use super::filter::MapFilter;
use super::mains::{BOTH, Mains};
use super::still::{Cells, dark, follow, glance, glance_again, judge, plain};
use super::touch::{Touch, TrackerOptions};
use crate::error::TactileError;

/// S of a gel at rest before its own is known.
const REST_PRIOR: f64 = 1.4;
/// A contact is this many times the rest.
const OVER_REST: f64 = 1.75;
/// Where S at rest jumps from frame to frame, as where quantised cells flip, a contact is so many mean jumps over the rest.
const OVER_JUMPS: f64 = 7.0;
/// But no more than this many times the rest: light taps jump as well.
const OVER_REST_MOST: f64 = 2.5;
/// Over how long jumps are averaged, seconds.
const JUMPS_S: f64 = 5.0;
/// The least S that is a contact, however quiet the sensor.
const LEAST_GATE: f64 = 0.95;
/// A first look that stays under this share of the threshold needs no second.
const GLANCE: f64 = 0.8;
/// A picture without half of its light is a fault for so long, seconds; after that it is read as it is.
const DARK_S: f64 = 0.5;
/// What bands of light explain leaves less than this share of S.
const EXPLAINED: f64 = 0.7;
/// At rest bands are looked for in one of so many frames.
const BANDS_EVERY: u32 = 4;
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
/// What may be the rest after a release is a mean over this time, seconds.
const PENDING_S: f64 = 0.3;
/// What a leftover may still change by after that: this share of the peak, falling with this time constant.
const LEFTOVER: f64 = 0.06;
const LEFTOVER_S: f64 = 1.5;

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
    /// By how much S at rest differs from one frame to the next, mean.
    jumps: f64,
    smooth: Option<f64>,
    leftover: f64,
    /// What fades in the rest since the last release.
    fading: Fading,
    mains: Mains,
    /// Averages the maps of a contact that scatters.
    filter: MapFilter,
    spare: Field,
    /// Frames at rest, and their time, since mains light was last looked for.
    unseen: u32,
    unseen_s: f64,
    /// How long the light has failed.
    dark_s: f64,
    last: Touch,
    quiet_frames: f64,
    dent: Option<Dent>,
    /// The last frame's depth over that by shading alone.
    deeper: f64,
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
            jumps: 0.0,
            smooth: None,
            leftover: 0.0,
            fading: Fading::default(),
            mains: Mains::default(),
            filter: MapFilter::default(),
            spare: Field::default(),
            unseen: 0,
            unseen_s: 0.0,
            dark_s: 0.0,
            last: Touch::default(),
            quiet_frames: FIRST_FRAMES,
            dent: None,
            deeper: 1.0,
        })
    }

    /// Reads the next frame.
    ///
    /// `dt_s` is the time since the frame before where it is not one period; `loaded` says that another finger bears a load, so that no
    /// rest is taken again.
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

    /// Takes the last picture for that of the untouched gel, however it differs; whether it did: a dark picture is none.
    ///
    /// What touches now is not felt until it moves. Before the first frame the baseline stays.
    pub fn rezero(&mut self) -> bool {
        if self.dark_s > 0.0 {
            return false;
        }
        for (gel, means) in self.gel.iter_mut().zip(&self.cells.means) {
            follow(gel, means, 1.0 / super::cells::UNITS_PER_COUNT, 1.0);
        }
        self.fading.clear();
        self.filter.clear();
        (self.smooth, self.leftover, self.dent) = (None, 0.0, None);
        // One picture has all of a picture's noise: the next ones are averaged with it.
        (self.quiet_frames, self.rest) = (1.0, self.rest.max(REST_PRIOR));
        self.state = State::Quiet;
        self.last = Touch { threshold: self.last.threshold, ..Touch::default() };
        true
    }

    /// Reads the cells that were taken last.
    fn read(&mut self, dt_s: f64, loaded: bool) -> Touch {
        if self.dark_s < DARK_S && dark(&self.cells, &self.gel) {
            // A fault of the light: nothing is learned from it, and it begins and ends no contact.
            self.dark_s += dt_s;
            return self.last;
        }
        self.dark_s = 0.0;
        self.leftover *= 1.0 - step(dt_s, LEFTOVER_S);
        let over = self.rest + OVER_JUMPS * self.jumps;
        let began = over.max(OVER_REST * self.rest).min(OVER_REST_MOST * self.rest).max(LEAST_GATE);
        let threshold = began + self.leftover;
        let mut now = f64::from(glance(&mut self.cells, &self.gel));
        let still = self.state == State::Quiet;
        let banded = self.mains.are_seen() && self.cells.colour.tells();
        let bands = if banded { self.without_bands(still, dt_s) } else { None };
        if banded {
            now = f64::from(glance_again(&mut self.cells));
        }
        let quiet = still && now.max(self.smooth.unwrap_or(0.0)) < GLANCE * threshold;
        let fades = self.fading.lasts();
        if quiet || !self.cells.colour.tells() {
            if fades {
                self.fading.measure(&self.cells);
            }
            if let Some(bands) = bands {
                self.mains.learn(bands, dt_s);
            } else if !banded {
                self.bands(still, dt_s);
            }
        } else {
            now = self.judged(still.then_some(threshold), bands, dt_s);
        }
        let before = self.smooth.unwrap_or(now);
        let s = before + step(dt_s, SMOOTH_S) * (now - before);
        self.smooth = Some(s);
        // What a fading leftover explains does not show that rest varies less.
        let rest = if quiet || !fades { now } else { now.max(self.rest) };
        self.advance([before, s], rest, dt_s, threshold, loaded);
        self.last = self.touch(s, threshold, dt_s);
        self.last
    }

    /// Takes known bands of mains light out of the last change, before the fit of the light takes a share of them for light;
    /// returns their variances where nothing touched before.
    fn without_bands(&mut self, still: bool, dt_s: f64) -> Option<[f64; 2]> {
        let (cells, gel) = (&mut self.cells, &self.gel);
        let noise = cells.noise.arranged(cells.order);
        let bands = still.then(|| self.mains.measure(&cells.white, gel, noise, &cells.grid));
        let held_s = matches!(self.state, State::Contact(_)).then_some(dt_s);
        self.mains.correct(&mut cells.white, gel, noise, &cells.grid, held_s);
        bands
    }

    /// S of the last picture without what light, mains and a fading leftover explain of it; `threshold` where nothing touched before, `bands` as
    /// [`Self::without_bands`] measured them.
    fn judged(&mut self, threshold: Option<f64>, bands: Option<[f64; 2]>, dt_s: f64) -> f64 {
        let (cells, gel) = (&mut self.cells, &self.gel);
        let mut now = f64::from(judge(cells, gel));
        let noise = cells.noise.arranged(cells.order);
        let bands = threshold
            .map(|_| bands.unwrap_or_else(|| self.mains.measure(&cells.white, gel, noise, &cells.grid)));
        if self.fading.lasts() {
            self.fading.measure(cells);
            self.fading.explain(&mut cells.white);
            now = f64::from(plain(cells));
        }
        let Some(threshold) = threshold else { return now };
        if now > threshold {
            self.spare.clone_from(&cells.white);
            for along in BOTH {
                if self.mains.tries(&mut cells.white, gel, noise, &cells.grid, along) {
                    let without = f64::from(plain(cells));
                    if without < threshold.min(EXPLAINED * now) {
                        now = without;
                        break;
                    }
                    cells.white.clone_from(&self.spare);
                }
            }
        }
        if now < threshold
            && let Some(bands) = bands
        {
            self.mains.learn(bands, dt_s);
        }
        now
    }

    /// Learns how much mains light is in a picture at rest: of every one at first, later of every fourth.
    fn bands(&mut self, still: bool, dt_s: f64) {
        self.unseen_s += dt_s;
        self.unseen += 1;
        if still && self.cells.colour.tells() && (self.unseen >= BANDS_EVERY || !self.mains.knows()) {
            let cells = &self.cells;
            let noise = cells.noise.arranged(cells.order);
            let bands = self.mains.measure(&cells.white, &self.gel, noise, &cells.grid);
            self.mains.learn(bands, self.unseen_s);
            (self.unseen, self.unseen_s) = (0, 0.0);
        }
    }

    fn advance(&mut self, [before, s]: [f64; 2], rest: f64, dt_s: f64, threshold: f64, loaded: bool) {
        let centre = self.dent.map(|dent| dent.middle).filter(|(x, _)| x.is_finite());
        let Self { leftover, .. } = *self;
        let now = Now { before, s, threshold, leftover, rest: self.rest, dt_s, loaded, centre };
        match &mut self.state {
            State::Quiet if s > threshold && self.cells.colour.tells() => {
                self.state = State::Contact(Held::new(s));
            }
            State::Quiet => {
                let share = step(dt_s, JUMPS_S).max(1.0 / self.quiet_frames);
                self.jumps += share * ((s - before).abs() - self.jumps);
                self.rest_on(rest, dt_s);
            }
            State::Contact(held) => match held.pass(&now) {
                Some(Ends::Quiet) => {
                    self.leftover = leftover.max(LEFTOVER * held.peak);
                    self.state = State::Quiet;
                }
                Some(Ends::Released(left)) => {
                    self.state = State::Released(left);
                    self.pend(1.0);
                }
                None => {}
            },
            State::Released(left) => {
                let (then, released) = (left.pass(&now), *left);
                self.pend(step(dt_s, PENDING_S));
                match then {
                    Some(Then::Again) => self.state = State::Contact(Held::again(s)),
                    Some(Then::Pressed) => self.state = State::Contact(Held::over(s, released)),
                    Some(Then::Over) if self.options.rezero && !loaded => {
                        self.take_rest();
                        self.leftover = self.leftover.max(LEFTOVER * released.peak);
                    }
                    _ => {}
                }
            }
        }
    }

    /// Takes what a release left for the rest.
    fn take_rest(&mut self) {
        self.fading.begin(&mut self.cells, &mut self.gel, &self.pending);
        self.gel.clone_from(&self.pending);
        self.smooth = None;
        self.quiet_frames = FIRST_FRAMES;
        self.state = State::Quiet;
    }

    /// Learns from a frame without contact: how much rest varies, and what it looks like now.
    fn rest_on(&mut self, now: f64, dt_s: f64) {
        let down = now < self.rest;
        let lag = if down { step(dt_s, REST_DOWN_S).min(REST_DOWN_MOST) } else { step(dt_s, REST_UP_S) };
        self.rest += lag * (now - self.rest);
        if self.fading.lasts() {
            self.fading.follow(&self.cells, &mut self.gel, dt_s);
            self.fading.pass(dt_s);
        }
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
}
