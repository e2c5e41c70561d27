//! A fingertip: what presses it, the picture, and what is true of the contact.

use tega_error::OutOfRange;

use crate::error::GelError;
use crate::form::Form;
use crate::grid::{CELL_PX, COLS, MARGIN_COLS, MARGIN_ROWS};
use crate::membrane::{self, Membrane, Relief};
use crate::memory::Memory;
use crate::noise::{EPOCH_FRAMES, Noise, drifted};
use crate::paint::{Canvas, paint};
use crate::picture::{HEIGHT, LINE, WIDTH};
use crate::shape::{Indenter, MAX_INDENTERS};
use crate::sums::{self, Summing, Sums};
use crate::unit::Unit;

/// Bytes of a picture: [`HEIGHT`] rows of [`WIDTH`] pixels of blue, green, red.
pub const PICTURE: usize = HEIGHT * LINE;

/// Rows and columns of [`Gel::displacement`].
pub const CELLS: [usize; 2] = [HEIGHT / CELL_PX, WIDTH / CELL_PX];

/// What is true of a contact, whatever the picture shows. Of what the picture shows of it: cells outside are left out.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Touch {
    /// Whether anything lies against the gel, in the picture or beside it.
    pub touches: bool,
    /// Touching area, pixels; a multiple of a cell's 16.
    pub area_px: usize,
    /// Touching area, square millimetres.
    pub area_mm2: f64,
    /// Largest displacement of the gel, millimetres.
    pub depth_mm: f64,
    /// Where the touching cells' displacement has its middle, pixels (column, row); NaN where nothing touches.
    pub centre_xy: [f64; 2],
}

/// What a unit is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setup {
    /// Of everything that differs between units, and of which noise each frame shows.
    pub seed: u64,
    /// How much units differ: 0 not at all, 1 as sensors may, at most 2.
    pub spread: f64,
    /// The gel's form.
    pub form: Form,
    /// Whether the gel gives way for a time and leaves something after release, and the colours drift for minutes.
    pub memory: bool,
}

impl Default for Setup {
    fn default() -> Self {
        Self { seed: 0, spread: 1.0, form: Form::Digit, memory: false }
    }
}

/// A simulated fingertip.
///
/// What it shows depends on its setup, indenters and frame number only; with memory also on what pressed before, and how
/// long.
#[derive(Debug, Clone)]
pub struct Gel {
    unit: Unit,
    noise: Noise,
    membrane: Membrane,
    canvas: Canvas,
    summing: Summing,
    /// The still picture as it has drifted, counts less 128.
    drifted: Vec<i8>,
    epoch: Option<u64>,
    /// Whether anything lies against the gel.
    touches: bool,
    memory: Option<Memory>,
    /// Whether what it remembers can be seen.
    lags: bool,
}

impl Gel {
    /// Makes a unit.
    ///
    /// # Errors
    ///
    /// The spread is not within 0 to 2.
    pub fn new(Setup { seed, spread, form, memory }: Setup) -> Result<Self, GelError> {
        if !(0.0..=2.0).contains(&spread) {
            return Err(OutOfRange::new("spread", spread, "", "0 to 2").into());
        }
        let unit = Unit::new(seed, spread as f32, form);
        Ok(Self {
            noise: Noise::new(seed, spread as f32, memory),
            membrane: Membrane::new(&unit.surface),
            memory: memory.then(|| Memory::new(unit.lag)),
            unit,
            canvas: Canvas::new(),
            summing: Summing::default(),
            drifted: vec![0; PICTURE],
            epoch: None,
            touches: false,
            lags: false,
        })
    }

    /// Presses these shapes, and none else, into the gel; returns whether anything lies against it. A gel with memory
    /// takes what pressed before to have pressed until `t_s`, seconds; to one without all times are alike.
    ///
    /// # Errors
    ///
    /// A number of an indenter is out of range, there are more than [`MAX_INDENTERS`], or time goes back; nothing is
    /// pressed then and no time has passed.
    pub fn press(&mut self, indenters: &[Indenter], t_s: f64) -> Result<bool, GelError> {
        if indenters.len() > MAX_INDENTERS {
            return Err(GelError::TooMany { got: indenters.len(), limit: MAX_INDENTERS });
        }
        indenters.iter().enumerate().try_for_each(|(index, indenter)| indenter.check(index))?;
        if let Some(memory) = &mut self.memory {
            let last_s = memory.last_s().unwrap_or(f64::MIN);
            if !(t_s >= last_s && t_s <= f64::MAX) {
                return Err(GelError::Time { t_s, last_s });
            }
            self.lags = memory.advance(t_s, &mut self.membrane);
        }
        self.touches =
            indenters.iter().any(|i| i.force_n > 0.0) && membrane::solve(&mut self.membrane, indenters);
        if let Some(memory) = &mut self.memory {
            memory.hold(self.touches);
        }
        Ok(self.touches)
    }

    /// Whether the gel would show anything at a time, seconds, if nothing pressed it from then on.
    pub fn remains(&self, t_s: f64) -> bool {
        self.memory.as_ref().is_some_and(|memory| memory.remains(t_s))
    }

    /// Time of the latest press of a gel with memory, seconds.
    pub fn last_s(&self) -> Option<f64> {
        self.memory.as_ref().and_then(Memory::last_s)
    }

    /// Forgets whatever pressed, and what time it is.
    pub fn forget(&mut self) {
        if let Some(memory) = &mut self.memory {
            memory.forget(&mut self.membrane);
        }
        (self.touches, self.lags) = (false, false);
    }

    /// Measures what is true of the latest press; it is not measured before it is asked for.
    pub fn touch(&self) -> Touch {
        if !self.touches {
            return Touch { centre_xy: [f64::NAN; 2], ..Touch::default() };
        }
        let found = membrane::measure(&self.membrane);
        let cell = CELL_PX as f64;
        let middle = |of: f32| cell * f64::from(of) / f64::from(found.sum) + (cell - 1.0) / 2.0;
        let area_px = found.cells * CELL_PX * CELL_PX;
        Touch {
            touches: true,
            area_px,
            area_mm2: f64::from(found.area),
            depth_mm: f64::from(found.depth),
            centre_xy: if found.cells > 0 {
                [middle(found.right), middle(found.down)]
            } else {
                [f64::NAN; 2]
            },
        }
    }

    /// Paints the latest press as frame `index` shows it.
    ///
    /// # Errors
    ///
    /// `out` has not [`PICTURE`] bytes.
    pub fn paint(&mut self, index: u64, out: &mut [u8]) -> Result<(), GelError> {
        check(out)?;
        self.drift(index);
        let noise = (&self.noise, self.noise.part(index));
        let relief = relief(&mut self.memory, &self.membrane, [self.lags, self.touches]);
        paint(&mut self.canvas, relief, &self.unit.light, &self.drifted, noise, out);
        Ok(())
    }

    /// Sums the picture of the latest press over cells of 8 x 8 pixels, as frame `index` shows it: to the bit those of
    /// [`Self::paint`].
    pub fn sums(&mut self, index: u64, out: &mut Sums) {
        self.drift(index);
        self.summing.drifted(self.epoch, &self.drifted);
        let noise = (&self.noise, self.noise.part(index));
        let relief = relief(&mut self.memory, &self.membrane, [self.lags, self.touches]);
        let light = &self.unit.light;
        sums::sum(&mut self.summing, &mut self.canvas, relief, light, &self.drifted, noise, out);
    }

    /// The untouched gel without noise, as it has drifted by frame `index`.
    ///
    /// # Errors
    ///
    /// `out` has not [`PICTURE`] bytes.
    pub fn still(&mut self, index: u64, out: &mut [u8]) -> Result<(), GelError> {
        check(out)?;
        self.drift(index);
        for (out, drifted) in out.iter_mut().zip(&self.drifted) {
            *out = (*drifted as u8) ^ 0x80;
        }
        Ok(())
    }

    /// Marks the touching pixels of the latest press; their number is [`Touch::area_px`].
    pub fn contact_mask(&self, out: &mut [bool]) {
        out.fill(false);
        if !self.touches {
            return;
        }
        for (y, row) in out.chunks_exact_mut(WIDTH).enumerate() {
            for (x, pixel) in row.iter_mut().enumerate() {
                *pixel = self.membrane.touches(y / CELL_PX + MARGIN_ROWS, x / CELL_PX + MARGIN_COLS);
            }
        }
    }

    /// Share of the latest press's touching area that is in the picture, 0 to 1, found on cells of 8 pixels; NaN where none touches. What
    /// lies more than 3.4 mm beyond the picture is not counted, so that it is rather less than told.
    pub fn in_view(&self) -> f64 {
        if self.touches { self.membrane.in_view() } else { f64::NAN }
    }

    /// Copies the gel's displacement under the picture, millimetres, one value a cell of 4 pixels: [`CELLS`].
    pub fn displacement(&self, out: &mut [f32]) {
        out.fill(0.0);
        for (r, row) in out.chunks_exact_mut(CELLS[1]).enumerate() {
            if self.touches {
                row.copy_from_slice(
                    &self.membrane.relief().row(r + MARGIN_ROWS + 1)[MARGIN_COLS + 1..][..CELLS[1]],
                );
            }
            if self.lags {
                let lag = &self.membrane.lag()[(r + MARGIN_ROWS) * COLS + MARGIN_COLS..];
                row.iter_mut().zip(lag).for_each(|(height, lag)| *height += lag);
            }
        }
    }

    /// Where the untouched gel lies that each of [`CELLS`] shows, millimetres: x, y, and z under the gel's top; and its
    /// area, square millimetres.
    pub fn surface(&self, out: &mut [[f32; 4]]) {
        let grid = self.membrane.finest();
        for (r, row) in out.chunks_exact_mut(CELLS[1]).enumerate() {
            for (c, cell) in row.iter_mut().enumerate() {
                let k = (r + MARGIN_ROWS) * COLS + c + MARGIN_COLS;
                *cell = [grid.x[k], grid.y[k], -grid.drop[k], grid.area[k]];
            }
        }
    }

    fn drift(&mut self, index: u64) {
        let epoch = index / EPOCH_FRAMES;
        if self.epoch != Some(epoch) {
            drifted(&self.noise, &self.unit.still, epoch, &mut self.drifted);
            self.epoch = Some(epoch);
        }
    }
}

/// What the gel shows: its displacement, and what it remembers of those before.
fn relief<'a>(
    memory: &'a mut Option<Memory>,
    membrane: &'a Membrane,
    [lags, touches]: [bool; 2],
) -> Option<Relief<'a>> {
    match memory {
        Some(memory) if lags => Some(memory.relief(membrane, touches)),
        _ => touches.then(|| membrane.relief()),
    }
}

fn check(out: &[u8]) -> Result<(), GelError> {
    if out.len() == PICTURE { Ok(()) } else { Err(GelError::Picture { got: out.len(), wanted: PICTURE }) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::Shape;

    fn ball(force_n: f64) -> Indenter {
        let pose_mm = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
        Indenter { shape: Shape::Sphere { radius: 4.4 }, pose_mm, force_n }
    }

    fn remembering() -> Gel {
        Gel::new(Setup { seed: 3, spread: 0.0, memory: true, ..Setup::default() })
            .expect("a spread within bounds")
    }

    fn depth(gel: &Gel) -> f32 {
        let mut cells = vec![0.0; CELLS[0] * CELLS[1]];
        gel.displacement(&mut cells);
        cells.iter().fold(0.0, |most, cell| most.max(*cell))
    }

    /// Sums a painted picture over its cells, pixel by pixel.
    fn sum_picture(picture: &[u8], out: &mut Sums) {
        *out = [[0; 1200]; 3];
        for (k, value) in picture.iter().enumerate() {
            let (y, x) = (k / LINE, k % LINE / 3);
            out[k % 3][y / 8 * 30 + x / 8] += i16::from(*value);
        }
    }

    #[test]
    fn sums_are_those_of_the_painted_picture() {
        for (seed, spread) in [(3, 0.0), (4, 1.0), (5, 2.0)] {
            let setup = Setup { seed, spread, memory: true, ..Setup::default() };
            let mut gel = Gel::new(setup).expect("a spread within bounds");
            let (mut picture, mut found, mut wanted) = (vec![0; PICTURE], [[0; 1200]; 3], [[0; 1200]; 3]);
            for index in (0..200).step_by(5) {
                // From nothing over a touch to one as hard as any, from place to place, and what is left of it.
                let k = index as f64;
                let mut ball = ball(if index % 40 < 30 { 0.02 * k * k / (1.0 + 0.05 * k) } else { 0.0 });
                ball.pose_mm[0][3] = 9.0 * (0.7 * k).sin();
                ball.pose_mm[1][3] = 11.0 * (0.3 * k).sin();
                gel.press(&[ball], k / 60.0).expect("a ball");
                gel.paint(index, &mut picture).expect("a picture");
                sum_picture(&picture, &mut wanted);
                gel.sums(index, &mut found);
                assert!(found == wanted, "seed {seed}, frame {index}");
            }
        }
    }

    #[test]
    fn rest_in_one_step_leaves_what_many_leave_to_the_bit() {
        let (mut one, mut many) = (remembering(), remembering());
        for gel in [&mut one, &mut many] {
            gel.press(&[ball(3.0)], 0.0).expect("a ball");
            gel.press(&[], 2.0).expect("nothing");
        }
        for k in 1..100 {
            many.press(&[], 2.0 + 0.03 * f64::from(k)).expect("nothing");
        }
        one.press(&[], 5.0).expect("nothing");
        many.press(&[], 5.0).expect("nothing");
        assert_eq!(depth(&one), depth(&many));
        assert!(depth(&one) > 0.01 && one.remains(5.0) && !one.touch().touches);
    }

    #[test]
    fn a_press_out_of_order_or_out_of_range_changes_nothing() {
        let mut gel = remembering();
        gel.press(&[ball(3.0)], 1.0).expect("a ball");
        gel.press(&[ball(3.0)], 2.0).expect("a ball");
        let before = gel.touch();
        for t_s in [1.5, f64::NAN, f64::INFINITY] {
            assert!(matches!(gel.press(&[], t_s), Err(GelError::Time { .. })));
        }
        assert!(gel.press(&[ball(-1.0)], 3.0).is_err());
        assert_eq!((gel.touch(), gel.last_s()), (before, Some(2.0)));
    }

    #[test]
    fn a_new_contact_begins_from_what_the_last_one_left() {
        let (mut gel, mut fresh) = (remembering(), remembering());
        gel.press(&[ball(5.0)], 0.0).expect("a ball");
        gel.press(&[], 2.0).expect("nothing");
        gel.press(&[ball(1.0)], 2.5).expect("a ball");
        fresh.press(&[ball(1.0)], 2.5).expect("a ball");
        assert!(gel.touch().depth_mm > fresh.touch().depth_mm + 0.05);
    }
}
