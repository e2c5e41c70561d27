#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| tega_fuzz::tactile::tracker_is_bounded_and_the_same_again(data));
