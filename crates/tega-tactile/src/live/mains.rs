//! Light that flickers with the mains: bands in pictures whose rows are read one after the other.
//!
//! A lamp on mains of 50 or 60 Hz flickers at 100 or 120 Hz. A rolling shutter turns that into bands, along rows or, where the picture is turned, along
//! columns, which move from picture to picture. Each line of cells then has a gain of its own, the same for the three colours. At rest the
//! variance of that gain is measured: as the covariance of two outer thirds of the picture, which neither noise nor a dent in one of them
//! adds to, over the three quarters of the lines that have least of it. Where there are bands, the gain of each line is fitted with that variance as its prior and taken out.
//!
//! A dent on a line pulls its gain, and always to the same side, so a contact differs from bands in that it stays: bands that move from picture to
//! picture have no mean. In contact the gains are fitted to what a picture differs by from the mean of those before. Bands that hardly move are a
//! wave of known length ([`super::wave`]), or else are fitted to the change itself, in which a contact is hardly trusted. Where there are none,
//! nothing is changed.

use super::cells::Grid;
use super::colour::Field;
use super::lines::Lines;
use super::wave::Wave;

/// Root mean square gain from which bands are taken out: about 0.2 % of amplitude.
const LEAST: f64 = 0.0015;
/// The gain that a picture may have which would else be the first of a contact, root mean square.
const TRIED: f64 = 0.015;
/// How the variance is learned, seconds; at first its frames are averaged.
const LEARN_S: f64 = 2.0;
/// Share of a sine's square that is left without its largest quarter.
const KEPT: f64 = 0.525;
/// Pictures that the variance is known from.
const ENOUGH: f64 = 60.0;
/// Rounds of the robust fit.
const ROUNDS: usize = 3;
/// How the mean of a contact's pictures is taken, seconds; at first over as many as there are.
const HELD_S: f64 = 0.5;
/// Bands move where two pictures one after the other have less than this share of their gains' square in common.
const MOVES: f64 = 0.97;
/// A wave is followed where they have more than this share.
const FOLLOWED: f64 = 0.9;
/// Change of a cell that a wave leaves, mean square in noise units, from which the cell is less trusted.
const LEFT: f32 = 2.0;
/// Which lines of cells a band lies along.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Along {
    Rows,
    Columns,
}

pub(super) const BOTH: [Along; 2] = [Along::Rows, Along::Columns];

/// What is known of the bands.
#[derive(Debug, Clone, Default)]
pub(super) struct Mains {
    /// Variance of the gain along rows and columns, as shares.
    variance: [f64; 2],
    frames: f64,
    /// Outer thirds of the last picture that was measured, along rows and columns, and the first one's gains in the picture before.
    thirds: [[Lines; 2]; 2],
    before: [Vec<f32>; 2],
    /// Along rows and columns, bands that hardly move.
    waves: [Wave; 2],
    /// Means of what the thirds' gains have in common, now and with those before.
    common: [[f64; 2]; 2],
    lines: Lines,
    trust: Vec<f32>,
    /// What each cell adds to its line, of the picture that was measured last.
    answers: [Vec<f32>; 2],
    /// Mean of a contact's pictures, how many they are, the last two, and what the last one differs by, noise units.
    held: Field,
    pictures: f64,
    last: [Field; 2],
    moved: Field,
}

impl Mains {
    /// Variance of the gain along rows and columns in a change, as shares squared.
    pub fn measure(&mut self, white: &Field, gel: &Field, noise: [f32; 3], grid: &Grid) -> [f64; 2] {
        answers(white, gel, noise, &mut self.answers);
        BOTH.map(|along| self.covariance(grid, along))
    }

    /// Learns from the variances of a picture without contact; `dt_s` after the one that it learned from before.
    pub fn learn(&mut self, variances: [f64; 2], dt_s: f64) {
        self.frames += 1.0;
        let share = (dt_s / (LEARN_S + dt_s)).max(1.0 / self.frames);
        self.variance.iter_mut().zip(variances).for_each(|(of, now)| *of += share * (now - *of));
        for (wave, [one, other]) in self.waves.iter_mut().zip(&self.thirds) {
            wave.learn([&one.gain, &other.gain], dt_s);
        }
        for (([one, other], before), common) in self.thirds.iter().zip(&mut self.before).zip(&mut self.common)
        {
            let now = [&one.gain, &*before].map(|gain| f64::from(dot(gain, &other.gain)));
            common.iter_mut().zip(now).for_each(|(of, now)| *of += share * (now - *of));
            before.clone_from(&one.gain);
        }
    }

    /// The bands that are taken out, if any.
    fn known(&self) -> Option<(Along, f64)> {
        let [rows, columns] = self.variance;
        let along = if columns > rows { Along::Columns } else { Along::Rows };
        let variance = rows.max(columns);
        (variance > LEAST * LEAST).then_some((along, variance))
    }

    /// Bands that hardly move, if there are any and none that do: the stronger ones, as bands along one way leave a faint trace along the other.
    fn wave(&self) -> Option<Along> {
        let moves = self.known().is_some_and(|(along, _)| self.moves(along, FOLLOWED));
        let [rows, columns] = self.waves.each_ref().map(Wave::power);
        let (along, power) = if columns > rows { (Along::Columns, columns) } else { (Along::Rows, rows) };
        (power > 0.0 && !moves).then_some(along)
    }

    /// Whether two pictures one after the other have less than a share of their gains' square in common.
    fn moves(&self, along: Along, share: f64) -> bool {
        let [now, before] = self.common[along as usize];
        before < share * now
    }

    /// Whether any bands are taken out.
    pub fn are_seen(&self) -> bool {
        self.known().is_some() || self.wave().is_some()
    }

    /// Amplitude of the bands, as a share of the light; 0 where there are none.
    pub fn amplitude(&self) -> f64 {
        self.known().map_or(0.0, |(_, variance)| (2.0 * variance).sqrt())
    }

    /// Takes known bands out of a change; whether there were any. `held_s` is the time since the last picture where both show a contact.
    pub fn correct(
        &mut self,
        white: &mut Field,
        gel: &Field,
        noise: [f32; 3],
        grid: &Grid,
        held_s: Option<f64>,
    ) -> bool {
        if let Some(along) = self.wave() {
            self.fit_wave(white, gel, noise, grid, along);
            self.take_out(white, gel, noise, grid, along);
            return true;
        }
        let Some((along, variance)) = self.known() else { return false };
        let [now, before] = self.common[along as usize];
        if let Some(held_s) = held_s.filter(|_| self.moves(along, MOVES)) {
            let mut moved = std::mem::take(&mut self.moved);
            self.hold(white, held_s, (before / now).clamp(-1.0, MOVES), &mut moved);
            self.fit(&moved, gel, noise, grid, along, variance);
            self.moved = moved;
        } else {
            self.pictures = 0.0;
            self.fit(white, gel, noise, grid, along, variance);
        }
        self.take_out(white, gel, noise, grid, along);
        true
    }

    /// Takes a change into the mean of a contact's, `dt_s` after the one before; `moved` is what it differs by.
    ///
    /// Of three pictures a sum is taken that a wave has no part in which turns by the arc cosine of `turn` from one to the next.
    fn hold(&mut self, white: &Field, dt_s: f64, turn: f64, moved: &mut Field) {
        self.pictures += 1.0;
        let still = self.pictures - 2.0;
        if still == 1.0 {
            self.held.clone_from(white);
        }
        moved.clone_from(white);
        // Slow waves are distinguished from a contact after some more pictures.
        let told = still * (2.0 - 2.0 * turn) >= 1.0;
        if still > 0.0 {
            let share = (dt_s / (HELD_S + dt_s)).max(1.0 / still);
            let outer = (share / (2.0 - 2.0 * turn)) as f32;
            let [inner, kept] = [-2.0 * turn as f32 * outer, (1.0 - share) as f32];
            let [second, first] = &self.last;
            for (c, (moved, held)) in moved.iter_mut().zip(&mut self.held).enumerate() {
                let pictures = first[c].iter().zip(&second[c]).zip(&white[c]);
                for (((first, second), third), (moved, held)) in pictures.zip(moved.iter_mut().zip(held)) {
                    *held = kept * *held + (outer * (first + third) + inner * second);
                    *moved -= if told { *held } else { 0.0 };
                }
            }
        }
        self.last.swap(0, 1);
        self.last[0].clone_from(white);
    }

    /// Takes bands of any strength out of a change along one way, where none were known; whether it did.
    pub fn tries(
        &mut self,
        white: &mut Field,
        gel: &Field,
        noise: [f32; 3],
        grid: &Grid,
        along: Along,
    ) -> bool {
        if self.known().is_none() {
            self.fit(white, gel, noise, grid, along, TRIED * TRIED);
            self.take_out(white, gel, noise, grid, along);
        }
        self.known().is_none()
    }

    /// Whether enough pictures were looked at.
    pub fn knows(&self) -> bool {
        self.frames >= ENOUGH
    }

    /// Fits the gain of each line to a change.
    fn fit(&mut self, white: &Field, gel: &Field, noise: [f32; 3], grid: &Grid, along: Along, variance: f64) {
        let n = grid.cells();
        let held = (1.0 / variance) as f32;
        // A cell whose colours differ by no more than bands do is trusted.
        let mut bright = 0.0;
        for (gel, noise) in gel.iter().zip(noise) {
            bright += gel.iter().map(|b| b * b).sum::<f32>() / (noise * noise);
        }
        let usual = 1.0 + 2.0 * variance as f32 * bright / (3 * n) as f32;
        self.lines.clear(lines_of(grid, along));
        for _ in 0..ROUNDS {
            self.weigh(white, gel, noise, grid, along, usual);
            // Bands are wider than a line: one that a contact covers has its neighbours' gain.
            self.lines.spread();
            self.lines.solve(held);
        }
    }

    /// Fits a wave of known length to a change, from that of the picture before on.
    fn fit_wave(&mut self, white: &Field, gel: &Field, noise: [f32; 3], grid: &Grid, along: Along) {
        let held = (1.0 / (TRIED * TRIED)) as f32;
        for _ in 0..ROUNDS {
            self.waves[along as usize].gains(&mut self.lines.gain);
            self.weigh(white, gel, noise, grid, along, LEFT);
            self.waves[along as usize].fit(&self.lines.products, &self.lines.squares, held);
        }
        self.waves[along as usize].gains(&mut self.lines.gain);
    }

    /// Sums each line's cells, trusted by what the lines' gains leave of their change, against what bands usually do.
    fn weigh(&mut self, white: &Field, gel: &Field, noise: [f32; 3], grid: &Grid, along: Along, usual: f32) {
        let n = grid.cells();
        self.trust.clear();
        self.trust.extend((0..n).map(|k| {
            let change = |c: usize| {
                let left = white[c][k] - self.lines.gain[line(k, grid, along)] * gel[c][k] / noise[c];
                left * left
            };
            let distrust = 1.0 + ((change(0) + change(2)) + change(1)) / (3.0 * usual);
            1.0 / (distrust * distrust)
        }));
        for sums in [&mut self.lines.products, &mut self.lines.squares] {
            sums.clear();
            sums.resize(lines_of(grid, along), 0.0);
        }
        let [white, gel] = [white, gel].map(|field| field.each_ref().map(Vec::as_slice));
        for k in 0..n {
            let [product, square] = answer(white, gel, noise, k);
            let at = line(k, grid, along);
            self.lines.products[at] += self.trust[k] * product;
            self.lines.squares[at] += self.trust[k] * square;
        }
    }

    /// Takes the gains that were fitted last out of a change.
    fn take_out(&self, white: &mut Field, gel: &Field, noise: [f32; 3], grid: &Grid, along: Along) {
        for ((white, gel), noise) in white.iter_mut().zip(gel).zip(noise) {
            for (k, (white, gel)) in white.iter_mut().zip(gel).enumerate() {
                *white -= self.lines.gain[line(k, grid, along)] * gel / noise;
            }
        }
    }

    /// Covariance of the gains of two outer thirds of the picture.
    fn covariance(&mut self, grid: &Grid, along: Along) -> f64 {
        let (lines, across) =
            if along == Along::Rows { (grid.rows, grid.cols) } else { (grid.cols, grid.rows) };
        let third = across / 3;
        if third == 0 || lines < 4 {
            return 0.0;
        }
        for (part, lines_of) in self.thirds[along as usize].iter_mut().enumerate() {
            lines_of.clear(lines);
            let first = if part == 0 { 0 } else { across - third };
            for (sums, answers) in
                [&mut lines_of.products, &mut lines_of.squares].into_iter().zip(&self.answers)
            {
                let rows = answers.chunks_exact(grid.cols);
                if along == Along::Rows {
                    let places = rows.map(|row| row.iter().skip(first).take(third));
                    sums.iter_mut()
                        .zip(places)
                        .for_each(|(sum, places)| *sum = places.fold(0.0, |sum, v| sum + v));
                } else {
                    for row in rows.skip(first).take(third) {
                        sums.iter_mut().zip(row).for_each(|(sum, v)| *sum += v);
                    }
                }
            }
            // A black line has no gain.
            lines_of.solve(1.0);
            lines_of.level();
        }
        let [one, other] = &self.thirds[along as usize];
        self.trust.clear();
        self.trust.extend(one.gain.iter().zip(&other.gain).map(|(a, b)| a * b));
        // Bands lie over all of the picture: without the quarter of the lines that have most, a bar across it adds nothing.
        let kept = lines - lines / 4;
        self.trust.select_nth_unstable_by(kept - 1, f32::total_cmp);
        self.trust.truncate(kept);
        self.trust.sort_unstable_by(f32::total_cmp);
        f64::from(self.trust.iter().sum::<f32>()) / (KEPT * lines as f64)
    }
}

/// How many lines there are.
fn lines_of(grid: &Grid, along: Along) -> usize {
    if along == Along::Rows { grid.rows } else { grid.cols }
}

/// The line of a cell.
fn line(k: usize, grid: &Grid, along: Along) -> usize {
    if along == Along::Rows { k / grid.cols } else { k % grid.cols }
}

/// Sum of products.
fn dot(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// What a cell adds to its line: its change times its light, and its light squared, noise units; blue or red first alike.
#[inline(always)]
fn answer(white: [&[f32]; 3], gel: [&[f32]; 3], noise: [f32; 3], k: usize) -> [f32; 2] {
    let mut both = [[0.0; 2]; 3];
    for c in 0..3 {
        let light = gel[c][k] / noise[c];
        both[c] = [white[c][k] * light, light * light];
    }
    let [first, middle, last] = both;
    [(first[0] + last[0]) + middle[0], (first[1] + last[1]) + middle[1]]
}

/// What every cell adds.
#[inline(always)]
fn answers_plain(white: &Field, gel: &Field, noise: [f32; 3], out: &mut [Vec<f32>; 2]) {
    let n = white.iter().chain(gel).map(Vec::len).min().unwrap_or_default();
    for out in &mut *out {
        out.resize(n, 0.0);
    }
    let [white, gel] = [white, gel].map(|field| field.each_ref().map(|plane| &plane[..n]));
    let [products, squares] = out.each_mut().map(|out| &mut out[..n]);
    for k in 0..n {
        [products[k], squares[k]] = answer(white, gel, noise, k);
    }
}

tega_simd::dispatched! {
    /// See [`answers_plain`].
    answers = answers_plain, (white: &Field, gel: &Field, noise: [f32; 3], out: &mut [Vec<f32>; 2]) -> ()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_two_waves_the_stronger_one_is_followed() {
        let gains = |amplitude: f32, periods: f32| -> Vec<f32> {
            (0..40).map(|k| amplitude * (std::f32::consts::TAU * periods * k as f32 / 40.0).sin()).collect()
        };
        // Bands along one way, and the trace that they leave along the other.
        for strong in BOTH {
            let mut mains = Mains::default();
            for along in BOTH {
                let gain = if along == strong { gains(0.02, 3.6) } else { gains(0.0006, 1.5) };
                (0..30).for_each(|_| mains.waves[along as usize].learn([&gain, &gain], 1.0 / 30.0));
                assert!(mains.waves[along as usize].is_known());
            }
            assert_eq!(mains.wave(), Some(strong));
        }
        assert_eq!(Mains::default().wave(), None);
    }
}
