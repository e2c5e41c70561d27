#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| tega_fuzz::x40_levels_survive_the_frame(data));
