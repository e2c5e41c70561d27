#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| tega_fuzz::tactile::contact_fast_equals_exact(data));
