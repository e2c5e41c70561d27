//! All tests that ask the crate from outside.

#[path = "../../../fuzz/src/bytes.rs"]
#[allow(dead_code, clippy::all, clippy::pedantic, clippy::unwrap_used)]
mod bytes;

mod allegro_vectors;
mod properties;
mod stream_vectors;
mod vest_vectors;
