//! Touch as people feel it: the `live` reading of one picture, and the tracker that follows a fingertip.
//!
//! 1. Pictures are averaged over some 1,200 cells ([`cells`]).
//! 2. A change of the light is taken out, and one number says how much of the picture differs ([`colour`]).
//! 3. Depth comes from shading ([`depth`], [`light`]), and the dent from depth and colour together ([`dent`], [`shape`], [`middle`]); [`law`] has
//!    what both say of how deep it is. Maps of a contact that scatters are averaged over time ([`filter`]).
//! 4. [`still`] does this without memory; [`tracker`] knows its sensor's noise, follows drift and stays silent on leftovers.
//!
//! Arithmetic runs on integers, or on floats in one fixed order: the result is the same on every processor. Sums over a pixel's bytes take the
//! first and the last before the middle, so that blue or red first gives the same bits.

mod cells;
mod colour;
mod course;
mod dent;
mod depth;
mod fading;
mod filter;
mod law;
mod light;
mod lines;
mod mains;
mod middle;
mod noise;
mod peak;
mod quantised;
mod rank;
mod shape;
mod still;
mod thumbnail;
mod touch;
mod tracker;
mod trig;
mod wave;

pub(crate) use thumbnail::{Thumbnail, Thumbnails};

pub use dent::Outline;
pub use light::{GelLight, LIGHT_TERMS};
pub use noise::SensorNoise;
pub use still::{LiveReader, LiveScratch, read_live};
pub use touch::{Touch, TrackerOptions};
pub use tracker::TouchTracker;
