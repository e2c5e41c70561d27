//! What the gel remembers: how far each cell has given way for a time, and comes back after release.
//!
//! Beside the skin's own displacement `h` two slow ones follow it: dm/dt = (g h - m) / τ, with one τ where it still
//! rises and one where it goes back. Over any time in which `h` stays, that is solved exactly, so that frames may be left
//! out. What presses at one call is taken to press until the next.

use crate::grid::{COLS, NEGLIGIBLE_MM, ROWS};
use crate::membrane::{Membrane, Relief};
use crate::plane::{CACHE_LINE, Plane};
use crate::window::{Window, joined};

/// One slow displacement: share of the quick one that it tends to, and its time constants, seconds.
#[derive(Debug, Clone, Copy)]
struct Mode {
    share: f32,
    rise_s: f64,
    fall_s: f64,
}

/// Of the peak 13, 8 and 6 % are left 0.13, 1 and 2.7 s after grips of one to two seconds; see `docs/evidence/sim-touch.md`.
const MODES: [Mode; 2] =
    [Mode { share: 0.089, rise_s: 0.5, fall_s: 0.5 }, Mode { share: 0.174, rise_s: 2.0, fall_s: 10.0 }];
/// Columns between two rows of the relief.
const STRIDE: usize = COLS + CACHE_LINE;

/// The state: what a gel was shown, as far as it still matters.
#[derive(Debug, Clone)]
pub(crate) struct Memory {
    /// This unit's slow shares over the measured ones.
    strength: f32,
    /// Time of the latest call, and of the latest change of `slow`, seconds.
    last_s: Option<f64>,
    changed_s: f64,
    /// Slow displacements of the finest grid's cells as they were at `changed_s`, millimetres.
    slow: [Plane; 2],
    /// Largest of them, and where they are not 0.
    peaks: [f32; 2],
    window: Window,
    /// Whether a shape has pressed since the latest call.
    pressed: bool,
    /// All of the displacement, quick and slow, laid out as the finest grid's.
    relief: Plane,
}

impl Memory {
    pub(crate) fn new(strength: f32) -> Self {
        Self {
            strength,
            last_s: None,
            changed_s: 0.0,
            slow: [0; 2].map(|_| Plane::new(ROWS * COLS, 0.0)),
            peaks: [0.0; 2],
            window: Window::default(),
            pressed: false,
            relief: Plane::new((ROWS + 2) * STRIDE + CACHE_LINE, 0.0),
        }
    }

    /// Time of the latest call.
    pub(crate) fn last_s(&self) -> Option<f64> {
        self.last_s
    }

    /// Whether anything would be displaced at a time if nothing pressed from then on.
    pub(crate) fn remains(&self, t_s: f64) -> bool {
        self.pressed || self.left(t_s) > NEGLIGIBLE_MM
    }

    /// Lets time pass under what presses since the latest call; tells the grids how far the gel has given way. Returns
    /// whether that is enough to be seen.
    pub(crate) fn advance(&mut self, t_s: f64, membrane: &mut Membrane) -> bool {
        let last_s = self.last_s.replace(t_s).unwrap_or(t_s);
        if self.pressed {
            let reached = joined(self.window, membrane.window());
            let fade = self.faded(last_s);
            for (k, mode) in MODES.iter().enumerate() {
                let keep = [mode.rise_s, mode.fall_s].map(|tau_s| decay((t_s - last_s) / tau_s) as f32);
                let rule = (self.strength * mode.share, keep, fade[k]);
                self.peaks[k] = follow(&mut self.slow[k], membrane.relief(), reached, rule);
            }
            (self.window, self.changed_s) = (reached, t_s);
        }
        let seen = self.left(t_s) > NEGLIGIBLE_MM;
        let (shares, window) =
            if seen { (self.faded(t_s), self.window) } else { ([0.0; 2], Window::default()) };
        membrane.lag_behind([&self.slow[0], &self.slow[1]], shares, window);
        seen
    }

    /// Notes whether a shape presses from the latest call on.
    pub(crate) fn hold(&mut self, pressed: bool) {
        if pressed && !self.pressed && self.last_s.is_none_or(|t_s| self.left(t_s) <= NEGLIGIBLE_MM) {
            for slow in &mut self.slow {
                slow.fill(0.0);
            }
            (self.peaks, self.window) = ([0.0; 2], Window::default());
        }
        self.pressed = pressed;
    }

    /// Forgets all.
    pub(crate) fn forget(&mut self, membrane: &mut Membrane) {
        membrane.lag_behind([&self.slow[0], &self.slow[1]], [0.0; 2], Window::default());
        *self = Self::new(self.strength);
    }

    /// Adds the quick displacement, where there is one, to the slow ones.
    pub(crate) fn relief<'a>(&'a mut self, membrane: &'a Membrane, touches: bool) -> Relief<'a> {
        let quick = touches.then(|| membrane.relief());
        let window = quick.map_or(self.window, |quick| joined(self.window, quick.window));
        self.relief.fill(0.0);
        add(&mut self.relief, quick, membrane.lag(), window);
        Relief { cells: &self.relief, stride: STRIDE, window }
    }

    fn faded(&self, t_s: f64) -> [f32; 2] {
        MODES.map(|mode| decay((t_s - self.changed_s) / mode.fall_s) as f32)
    }

    fn left(&self, t_s: f64) -> f32 {
        let fade = self.faded(t_s);
        self.peaks[0] * fade[0] + self.peaks[1] * fade[1]
    }
}

/// Lets a slow displacement follow the quick one: first fade as it did at rest, then rise or fall to its share.
#[inline(always)]
fn follow_plain(
    slow: &mut [f32],
    quick: Relief<'_>,
    window: Window,
    (share, [rise, fall], fade): (f32, [f32; 2], f32),
) -> f32 {
    let Window { rows: [first, last], cols: [from, to] } = window;
    let mut peaks = [0.0f32; COLS];
    for r in first..last {
        let heights = &quick.row(r + 1)[from + 1..=to];
        let cells = slow[r * COLS + from..r * COLS + to].iter_mut();
        for ((slow, height), peak) in cells.zip(heights).zip(&mut peaks) {
            let (was, wanted) = (*slow * fade, share * height);
            let keep = if was < wanted { rise } else { fall };
            let now = wanted + (was - wanted) * keep;
            *slow = now;
            *peak = if now > *peak { now } else { *peak };
        }
    }
    peaks.iter().fold(0.0, |most, peak| if *peak > most { *peak } else { most })
}

/// Adds the quick displacement to how far the gel lags.
#[inline(always)]
fn add_plain(out: &mut [f32], quick: Option<Relief<'_>>, lag: &[f32], window: Window) {
    let Window { rows: [first, last], cols: [from, to] } = window;
    for r in first..last {
        let zero = (r + 1) * STRIDE + CACHE_LINE;
        let (out, lag) = (&mut out[zero + from..zero + to], &lag[r * COLS + from..r * COLS + to]);
        match quick {
            Some(quick) => {
                let heights = &quick.row(r + 1)[from + 1..=to];
                for ((out, lag), height) in out.iter_mut().zip(lag).zip(heights) {
                    *out = lag + height;
                }
            }
            None => out.copy_from_slice(lag),
        }
    }
}

/// e to the power -x, x at least 0, to some 1e-10; a library's last bit could differ from machine to machine.
fn decay(x: f64) -> f64 {
    if x > 50.0 {
        return 0.0;
    }
    // e^-x = (e^(-x/1024))^1024.
    let small = x / 1024.0;
    let series = 1.0
        - small
            * (1.0
                - small / 2.0
                    * (1.0 - small / 3.0 * (1.0 - small / 4.0 * (1.0 - small / 5.0 * (1.0 - small / 6.0)))));
    (0..10).fold(series, |power, _| power * power)
}

tega_simd::dispatched! {
    /// See [`follow_plain`].
    follow = follow_plain,
    (slow: &mut [f32], quick: Relief<'_>, window: Window, rule: (f32, [f32; 2], f32)) -> f32
}

tega_simd::dispatched! {
    /// See [`add_plain`].
    add = add_plain, (out: &mut [f32], quick: Option<Relief<'_>>, lag: &[f32], window: Window) -> ()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decay_is_the_exponential() {
        for x in [0.0, 1e-9, 0.01, 0.3, 1.0, 5.0, 40.0] {
            assert!((decay(x) / (-x).exp() - 1.0).abs() < 2e-11 * (1.0 + x), "{x}: {}", decay(x));
        }
        assert_eq!((decay(0.0), decay(1e9)), (1.0, 0.0));
    }

    #[test]
    fn what_is_left_fades_with_each_mode() {
        let memory = Memory { changed_s: 2.0, peaks: [0.5, 0.25], ..Memory::new(1.0) };
        for t_s in [2.0, 3.0, 20.0] {
            let wanted: f64 =
                MODES.iter().zip([0.5, 0.25]).map(|(m, peak)| peak * ((2.0 - t_s) / m.fall_s).exp()).sum();
            assert!((f64::from(memory.left(t_s)) - wanted).abs() < 1e-6, "{t_s}");
        }
    }

    #[test]
    fn two_steps_follow_as_one() {
        let cells = vec![1.0; (ROWS + 2) * STRIDE + CACHE_LINE];
        let window = Window { rows: [3, 5], cols: [8, 16] };
        let quick = Relief { cells: &cells, stride: STRIDE, window };
        let keep = |t_s: f64| [decay(t_s / 2.0) as f32, decay(t_s / 10.0) as f32];
        let (mut one, mut two) = (vec![0.0; ROWS * COLS], vec![0.0; ROWS * COLS]);
        let peak = follow(&mut one, quick, window, (0.5, keep(0.7), 1.0));
        follow(&mut two, quick, window, (0.5, keep(0.4), 1.0));
        follow(&mut two, quick, window, (0.5, keep(0.3), 1.0));
        assert!((peak - 0.5 * (1.0 - (-0.35f32).exp())).abs() < 1e-6);
        assert!(one.iter().zip(&two).all(|(a, b)| (a - b).abs() < 1e-6));
    }
    #[test]
    fn a_sum_has_each_cell_where_its_parts_have_it() {
        let window = Window { rows: [3, 5], cols: [8, 16] };
        let cells: Vec<f32> = (0u16..((ROWS + 2) * STRIDE + CACHE_LINE) as u16).map(f32::from).collect();
        let quick = Relief { cells: &cells, stride: STRIDE, window };
        let lag: Vec<f32> = (0..ROWS * COLS).map(|i| if i % 2 == 0 { 0.25 } else { 0.5 }).collect();
        for quick in [Some(quick), None] {
            let mut out = vec![0.0; cells.len()];
            add(&mut out, quick, &lag, window);
            let sum = Relief { cells: &out, stride: STRIDE, window };
            for (r, c) in (0..ROWS).flat_map(|r| (0..COLS).map(move |c| (r, c))) {
                let inside = (3..5).contains(&r) && (8..16).contains(&c);
                let height = quick.map_or(0.0, |quick| quick.row(r + 1)[c + 1]);
                let wanted = if inside { lag[r * COLS + c] + height } else { 0.0 };
                assert_eq!(sum.row(r + 1)[c + 1], wanted, "{r} {c}");
            }
        }
    }
}
