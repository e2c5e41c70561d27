//! The course of a contact: held, released, felt again, over.

/// A contact ends under this share of what it began at.
const HYSTERESIS: f64 = 0.7;
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
const KEPT_LOADED: f64 = 0.19;
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
/// Less than this share of the peak is a leftover even where it hardly sinks.
const HOLDS: f64 = 0.215;
/// A light hold that was felt again and then sinks under this share of itself, without ever rising, was a leftover after all.
const SINKS_LATER: f64 = 0.75;
/// A faint contact that has neither moved, grown nor shrunk by these shares for so long, seconds, while no other finger bears a load, becomes rest.
const STEADY_S: f64 = 30.0;
const STEADY: f64 = 0.08;
const STEADY_LAG_S: f64 = 0.5;
const STEADY_PX: f64 = 6.0;
const STEADY_FAINT: f64 = 2.0;
/// Nor does a leftover rise: what is over the threshold and over its lowest by this factor is felt again at once.
const RISES: f64 = 1.15;
/// After a release the rest is taken again once this time is over.
const REZERO_S: f64 = 1.0;
/// A new contact over a leftover is this much stronger than it, plus this share of the peak before.
const OVER_LEFTOVER: f64 = 1.3;
const OVER_LEFTOVER_SHARE: f64 = 0.03;

/// Where a fingertip's contact is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum State {
    Quiet,
    Contact(Held),
    Released(Left),
}

/// What one frame says to the course of a contact.
#[derive(Debug, Clone, Copy)]
pub(super) struct Now {
    /// S of the frame before and of this one, smoothed.
    pub before: f64,
    pub s: f64,
    pub threshold: f64,
    /// What of the threshold is for a leftover.
    pub leftover: f64,
    /// S at rest.
    pub rest: f64,
    pub dt_s: f64,
    /// Whether another finger bears a load.
    pub loaded: bool,
    /// Middle of the last frame's dent, pixels.
    pub centre: Option<(f64, f64)>,
}

/// A contact that is held.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Held {
    /// Largest S of this contact.
    pub peak: f64,
    /// Seconds since S was last over half of it.
    since_half_s: f64,
    /// How long the fall from half took, once S is under what a gel may keep, and how long that is ago.
    pub fallen: Option<[f64; 2]>,
    /// Seconds since S was over the threshold.
    faint_s: f64,
    /// S at which it was felt again after a release, and the least of it since, while it never rose.
    again: Option<[f64; 2]>,
    /// The leftover that it presses on.
    under: Option<Left>,
    steady: Steady,
}

/// How long a contact has neither moved, grown nor shrunk.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Steady {
    /// Means of S and of the place, and what they were when it last changed.
    s: [f64; 2],
    x: [f64; 2],
    y: [f64; 2],
    since_s: f64,
}

/// How a contact ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Ends {
    Quiet,
    Released(Left),
}

/// What a released contact leaves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Left {
    pub peak: f64,
    /// S when it was released, a mean of the newest, and the least of that mean.
    first: f64,
    mean: f64,
    lowest: f64,
    least: f64,
    since_s: f64,
    /// Whether it fell, so that what does not sink is a light hold.
    fell: bool,
}

/// What follows a release.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Then {
    /// What was taken for a leftover is a contact.
    Again,
    /// Something presses on the leftover.
    Pressed,
    Over,
}

/// Share of the way that a first-order lag of `tau_s` goes in `dt_s`; rational, so that no mathematical library decides a bit.
pub(super) fn step(dt_s: f64, tau_s: f64) -> f64 {
    dt_s / (tau_s + dt_s)
}

impl Steady {
    fn new(s: f64) -> Self {
        Self { s: [s; 2], x: [f64::NAN; 2], y: [f64::NAN; 2], since_s: 0.0 }
    }

    /// Lets a frame pass; how long nothing has changed.
    fn pass(&mut self, now: &Now) -> f64 {
        let lag = step(now.dt_s, STEADY_LAG_S);
        let (x, y) = now.centre.unwrap_or((f64::NAN, f64::NAN));
        for (mean, value) in [(&mut self.s, now.s), (&mut self.x, x), (&mut self.y, y)] {
            mean[0] = if mean[0].is_finite() { mean[0] + lag * (value - mean[0]) } else { value };
        }
        let off = |[mean, was]: [f64; 2]| (mean - was).abs();
        self.since_s += now.dt_s;
        // What is not known yet differs.
        let same = off(self.s) <= STEADY * self.s[1] && off(self.x).max(off(self.y)) <= STEADY_PX;
        if !same || self.x[1].is_nan() {
            self.since_s = 0.0;
            for mean in [&mut self.s, &mut self.x, &mut self.y] {
                mean[1] = mean[0];
            }
        }
        self.since_s
    }
}

impl Held {
    /// One that begins.
    pub fn new(s: f64) -> Self {
        let steady = Steady::new(s);
        Self { peak: s, since_half_s: 0.0, fallen: None, faint_s: 0.0, again: None, under: None, steady }
    }

    /// One that is felt again after a release.
    pub fn again(s: f64) -> Self {
        Self { again: Some([s; 2]), ..Self::new(s) }
    }

    /// One that presses on a leftover.
    pub fn over(s: f64, left: Left) -> Self {
        Self { under: Some(Left { since_s: 0.0, ..left }), ..Self::again(s) }
    }

    /// Lets a frame pass; how it ends, if it does.
    pub fn pass(&mut self, now: &Now) -> Option<Ends> {
        let Now { before, s, threshold, leftover, dt_s, loaded, .. } = *now;
        self.peak = self.peak.max(s);
        self.since_half_s = if s >= HALF * self.peak { 0.0 } else { self.since_half_s + dt_s };
        self.faint_s = if s >= FAINT * threshold {
            (self.faint_s - dt_s).max(0.0)
        } else {
            self.faint_s + dt_s * (1.0 + FAINTER * (1.0 - s / threshold).max(0.0))
        };
        self.fallen = match self.fallen {
            _ if s >= 1.1 * KEPT * self.peak => None,
            None => (s < KEPT * self.peak).then_some([self.since_half_s, 0.0]),
            Some([fall_s, since_s]) => Some([fall_s, since_s + dt_s]),
        };
        let speed = self
            .fallen
            .map_or(SETTLED_PER_S, |[fall_s, _]| SETTLED * (HALF - KEPT) / fall_s.max(dt_s))
            .min(SETTLED_PER_S);
        let settled = before - s <= speed * dt_s * self.peak;
        let fell = self.fallen.is_some_and(|[fall_s, since_s]| {
            let rests = !loaded || (s < KEPT_LOADED * self.peak && since_s <= WAIT_LOADED * fall_s);
            fall_s < FALL_S + dt_s && since_s + dt_s >= WAIT * fall_s && rests
        });
        let examined = self.sinks(now) || self.rests(now);
        let traces = s < TRACE * self.peak || self.faint_s > FAINT_S || (examined && !loaded);
        // A leftover only sinks: no more than before this press, if that was short, is that leftover.
        let under = self.under.filter(|left| s <= left.least && left.since_s < REZERO_S);
        if let Some(left) = &mut self.under {
            left.since_s += dt_s;
        }
        if s < HYSTERESIS * (threshold - leftover) + leftover {
            Some(Ends::Quiet)
        } else if let Some(left) = under {
            Some(Ends::Released(Left::new(s, self.peak.max(left.peak), left.fell)))
        } else if (settled && fell) || traces {
            Some(Ends::Released(Left::new(s, self.peak, fell && !traces)))
        } else {
            None
        }
    }

    /// Whether it was felt again and has done nothing but sink since.
    fn sinks(&mut self, now: &Now) -> bool {
        let Some([first, least]) = self.again else { return false };
        let least = least.min(now.s);
        let rises = now.s - now.rest > RISES * (least - now.rest).max(0.0) + SETTLED * now.rest;
        self.again = (!rises).then_some([first, least]);
        !rises && now.s - now.rest < SINKS_LATER * (first - now.rest)
    }

    /// Whether it is faint and has not changed for long.
    fn rests(&mut self, now: &Now) -> bool {
        self.steady.pass(now) >= STEADY_S && now.s < STEADY_FAINT * now.threshold
    }
}

impl Left {
    fn new(s: f64, peak: f64, fell: bool) -> Self {
        Self { peak, first: s, mean: s, lowest: s, least: s, since_s: 0.0, fell }
    }

    /// Lets a frame pass; what follows, if anything yet.
    pub fn pass(&mut self, now: &Now) -> Option<Then> {
        let Now { s, threshold, rest, dt_s, .. } = *now;
        self.least = self.least.min(s);
        self.mean += step(dt_s, SINKING_S) * (s - self.mean);
        self.lowest = self.lowest.min(self.mean);
        let rises =
            self.fell && self.mean > threshold && self.mean - rest > RISES * (self.lowest - rest).max(0.0);
        let stays = self.fell
            && self.since_s < SINKS_S
            && self.since_s + dt_s >= SINKS_S
            && self.mean - rest > SUNK * (self.first - rest)
            && self.mean - rest > HOLDS * (self.peak - rest);
        self.since_s += dt_s;
        let over = s > threshold.max(OVER_LEFTOVER * self.least + OVER_LEFTOVER_SHARE * self.peak);
        if over {
            Some(Then::Pressed)
        } else if stays || rises {
            Some(Then::Again)
        } else {
            (self.since_s >= REZERO_S).then_some(Then::Over)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT_S: f64 = 1.0 / 60.0;

    fn now(before: f64, s: f64) -> Now {
        Now {
            before,
            s,
            threshold: 2.0,
            leftover: 0.0,
            rest: 1.0,
            dt_s: DT_S,
            loaded: false,
            centre: Some((9.0, 9.0)),
        }
    }

    /// Seconds until a contact that goes on at this S ends, and how; at most a minute.
    fn ends(held: &mut Held, s: f64, of: impl Fn(Now) -> Now) -> Option<(f64, Ends)> {
        (1..3600).find_map(|k| held.pass(&of(now(s, s))).map(|ends| (f64::from(k) * DT_S, ends)))
    }

    #[test]
    fn a_faint_contact_ends_after_two_seconds_and_is_not_felt_again_where_it_stays() {
        let (after_s, Ends::Released(mut left)) = ends(&mut Held::new(2.2), 2.2, |now| now).unwrap() else {
            panic!("not released");
        };
        assert!((2.0..2.1).contains(&after_s), "{after_s}");
        let mut frames = (0..90).map(|_| left.pass(&now(2.2, 2.2)));
        assert_eq!(frames.find_map(|then| then), Some(Then::Over));
        // A contact that is over the threshold again has its time back.
        let mut held = Held::new(2.2);
        for k in 0..600 {
            let s = if k % 60 < 30 { 2.2 } else { 2.6 };
            assert_eq!(held.pass(&now(s, s)), None, "frame {k}");
        }
    }

    #[test]
    fn under_the_threshold_a_contact_is_over_within_a_tenth_of_a_second() {
        let (after_s, _) = ends(&mut Held::new(2.2), 1.6, |now| now).unwrap();
        assert!((0.06..0.1).contains(&after_s), "{after_s}");
        assert_eq!(Held::new(2.2).pass(&now(2.2, 1.39)), Some(Ends::Quiet));
    }

    /// A contact of S = 41 that falls within two frames to a share of that, rest taken off; its release.
    fn fallen(share: f64) -> Left {
        let mut held = Held::new(41.0);
        held.pass(&now(41.0, 41.0));
        let (mut before, low) = (41.0, 1.0 + 40.0 * share);
        for s in [15.0_f64.max(low), low, low, low, low] {
            if let Some(Ends::Released(left)) = held.pass(&now(before, s)) {
                return left;
            }
            before = s;
        }
        panic!("not released");
    }

    #[test]
    fn what_fell_and_stays_is_felt_again_where_it_is_more_than_a_leftover() {
        for (share, then) in [(0.25, Then::Again), (0.2, Then::Over), (0.1, Then::Over)] {
            let (mut left, s) = (fallen(share), 1.0 + 40.0 * share);
            let found = (0..90).find_map(|_| left.pass(&now(s, s)));
            assert_eq!(found, Some(then), "{share}");
        }
        // And what rises over its lowest, at once.
        let mut left = fallen(0.2);
        let found = (0..30)
            .map(|k| left.pass(&now(9.0, if k < 10 { 9.0 } else { 11.0 })))
            .position(|then| then.is_some());
        assert!(found.is_some_and(|at| (11..30).contains(&at)), "{found:?}");
    }

    #[test]
    fn what_was_felt_again_and_only_sinks_is_a_leftover_after_all() {
        for (loaded, rises, released) in [(false, false, true), (true, false, false), (false, true, false)] {
            let mut held = Held::again(11.0);
            let found = (0..360).find_map(|k| {
                let up = if rises && k == 60 { 6.0 } else { 0.0 };
                let s = 1.0 + 10.0 * (-f64::from(k) * DT_S / 10.0).exp() + up;
                held.pass(&Now { loaded, ..now(s, s) })
            });
            assert_eq!(matches!(found, Some(Ends::Released(_))), released, "{loaded} {rises}");
        }
        // One that began by itself may sink as it likes.
        assert!((0..360).all(|k| Held::new(11.0).pass(&now(11.0, 11.0 - f64::from(k) / 60.0)).is_none()));
    }

    #[test]
    fn a_touch_of_a_leftover_ends_where_that_is_left_and_a_light_hold_under_it_is_felt_again() {
        for (share, then) in [(0.1, Then::Over), (0.25, Then::Again)] {
            let (mut left, s) = (fallen(share), 1.0 + 40.0 * share);
            let touched = 1.5 * s + 2.0;
            let loaded = |before, s| Now { loaded: true, ..now(before, s) };
            assert_eq!(left.pass(&loaded(s, touched)), Some(Then::Pressed), "{share}");
            let mut held = Held::over(touched, left);
            // What is more than the leftover is still the touch.
            assert_eq!(held.pass(&loaded(touched, 1.05 * s)), None, "{share}");
            let mut long = held;
            let Some(Ends::Released(mut left)) = held.pass(&loaded(1.05 * s, s)) else {
                panic!("not released: {share}");
            };
            assert_eq!((0..90).find_map(|_| left.pass(&now(s, s))), Some(then), "{share}");
            // Under a touch of more than a second the leftover has sunk: as much as before is a touch.
            assert!((0..60).all(|_| long.pass(&loaded(1.05 * s, 1.05 * s)).is_none()), "{share}");
            assert_eq!(long.pass(&loaded(1.05 * s, s)), None, "{share}");
        }
    }

    #[test]
    fn a_faint_contact_that_does_not_change_for_long_becomes_rest_unless_something_speaks_for_a_grip() {
        let faint = 3.0;
        let (after_s, ends_as) = ends(&mut Held::new(faint), faint, |now| now).unwrap();
        assert!((STEADY_S..STEADY_S + 1.0).contains(&after_s), "{after_s}");
        assert!(matches!(ends_as, Ends::Released(_)));
        assert_eq!(ends(&mut Held::new(faint), faint, |now| Now { loaded: true, ..now }), None);
        assert_eq!(ends(&mut Held::new(20.0), 20.0, |now| now), None);
        let (mut moves, mut grows) = (Held::new(faint), Held::new(faint));
        for k in 0..3600 {
            let turn = f64::from(k / 600 % 2);
            let centre = Some((9.0 + 20.0 * turn, 9.0));
            assert_eq!(moves.pass(&Now { centre, ..now(faint, faint) }), None, "frame {k}");
            let s = faint + 0.5 * turn;
            assert_eq!(grows.pass(&now(s, s)), None, "frame {k}");
        }
    }
}
