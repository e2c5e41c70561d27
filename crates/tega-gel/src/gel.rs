//! A fingertip: what presses it, the picture, and what is true of the contact.

use crate::error::GelError;
use crate::grid::{CELL_PX, MARGIN_COLS, MARGIN_ROWS, PX_PER_MM};
use crate::membrane::{MAX_INDENTERS, Membrane};
use crate::noise::{EPOCH_FRAMES, Noise};
use crate::paint::Canvas;
use crate::shape::Indenter;
use crate::simd;
use crate::unit::{HEIGHT, LINE, Unit, WIDTH};

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

/// A simulated fingertip.
///
/// What it shows depends on seed, spread, indenters and frame number only, not on what it showed before.
#[derive(Debug, Clone)]
pub struct Gel {
    unit: Unit,
    noise: Noise,
    membrane: Membrane,
    canvas: Canvas,
    /// The still picture as it has drifted, counts less 128.
    drifted: Vec<i8>,
    epoch: Option<u64>,
    /// Whether anything lies against the gel.
    touches: bool,
}

impl Gel {
    /// Makes a unit.
    ///
    /// # Errors
    ///
    /// `spread` is not within 0 to 2.
    pub fn new(seed: u64, spread: f64) -> Result<Self, GelError> {
        if !(0.0..=2.0).contains(&spread) {
            return Err(GelError::Setting { name: "spread", value: spread, wanted: "0 to 2" });
        }
        Ok(Self {
            unit: Unit::new(seed, spread as f32),
            noise: Noise::new(seed),
            membrane: Membrane::new(),
            canvas: Canvas::new(),
            drifted: vec![0; PICTURE],
            epoch: None,
            touches: false,
        })
    }

    /// Presses these shapes, and none else, into the gel; returns whether anything lies against it.
    ///
    /// # Errors
    ///
    /// A number of an indenter is out of range, or there are more than [`MAX_INDENTERS`].
    pub fn press(&mut self, indenters: &[Indenter]) -> Result<bool, GelError> {
        if indenters.len() > MAX_INDENTERS {
            return Err(GelError::TooMany { got: indenters.len(), limit: MAX_INDENTERS });
        }
        indenters.iter().enumerate().try_for_each(|(index, indenter)| indenter.check(index))?;
        self.touches =
            indenters.iter().any(|i| i.force_n > 0.0) && simd::solve(&mut self.membrane, indenters);
        Ok(self.touches)
    }

    /// Measures what is true of the latest press; it is not measured before it is asked for.
    pub fn touch(&self) -> Touch {
        if !self.touches {
            return Touch { centre_xy: [f64::NAN; 2], ..Touch::default() };
        }
        let found = simd::measure(&self.membrane);
        let cell = CELL_PX as f64;
        let middle = |of: f32| cell * f64::from(of) / f64::from(found.sum) + (cell - 1.0) / 2.0;
        let area_px = found.cells * CELL_PX * CELL_PX;
        Touch {
            touches: true,
            area_px,
            area_mm2: area_px as f64 / (PX_PER_MM * PX_PER_MM),
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
        let membrane = self.touches.then_some(&self.membrane);
        simd::paint(&mut self.canvas, membrane, &self.unit, &self.drifted, noise, out);
        Ok(())
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

    /// Copies the gel's displacement under the picture, millimetres, one value a cell of 4 pixels: [`CELLS`].
    pub fn displacement(&self, out: &mut [f32]) {
        out.fill(0.0);
        if !self.touches {
            return;
        }
        for (r, row) in out.chunks_exact_mut(CELLS[1]).enumerate() {
            row.copy_from_slice(&self.membrane.heights(r + MARGIN_ROWS + 1)[MARGIN_COLS + 1..][..CELLS[1]]);
        }
    }

    fn drift(&mut self, index: u64) {
        let epoch = index / EPOCH_FRAMES;
        if self.epoch != Some(epoch) {
            simd::drifted(&self.noise, &self.unit.still, epoch, &mut self.drifted);
            self.epoch = Some(epoch);
        }
    }
}

fn check(out: &[u8]) -> Result<(), GelError> {
    if out.len() == PICTURE { Ok(()) } else { Err(GelError::Picture { got: out.len(), wanted: PICTURE }) }
}
