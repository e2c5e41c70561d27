#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| tega_fuzz::wire::hid_decode_then_encode_is_identity(data));
