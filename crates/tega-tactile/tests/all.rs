//! All tests that ask the crate from outside.

#[path = "../../../fuzz/src/bytes.rs"]
#[allow(dead_code, clippy::all, clippy::pedantic, clippy::unwrap_used)]
mod bytes;

mod after_touch;
mod alloc;
mod baseline;
mod fuzz_seeds;
mod gate;
mod live;
mod odd_frames;
mod slopes;
mod steady;
mod tracker;
