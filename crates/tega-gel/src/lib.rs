//! A simulated fingertip camera: rigid shapes pressed into a gel, to pictures of 320 x 240 blue, green, red bytes.
//!
//! Simulated, from published and measured properties of one sensor (DIGIT); `docs/evidence/sim-touch.md` says how close it
//! comes and what it does not model. Lengths are millimetres in the pad frame (x right and y down in the upright
//! picture, z out of the gel), forces newtons.
//!
//! The solver and the painter are written once, in plain Rust that the compiler vectorises, and compiled for
//! AVX2 and for the target's baseline ([`tega_simd::dispatched!`]). They compute on integers, or on floats in one fixed
//! order without fused operations, so that every path gives the same bits.
//!
//! ```
//! use tega_gel::{Gel, Indenter, PICTURE, Setup, Shape};
//!
//! let mut gel = Gel::new(Setup { seed: 1, ..Setup::default() })?;
//! let ball = Indenter {
//!     shape: Shape::Sphere { radius: 4.4 },
//!     pose_mm: [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 4.4]],
//!     force_n: 3.0,
//! };
//! assert!(gel.press(&[ball], 0.0)?);
//! let mut picture = vec![0; PICTURE];
//! gel.paint(0, &mut picture)?;
//! let depth_mm = gel.touch().depth_mm;
//! assert!(depth_mm > 0.7 && depth_mm < 1.2);
//! # Ok::<(), tega_gel::GelError>(())
//! ```
#![deny(unsafe_code)] // allowed in what `dispatched!` writes

mod error;
mod form;
mod gel;
mod grid;
mod lay;
mod light;
mod membrane;
mod memory;
mod noise;
mod pad;
mod paint;
mod picture;
mod plane;
mod rng;
mod shape;
mod skin;
mod springs;
mod sums;
mod unit;
mod window;

pub use error::GelError;
pub use form::{CAMERA_MM, Form, HEIGHTS_ALONG_MM, MIDDLE_ALONG_MM, RADIUS_ACROSS_MM, fall};
pub use gel::{CELLS, Gel, PICTURE, Setup, Touch};
pub use grid::{LENGTH_MM, PX_PER_MM};
pub use pad::{Pad, pad_pose};
pub use picture::{HEIGHT, WIDTH};
pub use shape::{Indenter, MAX_INDENTERS, Shape};
pub use springs::STIFFNESS_N_MM3;
pub use sums::{SUM_CELLS, Sums};
