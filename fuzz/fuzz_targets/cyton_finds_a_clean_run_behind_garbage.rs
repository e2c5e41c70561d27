#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| tega_fuzz::wire::cyton_finds_a_clean_run_behind_garbage(data));
