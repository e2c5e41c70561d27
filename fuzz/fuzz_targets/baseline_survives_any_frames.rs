#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| tega_fuzz::tactile::baseline_survives_any_frames(data));
