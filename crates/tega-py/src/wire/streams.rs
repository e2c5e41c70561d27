//! Decoders of the muscle sensors' streams. One thread feeds, others may ask for the counts meanwhile.

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use tega_wire::{ascii, chords, cyton, spiker};

use super::setting;
use crate::arguments::Whole;
use crate::errors::BindError;
use crate::shared::{KEEP_UP_TO, Shared, released};

type Column<'py, T> = Bound<'py, PyArray1<T>>;
type Rows<'py, T> = Bound<'py, PyArray2<T>>;

fn rows<T: numpy::Element>(py: Python<'_>, flat: Vec<T>, columns: usize) -> PyResult<Rows<'_, T>> {
    let n = flat.len() / columns;
    PyArray1::from_vec(py, flat).reshape([n, columns])
}

/// Counters, missing, counts, microvolts, acceleration in g, board time in ms, auxiliary bytes, footers.
type CytonParts<'py> = (
    Column<'py, u8>,
    Column<'py, u8>,
    Rows<'py, i32>,
    Rows<'py, f64>,
    Rows<'py, f64>,
    Column<'py, i64>,
    Rows<'py, u8>,
    Column<'py, u8>,
);

#[pyclass(module = "tega._native", frozen)]
pub(crate) struct CytonStream(Shared<cyton::Decoder>);

#[pymethods]
impl CytonStream {
    #[new]
    #[pyo3(signature = (*, gain))]
    fn new(gain: Whole) -> Result<Self, BindError> {
        let gain = setting("gain", gain, "1, 2, 4, 6, 8, 12 or 24")?;
        Ok(Self(Shared::new(cyton::Decoder::new(gain)?)))
    }

    #[pyo3(signature = (data, /))]
    fn feed<'py>(&self, py: Python<'py>, data: &[u8]) -> Result<CytonParts<'py>, BindError> {
        let (packets, microvolts) = released(py, data.len() > KEEP_UP_TO, || {
            self.0.with(|decoder| {
                let packets = decoder.feed(data);
                let microvolts = packets.iter().flat_map(|p| decoder.microvolts(p)).collect();
                (packets, microvolts)
            })
        });
        let counts = packets.iter().flat_map(|p| p.counts).collect();
        let acceleration_g = packets.iter().flat_map(cyton::Packet::acceleration_g).collect();
        let time_ms = packets.iter().map(|p| p.time_ms().map_or(-1, i64::from)).collect();
        let aux = packets.iter().flat_map(|p| p.aux_bytes).collect();
        Ok((
            PyArray1::from_iter(py, packets.iter().map(|p| p.counter)),
            PyArray1::from_iter(py, packets.iter().map(|p| p.missing)),
            rows(py, counts, cyton::CHANNELS)?,
            rows(py, microvolts, cyton::CHANNELS)?,
            rows(py, acceleration_g, 3)?,
            PyArray1::from_vec(py, time_ms),
            rows(py, aux, 6)?,
            PyArray1::from_iter(py, packets.iter().map(|p| p.footer)),
        ))
    }

    /// Packets, missing packets, skipped bytes, pending bytes.
    fn stats(&self) -> (u64, u64, u64, usize) {
        let stats = self.0.with(|decoder| decoder.stats());
        (stats.packets, stats.missing_packets, stats.skipped_bytes, stats.pending_bytes)
    }
}

type ChordsParts<'py> = (Column<'py, u8>, Column<'py, u8>, Rows<'py, u16>);

#[pyclass(module = "tega._native", frozen)]
pub(crate) struct ChordsStream {
    decoder: Shared<chords::Decoder>,
    channels: usize,
}

#[pymethods]
impl ChordsStream {
    #[new]
    #[pyo3(signature = (*, channels))]
    fn new(channels: Whole) -> Result<Self, BindError> {
        let channels = setting("channels", channels, "1 to 16")?;
        Ok(Self { decoder: Shared::new(chords::Decoder::new(channels)?), channels })
    }

    #[pyo3(signature = (data, /))]
    fn feed<'py>(&self, py: Python<'py>, data: &[u8]) -> Result<ChordsParts<'py>, BindError> {
        let packets =
            released(py, data.len() > KEEP_UP_TO, || self.decoder.with(|decoder| decoder.feed(data)));
        let counters = PyArray1::from_iter(py, packets.iter().map(|p| p.counter));
        let missing = PyArray1::from_iter(py, packets.iter().map(|p| p.missing));
        let samples = packets.into_iter().flat_map(|p| p.samples).collect();
        Ok((counters, missing, rows(py, samples, self.channels)?))
    }

    /// Packets, missing packets, skipped bytes, pending bytes.
    fn stats(&self) -> (u64, u64, u64, usize) {
        let stats = self.decoder.with(|decoder| decoder.stats());
        (stats.packets, stats.missing_packets, stats.skipped_bytes, stats.pending_bytes)
    }
}

#[pyfunction]
#[pyo3(signature = (data, /))]
pub(crate) fn chords_channels(data: &[u8]) -> Option<usize> {
    chords::detect_channels(data)
}

#[pyclass(module = "tega._native", frozen)]
pub(crate) struct SpikerStream {
    decoder: Shared<spiker::Decoder>,
    channels: usize,
}

#[pymethods]
impl SpikerStream {
    #[new]
    #[pyo3(signature = (*, channels))]
    fn new(channels: Whole) -> Result<Self, BindError> {
        let channels = setting("channels", channels, "1 to 6")?;
        Ok(Self { decoder: Shared::new(spiker::Decoder::new(channels)?), channels })
    }

    #[pyo3(signature = (data, /))]
    fn feed<'py>(&self, py: Python<'py>, data: &[u8]) -> Result<Rows<'py, u16>, BindError> {
        let frames =
            released(py, data.len() > KEEP_UP_TO, || self.decoder.with(|decoder| decoder.feed(data)));
        Ok(rows(py, frames.concat(), self.channels)?)
    }

    /// Frames, bad frames, skipped bytes, pending bytes.
    fn stats(&self) -> (u64, u64, u64, usize) {
        let stats = self.decoder.with(|decoder| decoder.stats());
        (stats.frames, stats.bad_frames, stats.skipped_bytes, stats.pending_bytes)
    }
}

#[pyclass(module = "tega._native", frozen)]
pub(crate) struct AsciiStream {
    decoder: Shared<ascii::Decoder>,
    channels: usize,
}

#[pymethods]
impl AsciiStream {
    #[new]
    #[pyo3(signature = (*, channels, leading, drop_first))]
    fn new(channels: Whole, leading: Whole, drop_first: bool) -> Result<Self, BindError> {
        let (channels, leading) =
            (setting("channels", channels, "1 to 64")?, setting("leading", leading, "0 to 64")?);
        Ok(Self { decoder: Shared::new(ascii::Decoder::new(channels, leading, drop_first)?), channels })
    }

    #[pyo3(signature = (data, /))]
    fn feed<'py>(&self, py: Python<'py>, data: &[u8]) -> Result<Rows<'py, f64>, BindError> {
        let samples =
            released(py, data.len() > KEEP_UP_TO, || self.decoder.with(|decoder| decoder.feed(data)));
        Ok(rows(py, samples, self.channels)?)
    }

    /// Lines, rejected lines, dropped bytes, pending bytes.
    fn stats(&self) -> (u64, u64, u64, usize) {
        let stats = self.decoder.with(|decoder| decoder.stats());
        (stats.lines, stats.rejected_lines, stats.dropped_bytes, stats.pending_bytes)
    }

    fn last_rejected<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.decoder.with(|decoder| decoder.last_rejected().to_vec()))
    }
}
