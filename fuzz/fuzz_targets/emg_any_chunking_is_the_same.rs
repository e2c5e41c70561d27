#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| tega_fuzz::emg::emg_any_chunking_is_the_same(data));
