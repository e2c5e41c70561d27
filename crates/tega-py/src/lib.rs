//! `tega._native`: the thin layer between Python and the core crates.
//!
//! Each function checks, borrows, detaches where that pays, calls one core function and converts the answer. There
//! is no arithmetic here, and the module is flat. Its types are written down in `python/tega/_native.pyi`.

mod arguments;
mod emg;
mod errors;
mod gel;
mod hand;
mod hand_link;
mod haptics;
#[cfg(unix)]
mod serial;
mod shared;
mod sim;
mod tactile;
mod touch;
mod wire;

use pyo3::prelude::*;

#[pyfunction]
fn instruction_set() -> &'static str {
    tega_simd::instruction_set()
}

#[pymodule(gil_used = false)]
mod _native {
    use numpy::ndarray::arr2;
    use numpy::{IntoPyArray, PyArray1};
    use pyo3::prelude::*;
    use pyo3::types::PyTuple;
    use tega_hand::Gains;
    use tega_wire::allegro;

    #[pymodule_export]
    use crate::instruction_set;

    #[pymodule_export]
    use crate::emg::{
        BlockMean, ButterworthLowpass, ChannelVotes, GraspIntent, channel_maxima, fuse_levels, grasp_level,
    };
    #[pymodule_export]
    use crate::gel::{Gel, gel_fall, gel_pad_pose};
    #[pymodule_export]
    use crate::hand::{HandController, JointModel, bare_clock, step_modelled};
    #[pymodule_export]
    use crate::hand_link::HandLink;
    #[pymodule_export]
    use crate::haptics::{
        contact_type, layout_motors, linear_intensity, logistic_intensity, vest_intensities, vest_percents,
        vest_x40,
    };
    #[cfg(unix)]
    #[pymodule_export]
    use crate::serial::SerialDrain;
    #[pymodule_export]
    use crate::sim::{limit_torques, mix_muscles};
    #[pymodule_export]
    use crate::tactile::{
        Equations, KnownBaseline, Preset, band_distances, estimate_baseline, picture_bands, vote_lines,
    };
    #[pymodule_export]
    use crate::touch::{Contact, TouchTracker, nominal_light, sensor_noise, update_fingers};
    #[pymodule_export]
    use crate::wire::allegro::{
        allegro_angle_counts, allegro_angles_rad, allegro_decode, allegro_encode, allegro_requested,
        allegro_torque_frames,
    };
    #[pymodule_export]
    use crate::wire::streams::{AsciiStream, ChordsStream, CytonStream, SpikerStream, chords_channels};
    #[pymodule_export]
    use crate::wire::vest::{
        hid_motor, hid_motor_report, hid_status, hid_status_report, hid_stop_report, motor_steps, x16_steps,
        x40_ble_frame, x40_ble_steps,
    };

    #[pymodule_export]
    const FINGERS: [&str; 4] = tega_haptics::FINGERS;
    #[pymodule_export]
    const HIGH_SHARE: f64 = tega_haptics::HIGH_SHARE;
    #[pymodule_export]
    const GEL_PX_PER_MM: f64 = tega_gel::PX_PER_MM;
    #[pymodule_export]
    const GEL_LENGTH_MM: f64 = tega_gel::LENGTH_MM;
    #[pymodule_export]
    const GEL_STIFFNESS_N_MM3: f64 = tega_gel::STIFFNESS_N_MM3;
    #[pymodule_export]
    const GEL_RADIUS_ACROSS_MM: f64 = tega_gel::RADIUS_ACROSS_MM;
    #[pymodule_export]
    const GEL_MIDDLE_ALONG_MM: f64 = tega_gel::MIDDLE_ALONG_MM;
    #[pymodule_export]
    const GEL_CAMERA_MM: f64 = tega_gel::CAMERA_MM;
    #[pymodule_export]
    const FULL_DUTY_SPEED_RAD_S: f64 = tega_hand::FULL_DUTY_SPEED_RAD_S;
    #[pymodule_export]
    const TIME_CONSTANT_S: f64 = tega_hand::TIME_CONSTANT_S;
    #[pymodule_export]
    const MOST_ADDED_LEVELS: f64 = tega_hand::MOST_ADDED_LEVELS;
    #[pymodule_export]
    const WARM_C: f64 = tega_hand::WARM_C;
    #[pymodule_export]
    const TOO_HOT_C: u8 = tega_hand::TOO_HOT_C;
    #[pymodule_export]
    const TICK_S: f64 = tega_hand::TICK_S;
    #[pymodule_export]
    const JOINT_NAMES: [&str; tega_hand::JOINTS] = tega_hand::JOINT_NAMES;
    #[pymodule_export]
    const JOINT_LIMITS_RAD: [(f64, f64); tega_hand::JOINTS] = tega_hand::JOINT_LIMITS_RAD;
    #[pymodule_export]
    const ALLEGRO_RAD_PER_COUNT: f64 = allegro::RAD_PER_COUNT;

    /// Adds what is made at import: arrays, tuples and the version.
    #[pymodule_init]
    fn init(m: &Bound<'_, PyModule>) -> PyResult<()> {
        let (py, gains) = (m.py(), Gains::default());
        m.add("__version__", env!("CARGO_PKG_VERSION"))?;
        m.add("ALLEGRO_PWM_LIMITS", PyTuple::new(py, allegro::PWM_LIMITS)?)?;
        m.add("GEL_HEIGHTS_ALONG_MM", tega_gel::HEIGHTS_ALONG_MM.map(<(f64, f64)>::from))?;
        m.add("TORQUE_LIMITS", PyArray1::from_slice(py, &tega_hand::TORQUE_LIMITS))?;
        m.add("CLOSURE_POSES_RAD", arr2(&tega_hand::CLOSURE_POSES_RAD).into_pyarray(py))?;
        m.add("DEFAULT_KP", PyArray1::from_slice(py, &gains.kp))?;
        m.add("DEFAULT_KD", PyArray1::from_slice(py, &gains.kd))?;
        m.add("DEFAULT_ERROR_LIMIT_RAD", gains.error_limit_rad)?;
        m.add("DEFAULT_LEVEL_FACTORS", PyArray1::from_slice(py, &gains.level_factors))?;
        m.add("DEFAULT_SLEW_PER_TICK", gains.slew_per_tick)?;
        // The stub lists the names; a second list would have to be kept equal by hand.
        m.delattr("__all__")
    }
}
