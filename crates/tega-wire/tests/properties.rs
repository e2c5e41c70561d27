//! What every decoder owes to any bytes at all. The bodies are those of the fuzz targets: here they meet the committed
//! seeds, and bytes drawn so that headers, footers and separators are common.

#[path = "../../../fuzz/src/wire.rs"]
#[allow(clippy::all, clippy::pedantic, clippy::unwrap_used)]
mod fuzz;
#[path = "../../../fuzz/replay.rs"]
#[allow(clippy::unwrap_used, clippy::expect_used)]
mod replay;

use proptest::collection::vec;
use proptest::prelude::*;

#[test]
fn committed_seeds_hold() {
    replay::committed_seeds(fuzz::TARGETS);
}

/// Bytes of which `often` are far more common than the rest.
fn bytes_with(often: &'static [u8], len: usize) -> impl Strategy<Value = Vec<u8>> {
    vec(prop_oneof![2 => proptest::sample::select(often), 1 => any::<u8>()], 0..len)
}

/// Frames of `len` bytes with header, end and a counter that mostly runs, some of them cut short.
fn framed(header: &'static [u8], end: u8, len: usize) -> impl Strategy<Value = Vec<u8>> {
    let frame = (bytes_with(&[0xA0, 0xC0, 0xC7, 0x7C, 0x01], len), 0_usize..40, any::<u8>());
    vec(frame, 0..20).prop_map(move |frames| {
        let mut stream = vec![];
        for (number, (body, cut, jump)) in frames.into_iter().enumerate() {
            let counter = if jump < 16 { jump } else { number as u8 };
            let mut frame = [header, &[counter], &body].concat();
            frame.resize(len - 1, 0);
            frame.push(end);
            frame.truncate(if cut < 4 { cut * len / 4 } else { len });
            stream.extend(frame);
        }
        stream
    })
}

proptest! {
    #[test]
    fn allegro(id in 0_u16..0x900, flags in prop_oneof![Just(0_u8), any::<u8>()], data in vec(any::<u8>(), 0..10)) {
        let [low, high] = id.to_le_bytes();
        fuzz::allegro_decode_then_encode_is_identity(&[&[low, high, flags], &data[..]].concat());
    }

    #[test]
    fn vest(data in vec(any::<u8>(), 0..42)) {
        fuzz::x40_levels_survive_the_frame(&data);
    }

    #[test]
    fn hid(head in proptest::sample::select(&[[1, 0x10], [1, 0x12], [1, 0x11], [2, 0x10], [3, 0x20]][..]),
           layout in 0_u8..3, count in proptest::sample::select(&[0_u8, 32, 40, 41][..]),
           levels in vec(0_u8..110, 0..41)) {
        fuzz::hid_decode_then_encode_is_identity(&[&head[..], &[1, 0, 9, 0, layout, count], &levels].concat());
    }

    #[test]
    fn cyton_any_bytes(data in bytes_with(&[0xA0, 0xC0, 0xC4], 600)) {
        fuzz::cyton_any_chunking_is_the_same(&data);
    }

    #[test]
    fn cyton_frames(size in any::<u8>(), stream in framed(&[0xA0], 0xC0, 33)) {
        fuzz::cyton_any_chunking_is_the_same(&[&[size], &stream[..]].concat());
    }

    #[test]
    fn cyton_run(head in any::<[u8; 2]>(), rest in bytes_with(&[0xA0, 0xC0, 0x11], 400)) {
        fuzz::cyton_finds_a_clean_run_behind_garbage(&[&head[..], &rest].concat());
    }

    #[test]
    fn chords_any_bytes(data in bytes_with(&[0xC7, 0x7C, 0x01], 300)) {
        fuzz::chords_any_chunking_is_the_same(&data);
    }

    #[test]
    fn chords_frames(size in any::<u8>(), stream in framed(&[0xC7, 0x7C], 1, 10)) {
        fuzz::chords_any_chunking_is_the_same(&[&[size, 2], &stream[..]].concat());
    }

    #[test]
    fn spiker(data in bytes_with(&[0x80, 0x87, 0x00, 0x7F, 0x03], 300)) {
        fuzz::spiker_any_chunking_is_the_same(&data);
    }

    #[test]
    fn ascii(data in bytes_with(b"\n\n\r,; \t:0123456789.-+eEa", 600)) {
        fuzz::ascii_any_chunking_is_the_same(&data);
    }
}
