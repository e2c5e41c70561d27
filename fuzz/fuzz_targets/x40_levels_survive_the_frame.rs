#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| tega_fuzz::wire::x40_levels_survive_the_frame(data));
