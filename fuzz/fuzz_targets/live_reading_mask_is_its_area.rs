#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| tega_fuzz::tactile::live_reading_mask_is_its_area(data));
