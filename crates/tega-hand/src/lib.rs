//! Closure levels to joint targets to torques for an Allegro Hand v4.
//!
//! The hand reports its joint angles every 3 ms and takes nothing but torques. [`Trajectory`] turns a closure level
//! of 1 to 5 into joint targets, [`Gains`] the difference to the measured angles into torques within their limits,
//! and [`HandController`] is both in one call per cycle. [`JointModel`] stands in for a hand that is not attached.
//! [`HandLink`] is the whole conversation with a hand on a bus: received frames in, frames to send out.
//!
//! Angles are in rad, torques in units of full motor duty (1.0 = 1200 counts on the wire), joints in the order of
//! the hand's messages: index, middle, ring, thumb, four each.
//!
//! ```
//! use tega_hand::{CLOSURE_POSES_RAD, HandController, JointModel};
//!
//! let (mut controller, mut model) = (HandController::default(), JointModel::default());
//! for _ in 0..700 {
//!     let torques = controller.step(model.angles_rad(), 3.0, None)?;
//!     model.step(&torques)?;
//! }
//! assert!((model.angles_rad()[1] - CLOSURE_POSES_RAD[2][1]).abs() < 0.005);
//! # Ok::<(), tega_hand::HandError>(())
//! ```
#![forbid(unsafe_code)]

mod addition;
mod bare_clock;
mod controller;
mod error;
mod fault;
mod heat;
mod joints;
mod link;
mod model;
mod pd;
mod poses;
mod sets;
mod trajectory;

pub use addition::{ADDED_ACCELERATION_RAD_S2, MOST_ADDED_LEVELS};
pub use bare_clock::bare_clock;
pub use controller::{Asked, HandController};
pub use error::HandError;
pub use fault::Fault;
pub use heat::{TOO_HOT_C, WARM_C};
pub use joints::{
    ENCODER_RANGE_RAD, JOINT_LIMITS_RAD, JOINT_NAMES, JOINTS, Joints, STOP_MARGIN_RAD, TICK_S, TORQUE_LIMITS,
};
pub use link::{Counts, HandLink, LinkSettings, Phase};
pub use model::{FULL_DUTY_SPEED_RAD_S, JointModel, TIME_CONSTANT_S};
pub use pd::{Gains, LARGEST_GAIN};
pub use poses::{CLOSURE_POSES_RAD, LEVELS, POSE_MARGIN_RAD, PoseSet};
pub use trajectory::{MAX_SPEED_RAD_S, MOVE_S, Trajectory};
