//! Bindings of `tega-emg`.

// PyO3 hands extracted arguments over by value.
#![allow(clippy::needless_pass_by_value)]

use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use tega_emg::{Blocks, ChannelFault, EmgError, Fusion, Intervals, Kind, Preset, Rules, VoteRules};
use tega_error::OutOfRange;

use crate::arguments::Whole;
use crate::errors::{BindError, ShapeError};
use crate::shared::{KEEP_UP_TO, Shared, released};

#[pyclass(module = "tega._native", frozen)]
pub(crate) struct ButterworthLowpass(Shared<tega_emg::ButterworthLowpass>);

#[pymethods]
impl ButterworthLowpass {
    #[new]
    #[pyo3(signature = (rate_hz, cutoff_hz, order, channels))]
    fn new(rate_hz: f64, cutoff_hz: f64, order: Whole, channels: Whole) -> Result<Self, BindError> {
        let (order, channels) = (count("order", order)?, count("channels", channels)?);
        Ok(Self(Shared::new(tega_emg::ButterworthLowpass::new(rate_hz, cutoff_hz, order, channels)?)))
    }

    fn process<'py>(
        &self,
        py: Python<'py>,
        samples: PyReadonlyArray2<'py, f64>,
    ) -> Result<Bound<'py, PyArray2<f64>>, BindError> {
        let channels = self.channels();
        let (rows, mut out) = (rows(&samples, channels)?, Vec::new());
        released(py, rows.len() > KEEP_UP_TO, || self.0.with(|core| core.process(rows, &mut out)))?;
        matrix(py, out, channels)
    }

    #[getter]
    fn channels(&self) -> usize {
        self.0.with(|core| core.channels())
    }

    #[getter]
    fn sos<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyArray2<f64>>, BindError> {
        matrix(py, self.0.with(|core| core.sos().rows().concat()), 6)
    }

    #[getter]
    fn held_samples<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u64>> {
        self.0.with(|core| core.held_samples()).into_pyarray(py)
    }
}

/// Its channels may be left to the first chunk.
#[pyclass(module = "tega._native", frozen)]
pub(crate) struct BlockMean {
    tau: usize,
    core: Shared<Option<tega_emg::BlockMean>>,
}

#[pymethods]
impl BlockMean {
    #[new]
    #[pyo3(signature = (tau, channels))]
    fn new(tau: Whole, channels: Option<Whole>) -> Result<Self, BindError> {
        let wanted = channels.map_or(Ok(1), |channels| count("channels", channels))?;
        let tau = count("tau", tau)?;
        let core = tega_emg::BlockMean::new(tau, wanted)?;
        Ok(Self { tau, core: Shared::new(channels.is_some().then_some(core)) })
    }

    fn process<'py>(
        &self,
        py: Python<'py>,
        samples: PyReadonlyArray2<'py, f64>,
    ) -> Result<Bound<'py, PyArray2<f64>>, BindError> {
        let channels = self.channels().unwrap_or(samples.shape()[1]);
        let (rows, mut out) = (rows(&samples, channels)?, Vec::new());
        released(py, rows.len() > KEEP_UP_TO, || {
            self.core.with(|core| {
                let core = match core {
                    Some(core) => core,
                    none => none.insert(tega_emg::BlockMean::new(self.tau, channels)?),
                };
                core.process(rows, &mut out)
            })
        })?;
        matrix(py, out, channels)
    }

    #[getter]
    fn channels(&self) -> Option<usize> {
        self.core.with(|core| core.as_ref().map(tega_emg::BlockMean::channels))
    }

    #[getter]
    fn held_samples<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u64>> {
        let held = self.core.with(|core| core.as_ref().map(tega_emg::BlockMean::held_samples));
        held.unwrap_or_default().into_pyarray(py)
    }
}

#[pyclass(module = "tega._native", frozen)]
pub(crate) struct GraspIntent(Shared<Steering>);

struct Steering {
    core: tega_emg::GraspIntent,
    last: Blocks,
}

#[pymethods]
impl GraspIntent {
    #[new]
    #[pyo3(signature = (rate_hz, maxima, tau, kind, preset, *, cutoff_hz, order, intervals, fusion, weights))]
    #[allow(clippy::too_many_arguments, reason = "one argument a keyword of the Python class")]
    fn new(
        rate_hz: f64,
        maxima: PyReadonlyArray1<'_, f64>,
        tau: Whole,
        kind: &str,
        preset: &str,
        cutoff_hz: f64,
        order: Whole,
        intervals: Whole,
        fusion: &str,
        weights: Option<Vec<f64>>,
    ) -> Result<Self, BindError> {
        let (kind, preset, tau) = (Kind::parse(kind)?, Preset::parse(preset)?, count("tau", tau)?);
        let rules = Rules {
            cutoff_hz,
            order: count("order", order)?,
            intervals: Intervals::from_count(count("intervals", intervals)?)?,
            fusion: Fusion::parse(fusion)?,
            weights,
        };
        let maxima = maxima.as_array().to_vec();
        let core = tega_emg::GraspIntent::with_rules(rate_hz, &maxima, tau, kind, preset, rules)?;
        Ok(Self(Shared::new(Steering { core, last: Blocks::default() })))
    }

    fn process<'py>(
        &self,
        py: Python<'py>,
        samples: PyReadonlyArray2<'py, f64>,
    ) -> Result<Bound<'py, PyArray1<i64>>, BindError> {
        let rows = rows(&samples, self.channels())?;
        let fused = released(py, rows.len() > KEEP_UP_TO, || {
            self.0.with(|state| {
                state.last = state.core.process(rows)?;
                Ok::<_, EmgError>(widened(&state.last.fused))
            })
        })?;
        Ok(fused.into_pyarray(py))
    }

    #[getter]
    fn channels(&self) -> usize {
        self.0.with(|state| state.core.channels())
    }

    #[getter]
    fn levels<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyArray2<i64>>, BindError> {
        matrix(py, self.0.with(|state| widened(&state.last.levels)), self.channels())
    }

    #[getter]
    fn maxima<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.0.with(|state| state.core.maxima().to_vec()).into_pyarray(py)
    }

    #[getter]
    fn bad_channels<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, self.0.with(|state| state.core.bad_channels()))
    }

    #[getter]
    fn held_samples<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u64>> {
        self.0.with(|state| state.core.held_samples()).into_pyarray(py)
    }

    #[getter]
    fn holding(&self) -> bool {
        self.0.with(|state| state.core.holding())
    }
}

/// Whether a fault is another than before, and the samples to go on with where they are not those given.
type Judged<'py> = (bool, Option<Bound<'py, PyArray2<f64>>>);

#[pyclass(module = "tega._native", frozen)]
pub(crate) struct ChannelVotes(Shared<tega_emg::ChannelVotes>);

#[pymethods]
impl ChannelVotes {
    #[new]
    #[pyo3(signature = (
        rate_hz, *, hop, stuck, stuck_from, still, mains, mains_share, mains_rms, lines_hz, back
    ))]
    #[allow(clippy::too_many_arguments, reason = "one argument a rule")]
    fn new(
        rate_hz: f64,
        hop: Whole,
        stuck: Whole,
        stuck_from: Vec<f64>,
        still: Whole,
        mains: Whole,
        mains_share: f64,
        mains_rms: Vec<f64>,
        lines_hz: Vec<f64>,
        back: Whole,
    ) -> Result<Self, BindError> {
        let (hop, stuck, still) = (count("hop", hop)?, count("stuck", stuck)?, count("still", still)?);
        let (mains, back) = (count("mains", mains)?, count("back", back)?);
        let rules =
            VoteRules { hop, stuck, stuck_from, still, mains, mains_share, mains_rms, lines_hz, back };
        Ok(Self(Shared::new(tega_emg::ChannelVotes::new(rate_hz, rules)?)))
    }

    fn take<'py>(
        &self,
        py: Python<'py>,
        samples: PyReadonlyArray2<'py, f64>,
    ) -> Result<Judged<'py>, BindError> {
        let channels = self.0.with(|core| core.channels());
        let (rows, mut passed) = (rows(&samples, channels)?, Vec::new());
        let changed =
            released(py, rows.len() > KEEP_UP_TO, || self.0.with(|core| core.take(rows, &mut passed)))?;
        let passed = (!passed.is_empty()).then(|| matrix(py, passed, channels)).transpose()?;
        Ok((changed, passed))
    }

    #[getter]
    fn faults(&self) -> Vec<Option<(&'static str, f64)>> {
        let named = |fault| match fault {
            ChannelFault::Stuck(value) => ("stuck", value),
            ChannelFault::Mains(line_hz) => ("mains", line_hz),
        };
        self.0.with(|core| core.faults().map(|fault| fault.map(named)).collect())
    }

    #[getter]
    fn began(&self) -> Option<i64> {
        self.0.with(|core| core.began())
    }

    #[getter]
    fn still(&self) -> bool {
        self.0.with(|core| core.still())
    }

    #[getter]
    fn room(&self) -> usize {
        self.0.with(|core| core.room())
    }
}

#[pyfunction]
#[pyo3(signature = (value, maximum))]
pub(crate) fn grasp_level(value: f64, maximum: f64) -> Result<u8, BindError> {
    Ok(tega_emg::grasp_level(value, maximum)?)
}

#[pyfunction]
#[pyo3(signature = (levels))]
pub(crate) fn fuse_levels(levels: Vec<Whole>) -> Result<u8, BindError> {
    // What does not fit a byte is no level either, and is named by the value given.
    let levels = levels.into_iter().map(|level| level.to("level", "1 to 5"));
    let levels: Vec<u8> = levels.collect::<Result<_, _>>()?;
    Ok(tega_emg::fuse_levels(&levels)?)
}

#[pyfunction]
#[pyo3(signature = (samples, rate_hz, tau, kind, percentile))]
pub(crate) fn channel_maxima<'py>(
    py: Python<'py>,
    samples: PyReadonlyArray2<'py, f64>,
    rate_hz: f64,
    tau: Whole,
    kind: &str,
    percentile: f64,
) -> Result<Bound<'py, PyArray1<f64>>, BindError> {
    let (channels, kind, tau) = (samples.shape()[1], Kind::parse(kind)?, count("tau", tau)?);
    let rows = rows(&samples, channels)?;
    let maxima = released(py, rows.len() > KEEP_UP_TO, || {
        tega_emg::channel_maxima(rows, channels, rate_hz, tau, kind, percentile)
    })?;
    Ok(maxima.into_pyarray(py))
}

fn rows<'a>(samples: &'a PyReadonlyArray2<'_, f64>, wanted: usize) -> Result<&'a [f64], BindError> {
    let got = samples.shape()[1];
    if got != wanted {
        return Err(EmgError::Channels { got, wanted }.into());
    }
    let scattered = |_| ShapeError::new_err(("samples are not C-contiguous", "copy them first"));
    Ok(samples.as_slice().map_err(scattered)?)
}

fn matrix<T: numpy::Element>(
    py: Python<'_>,
    values: Vec<T>,
    columns: usize,
) -> Result<Bound<'_, PyArray2<T>>, BindError> {
    let shape = (values.len() / columns, columns);
    let array =
        Array2::from_shape_vec(shape, values).map_err(|e| ShapeError::new_err((e.to_string(), "")))?;
    Ok(array.into_pyarray(py))
}

fn widened(levels: &[u8]) -> Vec<i64> {
    levels.iter().map(|l| i64::from(*l)).collect()
}

fn count(name: &'static str, value: Whole) -> Result<usize, OutOfRange> {
    value.to(name, "1 or more, in 64 bits")
}
