//! Bindings of `tega-tactile`.

use std::cell::RefCell;

use numpy::{IntoPyArray, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use tega_tactile::{
    CentroidValue, ContactMetrics, Decimal, Difference, Gate, Options, Order, Pair, PaperScratch, Scratch,
    Spread, Weights, read_paper,
};

use crate::arguments::{choice, image};
use crate::errors::BindError;

/// Frames with fewer pixels are done before another thread could use the released lock.
const DETACH_FROM_PIXELS: usize = 4096;

const ORDERS: [(&str, Order); 2] = [("bgr", Order::Bgr), ("rgb", Order::Rgb)];
const DIFFERENCES: [(&str, Difference); 3] = [
    ("signed", Difference::Signed),
    ("rectified", Difference::Rectified),
    ("absolute", Difference::Absolute),
];
const SPREADS: [(&str, Spread); 2] = [("spatial", Spread::Spatial), ("intensity", Spread::Intensity)];
const CENTROID_VALUES: [(&str, CentroidValue); 2] =
    [("nearest", CentroidValue::Nearest), ("bilinear", CentroidValue::Bilinear)];

/// The fields of `tega.tactile.ContactMetrics`, in order.
type Fields = (f64, (f64, f64), f64, f64, u32, f64, f64, (usize, usize), bool);

fn fields(m: ContactMetrics) -> Fields {
    (m.mass, m.centroid_xy, m.spread, m.threshold, m.eda, m.cci, m.peak, m.peak_xy, m.in_contact)
}

/// Runs `work` without the interpreter lock where the frame is big enough for that to pay.
fn compute<T: Send>(py: Python<'_>, pair: &Pair<'_>, work: impl FnOnce() -> T + Send) -> T {
    if pair.width() * pair.height() < DETACH_FROM_PIXELS { work() } else { py.detach(work) }
}

#[pyfunction]
#[pyo3(signature = (frame, baseline, *, weights, order, difference, spread, factor, centroid_value, gate))]
#[allow(clippy::too_many_arguments)] // one argument per named reading of the equations
fn contact_metrics(
    py: Python<'_>,
    frame: &Bound<'_, PyAny>,
    baseline: &Bound<'_, PyAny>,
    weights: (f64, f64, f64),
    order: &str,
    difference: &str,
    spread: &str,
    factor: f64,
    centroid_value: &str,
    gate: Option<(f64, u32)>,
) -> Result<Fields, BindError> {
    let options = Options {
        weights: Weights::printed(weights.0, weights.1, weights.2)?,
        order: choice("order", order, &ORDERS)?,
        difference: choice("difference", difference, &DIFFERENCES)?,
        spread: choice("spread", spread, &SPREADS)?,
        factor: Decimal::printed("factor", factor)?,
        centroid_value: choice("centroid_value", centroid_value, &CENTROID_VALUES)?,
        gate: gate.map(|(floor, pixels)| Gate::new(floor, pixels)).transpose()?,
    };
    let (frame, baseline) = (image("frame", frame)?, image("baseline", baseline)?);
    let pair = Pair::new(frame.as_array(), baseline.as_array())?;
    let work = |scratch: &mut Scratch| tega_tactile::contact_metrics(&pair, &options, scratch);
    Ok(fields(compute(py, &pair, || SCRATCH.with_borrow_mut(work))))
}

thread_local! {
    /// Buffers, sized by the first frame, then reused.
    static SCRATCH: RefCell<Scratch> = RefCell::default();
    static PAPER: RefCell<PaperScratch> = RefCell::default();
}

/// Runs the `paper` reading and what `take` wants of its buffers.
fn with_paper<T: Send>(
    py: Python<'_>,
    frame: &Bound<'_, PyAny>,
    baseline: &Bound<'_, PyAny>,
    order: &str,
    take: impl FnOnce((usize, usize), ContactMetrics, &PaperScratch) -> T + Send,
) -> Result<T, BindError> {
    let order = choice("order", order, &ORDERS)?;
    let (frame, baseline) = (image("frame", frame)?, image("baseline", baseline)?);
    let pair = Pair::new(frame.as_array(), baseline.as_array())?;
    let read = |scratch: &mut PaperScratch| {
        let metrics = read_paper(&pair, order, scratch);
        take((pair.height(), pair.width()), metrics, scratch)
    };
    Ok(compute(py, &pair, || PAPER.with_borrow_mut(read)))
}

#[pyfunction]
#[pyo3(signature = (frame, baseline, *, reading, order))]
fn read_contact(
    py: Python<'_>,
    frame: &Bound<'_, PyAny>,
    baseline: &Bound<'_, PyAny>,
    reading: &str,
    order: &str,
) -> Result<Fields, BindError> {
    choice("reading", reading, &[("paper", ())])?;
    with_paper(py, frame, baseline, order, |_, metrics, _| fields(metrics))
}

#[pyfunction]
#[pyo3(signature = (frame, baseline, *, reading, order))]
fn contact_mask<'py>(
    py: Python<'py>,
    frame: &Bound<'py, PyAny>,
    baseline: &Bound<'py, PyAny>,
    reading: &str,
    order: &str,
) -> Result<Bound<'py, PyArray2<bool>>, BindError> {
    choice("reading", reading, &[("paper", ())])?;
    let (shape, mask) = with_paper(py, frame, baseline, order, |shape, _, scratch| {
        (shape, scratch.mask().collect::<Vec<_>>())
    })?;
    Ok(mask.into_pyarray(py).reshape(shape)?)
}

#[pyfunction]
#[pyo3(signature = (frame, baseline, *, reading, order))]
fn pressure_map<'py>(
    py: Python<'py>,
    frame: &Bound<'py, PyAny>,
    baseline: &Bound<'py, PyAny>,
    reading: &str,
    order: &str,
) -> Result<Bound<'py, PyArray2<f32>>, BindError> {
    choice("reading", reading, &[("paper", ())])?;
    let (shape, map) = with_paper(py, frame, baseline, order, |shape, _, scratch| {
        (shape, scratch.pressure_map().collect::<Vec<_>>())
    })?;
    Ok(map.into_pyarray(py).reshape(shape)?)
}

pub(crate) fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(contact_metrics, m)?)?;
    m.add_function(wrap_pyfunction!(read_contact, m)?)?;
    m.add_function(wrap_pyfunction!(contact_mask, m)?)?;
    m.add_function(wrap_pyfunction!(pressure_map, m)?)
}
