//! Take what Python gives, byte images and whole numbers, refused with a message that helps.

use numpy::{PyArray3, PyArrayMethods, PyReadonlyArray3, PyUntypedArray};
use pyo3::exceptions::PyOverflowError;
use pyo3::prelude::*;
use tega_error::OutOfRange;

use crate::errors::{BindError, DtypeError, InvalidValueError, ShapeError};

/// Borrows an 8-bit colour image: uint8, three dimensions, any strides, writeable or not.
pub(crate) fn image<'py>(
    name: &str,
    value: &Bound<'py, PyAny>,
) -> Result<PyReadonlyArray3<'py, u8>, BindError> {
    match value.cast::<PyArray3<u8>>() {
        Ok(array) => {
            refuse_mask(name, value)?;
            Ok(array.try_readonly().map_err(|e| InvalidValueError::new_err((format!("{name}: {e}"), "")))?)
        }
        Err(_) => Err(why_not_an_image(name, value)),
    }
}

/// What is masked would be read as if it were not.
fn refuse_mask(name: &str, value: &Bound<'_, PyAny>) -> PyResult<()> {
    if value.is_exact_instance_of::<PyUntypedArray>() || !value.hasattr("mask")? {
        return Ok(());
    }
    match value.getattr("mask")?.call_method0("sum")?.extract()? {
        0u64 => Ok(()),
        n => {
            let message = format!("{name} has {n} masked values");
            Err(InvalidValueError::new_err((message, "fill the mask first, with numpy.ma.filled")))
        }
    }
}

/// A whole number of any size. One that fits no machine word is refused by its name, where `PyO3` raises `OverflowError`.
#[derive(Clone, Copy)]
pub(crate) enum Whole {
    Signed(i64),
    Unsigned(u64),
    Beyond(f64),
}

impl FromPyObject<'_, '_> for Whole {
    type Error = PyErr;

    fn extract(given: Borrowed<'_, '_, PyAny>) -> PyResult<Self> {
        match given.extract() {
            Ok(number) => Ok(Self::Signed(number)),
            Err(error) if error.is_instance_of::<PyOverflowError>(given.py()) => {
                let end = if given.lt(0)? { f64::NEG_INFINITY } else { f64::INFINITY };
                let beyond = |_| Self::Beyond(given.extract().unwrap_or(end));
                Ok(given.extract().map_or_else(beyond, Self::Unsigned))
            }
            Err(error) => Err(error),
        }
    }
}

impl Whole {
    /// The number as one of Rust's, or the error that names it.
    pub(crate) fn to<T: TryFrom<i64> + TryFrom<u64>>(
        self,
        name: &'static str,
        wanted: &'static str,
    ) -> Result<T, OutOfRange> {
        let fits = match self {
            Self::Signed(number) => T::try_from(number).ok(),
            Self::Unsigned(number) => T::try_from(number).ok(),
            Self::Beyond(_) => None,
        };
        fits.ok_or_else(|| self.out_of_range(name, wanted))
    }

    pub(crate) fn out_of_range(self, name: &'static str, wanted: &'static str) -> OutOfRange {
        let value = match self {
            Self::Signed(number) => number as f64,
            Self::Unsigned(number) => number as f64,
            Self::Beyond(near) => near,
        };
        OutOfRange::new(name, value, "", wanted)
    }
}

/// Three numbers, one a colour; of another length a `ShapeError`, where `PyO3` raises a plain `ValueError`.
pub(crate) struct Colours(pub(crate) [f64; 3]);

impl FromPyObject<'_, '_> for Colours {
    type Error = PyErr;

    fn extract(given: Borrowed<'_, '_, PyAny>) -> PyResult<Self> {
        let numbers: Vec<f64> = given.extract()?;
        let wrong = |numbers: Vec<f64>| {
            let message = format!("{} numbers, wanted 3", numbers.len());
            ShapeError::new_err((message, "give one for each colour"))
        };
        Ok(Self(numbers.try_into().map_err(wrong)?))
    }
}

fn why_not_an_image(name: &str, value: &Bound<'_, PyAny>) -> BindError {
    let (Ok(dtype), Ok(shape)) = (value.getattr("dtype"), value.getattr("shape")) else {
        let kind = value.get_type().name().map_or_else(|_| "object".to_owned(), |n| n.to_string());
        return DtypeError::new_err((
            format!("{name} is a {kind}, wanted a numpy array of uint8"),
            "read the image with cv2.imread or convert it with numpy.asarray(image, numpy.uint8)",
        ))
        .into();
    };
    if dtype.to_string() == "uint8" {
        ShapeError::new_err((
            format!("{name} has shape {shape}, wanted (height, width, 3)"),
            "pass one colour image",
        ))
        .into()
    } else {
        DtypeError::new_err((
            format!("{name} has dtype {dtype}, wanted uint8"),
            "pass the camera's 8-bit image; a float image has to be scaled to 0..255 and rounded by you",
        ))
        .into()
    }
}
