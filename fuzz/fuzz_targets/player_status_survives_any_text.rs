#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| tega_fuzz::wire::player_status_survives_any_text(data));
