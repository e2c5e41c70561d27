//! Bindings of `tega-tactile`.

use std::cell::RefCell;

use numpy::{IntoPyArray, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray3};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use tega_error::choice;
use tega_tactile::{
    CentroidValue, ContactMetrics, Difference, Gate, LiveReader, LiveScratch, Options, Order, Outline, Pair,
    PaperScratch, Scratch, SensorNoise, Spread, TactileError, Weights, many, read_live, read_paper,
};

use crate::arguments::{Colours, Whole, image};
use crate::errors::BindError;
use crate::shared::{KEEP_UP_TO, Shared, released};

pub(crate) const ORDERS: [(&str, Order); 2] = [("bgr", Order::Bgr), ("rgb", Order::Rgb)];
const DIFFERENCES: [(&str, Difference); 3] = [
    ("signed", Difference::Signed),
    ("rectified", Difference::Rectified),
    ("absolute", Difference::Absolute),
];
const SPREADS: [(&str, Spread); 2] = [("spatial", Spread::Spatial), ("intensity", Spread::Intensity)];
const CENTROID_VALUES: [(&str, CentroidValue); 2] =
    [("nearest", CentroidValue::Nearest), ("bilinear", CentroidValue::Bilinear)];

pub(crate) const OUTLINES: [(&str, Outline); 2] = [("dent", Outline::Dent), ("contact", Outline::Contact)];
const READINGS: [(&str, Reading); 2] = [("paper", Reading::Paper), ("live", Reading::Live)];

/// The presets' readings.
#[derive(Clone, Copy)]
enum Reading {
    Paper,
    Live,
}

/// The fields of `tega.tactile.ContactMetrics`, in order.
type Fields = (f64, (f64, f64), f64, f64, u32, f64, f64, (usize, usize), bool);

fn fields(m: ContactMetrics) -> Fields {
    (m.mass, m.centroid_xy, m.spread, m.threshold, m.eda, m.cci, m.peak, m.peak_xy, m.in_contact)
}

/// Options of equations 1 to 6, parsed once.
#[pyclass(module = "tega._native", frozen)]
pub(crate) struct Equations(Options);

#[pymethods]
impl Equations {
    #[new]
    #[pyo3(signature = (*, weights, order, difference, spread, factor, centroid_value, gate))]
    fn new(
        weights: Colours,
        order: &str,
        difference: &str,
        spread: &str,
        factor: f64,
        centroid_value: &str,
        gate: Option<(f64, Whole)>,
    ) -> Result<Self, BindError> {
        let Colours([red, green, blue]) = weights;
        Ok(Self(Options {
            weights: Weights::printed(red, green, blue)?,
            order: choice("order", order, &ORDERS)?,
            difference: choice("difference", difference, &DIFFERENCES)?,
            spread: choice("spread", spread, &SPREADS)?,
            factor: Options::printed_factor(factor)?,
            centroid_value: choice("centroid_value", centroid_value, &CENTROID_VALUES)?,
            gate: gate
                .map(|(floor, pixels)| Gate::new(floor, pixels.to("min_pixels", "0 to 4294967295")?))
                .transpose()?,
        }))
    }

    #[pyo3(signature = (frame, baseline, /))]
    fn metrics(
        &self,
        py: Python<'_>,
        frame: &Bound<'_, PyAny>,
        baseline: &Bound<'_, PyAny>,
    ) -> Result<Fields, BindError> {
        with_pair(py, frame, baseline, |pair| SCRATCH.with_borrow_mut(|scratch| self.of(pair, scratch)))
    }

    #[pyo3(signature = (frames, baselines, /))]
    fn metrics_many(
        &self,
        py: Python<'_>,
        frames: Vec<Bound<'_, PyAny>>,
        baselines: Vec<Bound<'_, PyAny>>,
    ) -> Result<Vec<Fields>, BindError> {
        with_pairs(py, &frames, &baselines, |pairs, pixels| {
            let work = |pair: &Pair<'_>, scratch: &mut Scratch| self.of(pair, scratch);
            SCRATCH.with_borrow_mut(|scratch| many::each(pairs, pixels, scratch, work))
        })
    }
}

impl Equations {
    fn of(&self, pair: &Pair<'_>, scratch: &mut Scratch) -> Fields {
        fields(tega_tactile::contact_metrics(pair, &self.0, scratch))
    }
}

/// Borrows a frame and its baseline and runs `work` on them, without the interpreter lock where that pays.
fn with_pair<T: Send>(
    py: Python<'_>,
    frame: &Bound<'_, PyAny>,
    baseline: &Bound<'_, PyAny>,
    work: impl FnOnce(&Pair<'_>) -> T + Send,
) -> Result<T, BindError> {
    let (frame, baseline) = (image("frame", frame)?, image("baseline", baseline)?);
    let pair = Pair::new(frame.as_array(), baseline.as_array())?;
    Ok(released(py, pair.width() * pair.height() > KEEP_UP_TO, || work(&pair)))
}

/// The same for many frames and their baselines; `work` also takes how many pixels they have in all.
fn with_pairs<T: Send>(
    py: Python<'_>,
    frames: &[Bound<'_, PyAny>],
    baselines: &[Bound<'_, PyAny>],
    work: impl FnOnce(&[Pair<'_>], usize) -> T + Send,
) -> Result<T, BindError> {
    let borrow = |name, images: &[_]| images.iter().map(|i| image(name, i)).collect::<Result<Vec<_>, _>>();
    let (frames, baselines) = (borrow("frame", frames)?, borrow("baseline", baselines)?);
    let pairs = frames.iter().zip(&baselines).map(|(f, b)| Pair::new(f.as_array(), b.as_array()));
    let pairs = pairs.collect::<Result<Vec<_>, _>>()?;
    let pixels = pairs.iter().map(|pair| pair.width() * pair.height()).sum();
    Ok(released(py, pixels > KEEP_UP_TO, || work(&pairs, pixels)))
}

thread_local! {
    /// Buffers, sized by the first frame, then reused.
    static SCRATCH: RefCell<Scratch> = RefCell::default();
    static PRESETS: RefCell<PresetScratch> = RefCell::default();
}

#[derive(Default)]
struct PresetScratch {
    paper: PaperScratch,
    live: LiveScratch,
}

/// Options of a preset's reading, parsed once.
#[pyclass(module = "tega._native", frozen)]
pub(crate) struct Preset {
    reading: Reading,
    order: Order,
    outline: Outline,
    noise: SensorNoise,
}

/// Noise as it comes from Python: blue, green, red, counts; that of a DIGIT where none is given.
pub(crate) fn noise_of(bgr: Option<Colours>) -> Result<SensorNoise, BindError> {
    Ok(bgr.map(|Colours(bgr)| SensorNoise::of_counts(bgr)).transpose()?.unwrap_or_default())
}

#[pymethods]
impl Preset {
    #[new]
    #[pyo3(signature = (*, reading, order, outline, noise))]
    fn new(reading: &str, order: &str, outline: &str, noise: Option<Colours>) -> Result<Self, BindError> {
        Ok(Self {
            reading: choice("reading", reading, &READINGS)?,
            order: choice("order", order, &ORDERS)?,
            outline: choice("outline", outline, &OUTLINES)?,
            noise: noise_of(noise)?,
        })
    }

    #[pyo3(signature = (frame, baseline, /))]
    fn read(
        &self,
        py: Python<'_>,
        frame: &Bound<'_, PyAny>,
        baseline: &Bound<'_, PyAny>,
    ) -> Result<Fields, BindError> {
        Ok(fields(with_scratch(py, frame, baseline, |pair, scratch| self.metrics(pair, scratch))?))
    }

    #[pyo3(signature = (frames, baselines, /))]
    fn read_many(
        &self,
        py: Python<'_>,
        frames: Vec<Bound<'_, PyAny>>,
        baselines: Vec<Bound<'_, PyAny>>,
    ) -> Result<Vec<Fields>, BindError> {
        let found = with_pairs(py, &frames, &baselines, |pairs, pixels| {
            let work = |pair: &Pair<'_>, scratch: &mut PresetScratch| self.metrics(pair, scratch).map(fields);
            PRESETS.with_borrow_mut(|scratch| many::each(pairs, pixels, scratch, work))
        })?;
        Ok(found.into_iter().collect::<Result<_, _>>()?)
    }

    #[pyo3(signature = (frame, baseline, /))]
    fn mask<'py>(
        &self,
        py: Python<'py>,
        frame: &Bound<'py, PyAny>,
        baseline: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyArray2<bool>>, BindError> {
        let mask = with_scratch(py, frame, baseline, |pair, scratch| match self.reading {
            Reading::Paper => {
                read_paper(pair, self.order, &mut scratch.paper);
                Ok(scratch.paper.mask().collect::<Vec<_>>())
            }
            Reading::Live => {
                let (_, mask) = self.reader(pair, &mut scratch.live)?.mask(pair.frame())?;
                Ok(mask.iter().map(|&m| m != 0).collect())
            }
        })?;
        like_image(py, frame, mask)
    }

    #[pyo3(signature = (frame, baseline, /))]
    fn pressure_map<'py>(
        &self,
        py: Python<'py>,
        frame: &Bound<'py, PyAny>,
        baseline: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyArray2<f32>>, BindError> {
        let map = with_scratch(py, frame, baseline, |pair, scratch| match self.reading {
            Reading::Paper => {
                read_paper(pair, self.order, &mut scratch.paper);
                Ok(scratch.paper.pressure_map().collect::<Vec<_>>())
            }
            Reading::Live => {
                let reader = self.reader(pair, &mut scratch.live)?;
                reader.read(pair.frame())?;
                Ok(reader.pressure_map().collect())
            }
        })?;
        like_image(py, frame, map)
    }

    /// `live` for many frames of one sensor.
    #[pyo3(signature = (baseline, /))]
    fn known(&self, baseline: &Bound<'_, PyAny>) -> Result<KnownBaseline, BindError> {
        let baseline = image("baseline", baseline)?;
        let reader = LiveReader::new(baseline.as_array(), self.order, self.outline, self.noise)?;
        Ok(KnownBaseline(Shared::new(reader)))
    }
}

impl Preset {
    fn metrics(&self, pair: &Pair<'_>, scratch: &mut PresetScratch) -> Result<ContactMetrics, TactileError> {
        match self.reading {
            Reading::Paper => Ok(read_paper(pair, self.order, &mut scratch.paper)),
            Reading::Live => read_live(pair, self.order, self.outline, self.noise, &mut scratch.live),
        }
    }

    fn reader<'a>(
        &self,
        pair: &Pair<'_>,
        live: &'a mut LiveScratch,
    ) -> Result<&'a mut LiveReader, TactileError> {
        live.reader(pair, self.order, self.outline, self.noise)
    }
}

fn with_scratch<T: Send>(
    py: Python<'_>,
    frame: &Bound<'_, PyAny>,
    baseline: &Bound<'_, PyAny>,
    work: impl FnOnce(&Pair<'_>, &mut PresetScratch) -> Result<T, TactileError> + Send,
) -> Result<T, BindError> {
    let work = |pair: &Pair<'_>| PRESETS.with_borrow_mut(|scratch| work(pair, scratch));
    Ok(with_pair(py, frame, baseline, work)??)
}

/// Reads frames of one sensor against one picture of its untouched gel, as `live` does.
#[pyclass(module = "tega._native", frozen)]
pub(crate) struct KnownBaseline(Shared<LiveReader>);

#[pymethods]
impl KnownBaseline {
    #[pyo3(signature = (frame, /))]
    fn read(&self, py: Python<'_>, frame: &Bound<'_, PyAny>) -> Result<Fields, BindError> {
        let frame = image("frame", frame)?;
        let view = frame.as_array();
        let read = || self.0.with(|reader| reader.read(view));
        Ok(fields(released(py, view.len() / 3 > KEEP_UP_TO, read)?))
    }
}

/// The values of an image's pixels, row by row, as an array of its height and width.
fn like_image<'py, T: numpy::Element>(
    py: Python<'py>,
    frame: &Bound<'py, PyAny>,
    values: Vec<T>,
) -> Result<Bound<'py, PyArray2<T>>, BindError> {
    let (height, width, _) = image("frame", frame)?.as_array().dim();
    Ok(values.into_pyarray(py).reshape((height, width))?)
}

#[pyfunction]
pub(crate) fn estimate_baseline<'py>(
    py: Python<'py>,
    frames: Vec<Bound<'py, PyAny>>,
) -> Result<(Bound<'py, PyArray3<u8>>, Vec<usize>), BindError> {
    let frames = frames.iter().map(|frame| image("frame", frame)).collect::<Result<Vec<_>, _>>()?;
    let views: Vec<_> = frames.iter().map(PyReadonlyArray3::as_array).collect();
    let n: usize = views.iter().map(|view| view.len() / 3).sum();
    let found = released(py, n > KEEP_UP_TO, || tega_tactile::estimate_baseline(&views))?;
    Ok((found.image.into_pyarray(py), found.choice.frames))
}

/// Light and lines of a picture, as bytes.
type Votes<'py> = (f64, [Bound<'py, PyBytes>; 4]);

#[pyfunction]
#[pyo3(signature = (image, /))]
pub(crate) fn vote_lines<'py>(py: Python<'py>, image: &Bound<'py, PyAny>) -> Result<Votes<'py>, BindError> {
    let image = crate::arguments::image("image", image)?;
    let taken = tega_tactile::vote_lines(image.as_array());
    Ok((taken.light, taken.lines.map(|line| PyBytes::new(py, &line))))
}

#[pyfunction]
#[pyo3(signature = (image, /))]
pub(crate) fn picture_bands<'py>(
    py: Python<'py>,
    image: &Bound<'py, PyAny>,
) -> Result<Bound<'py, PyBytes>, BindError> {
    let image = crate::arguments::image("image", image)?;
    Ok(PyBytes::new(py, &tega_tactile::picture_bands(image.as_array())))
}

#[pyfunction]
#[pyo3(signature = (one, other, /))]
pub(crate) fn band_distances(one: &[u8], other: &[u8]) -> Vec<f64> {
    tega_tactile::band_distances(one, other)
}
