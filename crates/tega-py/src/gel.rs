//! Bindings of `tega-gel`.

use numpy::ndarray::arr2;
use numpy::{IntoPyArray, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use tega_error::choice;
use tega_gel::{CELLS, Form, HEIGHT, Indenter, PICTURE, Pad, SUM_CELLS, Setup, Shape, WIDTH};

use crate::arguments::Whole;
use crate::errors::{BindError, InvalidValueError, ShapeError};
use crate::shared::{Shared, released};

type Picture<'py> = Bound<'py, PyArray3<u8>>;
type Pressing<'py> = (String, [f64; 3], PyReadonlyArray2<'py, f64>, f64);
/// Range of seeds and of numbers of pictures.
const WORD: &str = "0 to 18446744073709551615";

type Found = (bool, usize, f64, f64, (f64, f64));

#[pyclass(module = "tega._native", frozen)]
pub(crate) struct Gel(Shared<tega_gel::Gel>);

#[pymethods]
impl Gel {
    #[new]
    #[pyo3(signature = (seed, /, *, spread, shape, memory))]
    fn new(py: Python<'_>, seed: Whole, spread: f64, shape: &str, memory: bool) -> Result<Self, BindError> {
        let seed = seed.to("seed", WORD)?;
        let form = choice("shape", shape, &[("digit", Form::Digit), ("flat", Form::Flat)])?;
        Ok(Self(Shared::new(released(py, true, || {
            tega_gel::Gel::new(Setup { seed, spread, form, memory })
        })?)))
    }

    #[pyo3(signature = (indenters, t_s, /, *))]
    fn press(&self, py: Python<'_>, indenters: Vec<Pressing<'_>>, t_s: f64) -> Result<bool, BindError> {
        let indenters = collect(indenters)?;
        Ok(released(py, true, || self.0.with(|gel| gel.press(&indenters, t_s)))?)
    }

    fn remains(&self, t_s: f64) -> bool {
        self.0.with(|gel| gel.remains(t_s))
    }

    fn last_s(&self) -> Option<f64> {
        self.0.with(|gel| gel.last_s())
    }

    fn forget(&self) {
        self.0.with(tega_gel::Gel::forget);
    }

    fn touch(&self) -> Found {
        let touch = self.0.with(|gel| gel.touch());
        let [x, y] = touch.centre_xy;
        (touch.touches, touch.area_px, touch.area_mm2, touch.depth_mm, (x, y))
    }

    fn in_view(&self) -> f64 {
        self.0.with(|gel| gel.in_view())
    }

    #[pyo3(signature = (indenters, index, /, *, t_s, out))]
    fn frame<'py>(
        &self,
        py: Python<'py>,
        indenters: Vec<Pressing<'py>>,
        index: Whole,
        t_s: f64,
        out: Picture<'py>,
    ) -> Result<(), BindError> {
        let (indenters, index) = (collect(indenters)?, index.to("index", WORD)?);
        let mut lent = out
            .try_readwrite()
            .map_err(|e| InvalidValueError::new_err((format!("out cannot be written: {e}"), "")))?;
        let shape = lent.as_array().dim();
        let pixels = lent.as_slice_mut().ok().filter(|_| shape == (HEIGHT, WIDTH, 3)).ok_or_else(|| {
            ShapeError::new_err((
                format!("out has shape {shape:?} or gaps, wanted ({HEIGHT}, {WIDTH}, 3) without"),
                "make it with numpy.empty((320, 240, 3), numpy.uint8)",
            ))
        })?;
        released(py, true, || {
            self.0.with(|gel| {
                gel.press(&indenters, t_s)?;
                gel.paint(index, pixels)
            })
        })?;
        Ok(())
    }

    #[pyo3(signature = (indenters, index, /, *, t_s))]
    fn sums<'py>(
        &self,
        py: Python<'py>,
        indenters: Vec<Pressing<'py>>,
        index: Whole,
        t_s: f64,
    ) -> Result<Bound<'py, PyArray2<i16>>, BindError> {
        let (indenters, index) = (collect(indenters)?, index.to("index", WORD)?);
        let mut sums = [[0; SUM_CELLS[0] * SUM_CELLS[1]]; 3];
        self.0.with(|gel| {
            gel.press(&indenters, t_s)?;
            gel.sums(index, &mut sums);
            Ok::<_, tega_gel::GelError>(())
        })?;
        Ok(PyArray2::from_owned_array(py, arr2(&sums)))
    }

    #[pyo3(signature = (index, /))]
    fn still<'py>(&self, py: Python<'py>, index: Whole) -> Result<Picture<'py>, BindError> {
        let (index, mut still) = (index.to("index", WORD)?, vec![0; PICTURE]);
        released(py, true, || self.0.with(|gel| gel.still(index, &mut still)))?;
        Ok(still.into_pyarray(py).reshape([HEIGHT, WIDTH, 3])?)
    }

    fn contact_mask<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyArray2<bool>>, BindError> {
        let mut mask = vec![false; HEIGHT * WIDTH];
        self.0.with(|gel| gel.contact_mask(&mut mask));
        Ok(mask.into_pyarray(py).reshape([HEIGHT, WIDTH])?)
    }

    fn displacement_mm<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyArray2<f32>>, BindError> {
        let mut displacement = vec![0.0; CELLS[0] * CELLS[1]];
        self.0.with(|gel| gel.displacement(&mut displacement));
        Ok(displacement.into_pyarray(py).reshape(CELLS)?)
    }

    fn surface<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyArray3<f32>>, BindError> {
        let mut surface = vec![[0.0; 4]; CELLS[0] * CELLS[1]];
        self.0.with(|gel| gel.surface(&mut surface));
        Ok(surface.into_flattened().into_pyarray(py).reshape([CELLS[0], CELLS[1], 4])?)
    }
}

fn collect(indenters: Vec<Pressing<'_>>) -> Result<Vec<Indenter>, BindError> {
    indenters
        .into_iter()
        .map(|(name, [a, b, c], pose, force_n)| {
            let shapes = [
                ("sphere", Shape::Sphere { radius: a }),
                ("cylinder", Shape::Cylinder { radius: a, half_length: b }),
                ("capsule", Shape::Capsule { radius: a, half_length: b }),
                ("box", Shape::Box { half: [a, b, c] }),
                ("plane", Shape::Plane),
            ];
            let shape = choice("shape", &name, &shapes)?;
            let view = pose.as_array();
            if view.dim() != (3, 4) {
                return Err(ShapeError::new_err((
                    format!("pose_mm has shape {:?}, wanted (3, 4)", view.dim()),
                    "pass rotation and translation side by side",
                ))
                .into());
            }
            let mut pose_mm = [[0.0; 4]; 3];
            pose_mm.as_flattened_mut().iter_mut().zip(view).for_each(|(to, from)| *to = *from);
            Ok(Indenter { shape, pose_mm, force_n })
        })
        .collect()
}

#[pyfunction]
#[pyo3(signature = (x_mm, y_mm, /))]
pub(crate) fn gel_fall(x_mm: f64, y_mm: f64) -> (f64, f64) {
    tega_gel::fall(x_mm, y_mm).into()
}

/// The arrays are of `MuJoCo`'s memory: a place (3,), and a rotation (9,), row after row.
#[pyfunction]
#[pyo3(signature = (pad, near_m, normal, shape, /, *, radius_m, half_length_m))]
pub(crate) fn gel_pad_pose<'py>(
    py: Python<'py>,
    pad: (PyReadonlyArray1<'py, f64>, PyReadonlyArray1<'py, f64>),
    near_m: [f64; 3],
    normal: [f64; 3],
    shape: (PyReadonlyArray1<'py, f64>, PyReadonlyArray1<'py, f64>),
    radius_m: f64,
    half_length_m: f64,
) -> Result<Bound<'py, PyArray2<f64>>, BindError> {
    let ((at_m, turned), (shape_m, lies)) = (placed(&pad)?, placed(&shape)?);
    let pad = Pad { radius_m, half_length_m, at_m, turned };
    Ok(PyArray2::from_owned_array(py, arr2(&tega_gel::pad_pose(&pad, near_m, normal, shape_m, &lies))))
}

fn placed(
    (at, turned): &(PyReadonlyArray1<'_, f64>, PyReadonlyArray1<'_, f64>),
) -> Result<([f64; 3], [[f64; 3]; 3]), BindError> {
    let wrong = || ShapeError::new_err(("a place is not (3,), or a rotation not (9,)", ""));
    let place = at.as_slice().ok().and_then(|at| at.try_into().ok());
    let turn = turned.as_slice().ok().filter(|turned| turned.len() == 9);
    let (place, (rows, _)) = (place.ok_or_else(wrong)?, turn.ok_or_else(wrong)?.as_chunks::<3>());
    Ok((place, rows.try_into().map_err(|_| wrong())?))
}
