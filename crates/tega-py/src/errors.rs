//! The one place where the core crates' errors become Python exceptions.
//!
//! To add an error: add the variant in its crate, then the arm here (the matches have no `_` arm, so the compiler
//! asks for it). The Python classes live in `python/tega/errors.py`.

use pyo3::import_exception;
use pyo3::prelude::*;
use tega_emg::EmgError;
use tega_error::{OutOfRange, UnknownChoice};
use tega_gel::GelError;
use tega_hand::HandError;
use tega_haptics::HapticsError;
use tega_tactile::TactileError;
use tega_wire::WireError as CoreWireError;

import_exception!(tega.errors, CalibrationError);
import_exception!(tega.errors, DtypeError);
import_exception!(tega.errors, InvalidValueError);
import_exception!(tega.errors, ShapeError);
import_exception!(tega.errors, WireError);

/// A core error on its way to Python.
pub(crate) struct BindError(PyErr);

impl From<BindError> for PyErr {
    fn from(e: BindError) -> Self {
        e.0
    }
}

impl From<PyErr> for BindError {
    fn from(e: PyErr) -> Self {
        Self(e)
    }
}

impl From<OutOfRange> for BindError {
    fn from(e: OutOfRange) -> Self {
        Self(InvalidValueError::new_err((e.to_string(), "")))
    }
}

impl From<UnknownChoice> for BindError {
    fn from(e: UnknownChoice) -> Self {
        Self(InvalidValueError::new_err((e.to_string(), e.hint())))
    }
}

impl From<TactileError> for BindError {
    fn from(e: TactileError) -> Self {
        let args = (e.to_string(), e.hint());
        Self(match e {
            TactileError::ShapeMismatch { .. }
            | TactileError::Mixed { .. }
            | TactileError::Channels { .. }
            | TactileError::Size { .. }
            | TactileError::Cells { .. } => ShapeError::new_err(args),
            TactileError::WeightSum { .. }
            | TactileError::OutOfRange(_)
            | TactileError::TooFewFrames { .. }
            | TactileError::NoFrames => InvalidValueError::new_err(args),
        })
    }
}

impl From<EmgError> for BindError {
    fn from(e: EmgError) -> Self {
        let args = (e.to_string(), e.hint());
        Self(match e {
            EmgError::OutOfRange(_) | EmgError::Cutoff { .. } | EmgError::NoLevels => {
                InvalidValueError::new_err(args)
            }
            EmgError::Channels { .. } | EmgError::Ragged { .. } => ShapeError::new_err(args),
            EmgError::BadCalibrationSample { .. }
            | EmgError::CalibrationTooShort { .. }
            | EmgError::UnusableMaximum { .. } => CalibrationError::new_err(args),
        })
    }
}

impl From<GelError> for BindError {
    fn from(e: GelError) -> Self {
        let args = (e.to_string(), e.hint());
        Self(match e {
            GelError::OutOfRange(_)
            | GelError::Rotation { .. }
            | GelError::TooMany { .. }
            | GelError::Time { .. } => InvalidValueError::new_err(args),
            GelError::Picture { .. } => ShapeError::new_err(args),
        })
    }
}

impl From<HapticsError> for BindError {
    fn from(e: HapticsError) -> Self {
        let args = (e.to_string(), e.hint());
        Self(match e {
            HapticsError::OutOfRange(_) => InvalidValueError::new_err(args),
            HapticsError::MotorCount { .. } => ShapeError::new_err(args),
        })
    }
}

impl From<HandError> for BindError {
    fn from(e: HandError) -> Self {
        let args = (e.to_string(), e.hint());
        Self(match e {
            HandError::OutOfRange(_) => InvalidValueError::new_err(args),
            HandError::Count { .. } => ShapeError::new_err(args),
        })
    }
}

impl From<CoreWireError> for BindError {
    fn from(e: CoreWireError) -> Self {
        let args = (e.to_string(), e.hint());
        Self(match e {
            CoreWireError::Setting(_) => InvalidValueError::new_err(args),
            CoreWireError::Length { .. } => ShapeError::new_err(args),
            CoreWireError::OutOfRange(_)
            | CoreWireError::PacketLength { .. }
            | CoreWireError::Empty { .. }
            | CoreWireError::Field { .. }
            | CoreWireError::Checksum { .. } => WireError::new_err(args),
        })
    }
}
