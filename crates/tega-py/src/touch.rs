//! Bindings of the touch tracker.

use std::hash::{DefaultHasher, Hash, Hasher};

use numpy::{IntoPyArray, PyArray2, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
use pyo3::types::{PyTuple, PyType};
use tega_error::choice;
use tega_tactile::{GelLight, LIGHT_TERMS, SensorNoise, Touch, TrackerOptions};

use crate::arguments::{Colours, Whole, image};
use crate::errors::{BindError, ShapeError};
use crate::shared::{KEEP_UP_TO, Shared, released};
use crate::tactile::{ORDERS, OUTLINES, noise_of};

/// What one frame says of a fingertip's contact. A value: it is made of its fields in order, as when it is unpickled, and
/// equal to another one with the same numbers, NaN among them.
#[derive(Debug)]
#[pyclass(module = "tega.tactile", name = "TrackedContact", frozen, get_all)]
#[allow(clippy::struct_field_names)] // the name that every record of a contact has
pub(crate) struct Contact {
    /// Whether something touches.
    in_contact: bool,
    /// Effective deformation area: outlined pixels; 0 without contact.
    eda: u32,
    /// The same in square millimetres, where the sensor's scale was given; else None.
    area_mm2: Option<f64>,
    /// Contact concentration index: `peak` over the root of `eda`, counts per pixel; focal contacts have more of it than broad ones.
    cci: f64,
    /// Height of the dent, counts: change of colour times the dent's width; rises with the press.
    peak: f64,
    /// Largest depth of the dent, millimetres; nominal unless the sensor's light was given.
    depth_mm: f64,
    /// Normal force, newtons: volume pressed in times the gel's stiffness; nominal unless the sensor's light was given.
    force_n: f64,
    /// Sum of the change of colour over the dent, counts times pixels.
    mass: f64,
    /// Middle of the dent (column, row): of its outline in an even light; NaN without contact.
    centroid_xy: (f64, f64),
    /// The same in millimetres from the picture's upper left corner, where the sensor's scale was given; else None.
    centroid_mm: Option<(f64, f64)>,
    /// Root mean square distance of the outlined pixels from their mean place, pixels; NaN without contact.
    spread: f64,
    /// The same in millimetres, where the sensor's scale was given; else None.
    spread_mm: Option<f64>,
    /// How sure the contact is, 0 to 1, graded around the threshold.
    strength: f64,
    /// Share of the picture that is outlined, 0 to 1.
    broad: f64,
    /// How much of the picture differs from the untouched gel, noise units; what the threshold is held against.
    difference: f64,
    /// `difference` from which a contact begins, noise units.
    threshold: f64,
}

const FIELDS: [&str; 16] = [
    "in_contact",
    "eda",
    "area_mm2",
    "cci",
    "peak",
    "depth_mm",
    "force_n",
    "mass",
    "centroid_xy",
    "centroid_mm",
    "spread",
    "spread_mm",
    "strength",
    "broad",
    "difference",
    "threshold",
];

#[pymethods]
impl Contact {
    #[new]
    #[pyo3(signature = (*fields))]
    fn new(fields: &Bound<'_, PyTuple>) -> Result<Self, BindError> {
        fn at<T>(fields: &Bound<'_, PyTuple>, place: usize) -> PyResult<T>
        where
            T: for<'a, 'py> FromPyObject<'a, 'py, Error = PyErr>,
        {
            fields.get_item(place)?.extract()
        }
        if fields.len() != FIELDS.len() {
            let message = format!("{} fields of a TrackedContact, wanted {}", fields.len(), FIELDS.len());
            return Err(ShapeError::new_err((message, "")).into());
        }
        Ok(Self {
            in_contact: at(fields, 0)?,
            eda: at::<Whole>(fields, 1)?.to("eda", "0 to 4294967295 pixels")?,
            area_mm2: at(fields, 2)?,
            cci: at(fields, 3)?,
            peak: at(fields, 4)?,
            depth_mm: at(fields, 5)?,
            force_n: at(fields, 6)?,
            mass: at(fields, 7)?,
            centroid_xy: at(fields, 8)?,
            centroid_mm: at(fields, 9)?,
            spread: at(fields, 10)?,
            spread_mm: at(fields, 11)?,
            strength: at(fields, 12)?,
            broad: at(fields, 13)?,
            difference: at(fields, 14)?,
            threshold: at(fields, 15)?,
        })
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyType>, Bound<'py, PyTuple>)> {
        let values = FIELDS.map(|name| slf.getattr(name)).into_iter().collect::<PyResult<Vec<_>>>()?;
        Ok((slf.get_type(), PyTuple::new(slf.py(), values)?))
    }

    // By the digits, in which NaN is equal to NaN: without contact there is no middle.
    fn __eq__(&self, other: &Self) -> bool {
        format!("{self:?}") == format!("{other:?}")
    }

    fn __hash__(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        format!("{self:?}").hash(&mut hasher);
        hasher.finish()
    }

    fn __repr__(&self) -> String {
        format!(
            "TrackedContact(in_contact={}, eda={}, cci={:.4}, peak={:.3}, depth_mm={:.3}, force_n={:.3}, strength={:.2})",
            if self.in_contact { "True" } else { "False" },
            self.eda,
            self.cci,
            self.peak,
            self.depth_mm,
            self.force_n,
            self.strength,
        )
    }
}

/// Pixels of a DIGIT's usual picture; larger ones are read without the interpreter lock.
const TRACKED_PX: usize = 320 * 240;

/// Terms of the light field, scale, stiffness.
type Light = ([[[f32; LIGHT_TERMS]; 2]; 3], f64, f64);

/// Follows one fingertip.
#[pyclass(module = "tega._native", frozen)]
pub(crate) struct TouchTracker {
    tracker: Shared<tega_tactile::TouchTracker>,
    /// Millimetres a pixel, where the scale is the sensor's own.
    mm_per_px: Option<f64>,
}

impl TouchTracker {
    fn contact(&self, t: &Touch) -> Contact {
        Contact {
            in_contact: t.in_contact,
            eda: t.eda,
            area_mm2: self.mm_per_px.map(|mm| mm * mm * f64::from(t.eda)),
            cci: t.cci,
            peak: t.peak,
            depth_mm: t.depth_mm,
            force_n: t.force_n,
            mass: t.mass,
            centroid_xy: t.centroid_xy,
            centroid_mm: self
                .mm_per_px
                .map(|mm| (mm * (t.centroid_xy.0 + 0.5), mm * (t.centroid_xy.1 + 0.5))),
            spread: t.spread,
            spread_mm: self.mm_per_px.map(|mm| mm * t.spread),
            strength: t.strength,
            broad: t.broad,
            difference: t.difference,
            threshold: t.threshold,
        }
    }
}

#[pymethods]
impl TouchTracker {
    #[new]
    #[pyo3(signature = (baseline, /, *, rate_hz, noise, light, order, outline, rezero))]
    #[allow(clippy::too_many_arguments)] // one argument per option of the tracker
    fn new(
        baseline: &Bound<'_, PyAny>,
        rate_hz: f64,
        noise: Option<Colours>,
        light: Option<Light>,
        order: &str,
        outline: &str,
        rezero: bool,
    ) -> Result<Self, BindError> {
        let image = image("baseline", baseline)?;
        let view = image.as_array();
        let known = light.is_some();
        let light = light.map_or_else(GelLight::default, |(terms, mm_per_px, stiffness_n_mm3)| GelLight {
            terms,
            mm_per_px,
            stiffness_n_mm3,
        });
        let (height, width, _) = view.dim();
        let scale = light.mm_per_px * 400.0 / ((height * height + width * width) as f64).sqrt();
        let options = TrackerOptions {
            rate_hz,
            order: choice("order", order, &ORDERS)?,
            noise: noise_of(noise)?,
            light,
            outline: choice("outline", outline, &OUTLINES)?,
            rezero,
        };
        let tracker = Shared::new(tega_tactile::TouchTracker::new(view, options)?);
        Ok(Self { tracker, mm_per_px: known.then_some(scale) })
    }

    #[getter]
    fn bears_load(&self) -> bool {
        self.tracker.with(|tracker| tracker.bears_load())
    }

    #[getter]
    fn banding(&self) -> f64 {
        self.tracker.with(|tracker| tracker.banding())
    }

    fn rezero(&self) -> bool {
        self.tracker.with(tega_tactile::TouchTracker::rezero)
    }

    #[pyo3(signature = (frame, /, *, dt_s, loaded))]
    fn update(
        &self,
        py: Python<'_>,
        frame: &Bound<'_, PyAny>,
        dt_s: Option<f64>,
        loaded: bool,
    ) -> Result<Contact, BindError> {
        let frame = image("frame", frame)?;
        let view = frame.as_array();
        let update = || self.tracker.with(|tracker| tracker.update(view, dt_s, loaded));
        let touch = released(py, view.len() > 3 * TRACKED_PX, update)?;
        Ok(self.contact(&touch))
    }

    #[pyo3(signature = (sums, /, *, dt_s, loaded))]
    fn update_sums(
        &self,
        sums: PyReadonlyArray2<'_, i16>,
        dt_s: Option<f64>,
        loaded: bool,
    ) -> Result<Contact, BindError> {
        let planes = sums.as_slice().ok().filter(|_| sums.as_array().nrows() == 3);
        let planes = planes.ok_or_else(|| {
            let shape = sums.as_array().dim();
            let message = format!("sums have shape {shape:?} or gaps, wanted (3, cells) without");
            ShapeError::new_err((message, ""))
        })?;
        let (first, rest) = planes.split_at(planes.len() / 3);
        let (second, third) = rest.split_at(planes.len() / 3);
        let touch = self.tracker.with(|tracker| tracker.update_sums([first, second, third], dt_s, loaded))?;
        Ok(self.contact(&touch))
    }

    fn mask<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyArray2<bool>>, BindError> {
        let (mask, shape) = self.tracker.with(|tracker| tracker.mask());
        Ok(mask.into_pyarray(py).reshape(shape)?)
    }

    fn depth_map<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyArray2<f32>>, BindError> {
        let (depth_mm, shape) = self.tracker.with(|tracker| tracker.depth_map());
        Ok(depth_mm.into_pyarray(py).reshape(shape)?)
    }
}

/// Reads the next frame of each finger; each takes whether another one bears a load.
#[pyfunction]
#[pyo3(signature = (trackers, frames, *, dt_s))]
pub(crate) fn update_fingers(
    py: Python<'_>,
    trackers: Vec<Py<TouchTracker>>,
    frames: Vec<Bound<'_, PyAny>>,
    dt_s: Option<f64>,
) -> Result<Vec<Contact>, BindError> {
    let images = frames.iter().map(|frame| image("frame", frame)).collect::<Result<Vec<_>, _>>()?;
    let views: Vec<_> = images.iter().map(PyReadonlyArray3::as_array).collect();
    let trackers: Vec<_> = trackers.iter().map(Py::get).collect();
    let n: usize = views.iter().map(|view| view.len() / 3).sum();
    let found: Vec<_> = released(py, n > KEEP_UP_TO, || {
        let bearing: Vec<_> = trackers.iter().map(|tracker| tracker.bears_load()).collect();
        let others = |k: usize| bearing.iter().enumerate().any(|(other, bears)| other != k && *bears);
        trackers
            .iter()
            .zip(views)
            .enumerate()
            .map(|(k, (tracker, view))| tracker.tracker.with(|tracker| tracker.update(view, dt_s, others(k))))
            .collect()
    });
    let contacts = trackers.iter().zip(found).map(|(tracker, touch)| Ok(tracker.contact(&touch?)));
    contacts.collect()
}

#[pyfunction]
#[pyo3(signature = (frames, *, order))]
pub(crate) fn sensor_noise(
    py: Python<'_>,
    frames: Vec<Bound<'_, PyAny>>,
    order: &str,
) -> Result<[f32; 3], BindError> {
    let order = choice("order", order, &ORDERS)?;
    let frames = frames.iter().map(|frame| image("frame", frame)).collect::<Result<Vec<_>, _>>()?;
    let views: Vec<_> = frames.iter().map(PyReadonlyArray3::as_array).collect();
    let n: usize = views.iter().map(|view| view.len() / 3).sum();
    Ok(released(py, n > KEEP_UP_TO, || SensorNoise::measure(&views, order))?.bgr)
}

/// The light field, scale and stiffness that are taken where none is given.
#[pyfunction]
pub(crate) fn nominal_light() -> Light {
    let light = GelLight::default();
    (light.terms, light.mm_per_px, light.stiffness_n_mm3)
}
