//! All tests that ask the crate from outside. Captured frames, and those of other programs, are in
//! `tests/tega/unit/test_wire_*.py`, which read them through Python.

#[path = "../../../fuzz/src/bytes.rs"]
#[allow(dead_code, clippy::all, clippy::pedantic, clippy::unwrap_used)]
mod bytes;

mod allegro_vectors;
mod properties;
mod stream_vectors;
mod vest_vectors;

/// Bytes of their hexadecimal text.
#[allow(clippy::unwrap_used)]
fn hex(text: &str) -> Vec<u8> {
    text.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
}
