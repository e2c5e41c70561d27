#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| tega_fuzz::image::png_decode_never_panics_and_is_whole(data));
