#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| tega_fuzz::tactile::paper_reading_survives_any_image(data));
