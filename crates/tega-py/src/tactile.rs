//! Bindings of `tega-tactile`.

use std::cell::RefCell;

use pyo3::prelude::*;
use tega_tactile::{
    CentroidValue, ContactMetrics, Decimal, Difference, Gate, Options, Order, Pair, PaperScratch, Spread,
    Weights, read_paper,
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
    Ok(fields(compute(py, &pair, || tega_tactile::contact_metrics(&pair, &options))))
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
    thread_local! {
        static PAPER: RefCell<PaperScratch> = RefCell::default();
    }
    let order = choice("order", order, &ORDERS)?;
    choice("reading", reading, &[("paper", ())])?;
    let (frame, baseline) = (image("frame", frame)?, image("baseline", baseline)?);
    let pair = Pair::new(frame.as_array(), baseline.as_array())?;
    Ok(fields(compute(py, &pair, || PAPER.with_borrow_mut(|scratch| read_paper(&pair, order, scratch)))))
}

pub(crate) fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(contact_metrics, m)?)?;
    m.add_function(wrap_pyfunction!(read_contact, m)?)
}
