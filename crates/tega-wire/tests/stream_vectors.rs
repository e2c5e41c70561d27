//! Streams of the muscle sensors, byte for byte.
#![allow(clippy::unwrap_used, clippy::panic)] // a test's helpers may fail like the test

use tega_wire::{chords, cyton, spiker};

use crate::hex;

const CYTON: [&str; 8] = [
    "A0 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 C0",
    "A0 01 00 00 01 FF FF FF 00 00 02 FF FF FE 00 01 00 FF FF 00 01 00 00 FF 00 00 00 00 00 00 00 00 C0",
    "A0 02 7F FF FF 80 00 00 80 00 01 40 00 00 C0 00 00 7F FF FE 00 00 00 00 00 01 00 10 FF F0 1F 40 C0",
    "A0 7F 00 11 7A FF DD 0C 00 57 61 FF 51 3D 00 01 BF FF FE 41 01 B4 E8 FE 4B 18 00 00 00 00 00 00 C0",
    "A0 A0 A0 A0 A0 C0 C0 C0 00 A0 C0 A0 A0 A0 00 C0 A0 C0 C0 C0 20 A0 C0 A0 C0 A0 A0 C0 A0 C0 A0 C0 C1",
    "A0 FF 00 00 64 00 00 C8 00 01 2C 00 01 90 00 01 F4 00 02 58 00 02 BC 00 03 20 00 00 00 01 E2 40 C4",
    "A0 00 80 00 00 80 00 00 80 00 00 80 00 00 7F FF FF 7F FF FF 7F FF FF 7F FF FF 00 00 00 00 00 00 C0",
    "A0 03 00 30 39 FF CF C7 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 02 00 03 FF 00 00 C1",
];

const COUNTS: [[i32; 8]; 8] = [
    [0; 8],
    [1, -1, 2, -2, 256, -256, 65_536, -65_536],
    [8_388_607, -8_388_608, -8_388_607, 4_194_304, -4_194_304, 8_388_606, 0, 1],
    [4474, -8948, 22_369, -44_739, 447, -447, 111_848, -111_848],
    [-6_250_336, -4_144_960, 41_152, -6_250_336, 49_312, -4_144_960, 2_138_304, -6_242_144],
    [100, 200, 300, 400, 500, 600, 700, 800],
    [-8_388_608, -8_388_608, -8_388_608, -8_388_608, 8_388_607, 8_388_607, 8_388_607, 8_388_607],
    [12_345, -12_345, 0, 0, 0, 0, 0, 0],
];

/// Garbage, the eight packets, a torn one, three of one counter, one with a bad footer, a good one: 452 bytes.
fn cyton_stream() -> Vec<u8> {
    let v: Vec<Vec<u8>> = CYTON.iter().map(|text| hex(text)).collect();
    let mut bad = v[1].clone();
    bad[32] = 0x55;
    let tail = [&v[1][..20], &v[3], &v[3], &v[3], &bad, &v[1]].concat();
    [hex("13 37 C0"), v.concat(), tail].concat()
}

#[test]
fn cyton_packets() {
    use cyton::Aux::{Acceleration, Raw, Stamped};
    let mut decoder = cyton::Decoder::new(24).unwrap();
    let packets = decoder.feed(&CYTON.map(hex).concat());
    assert_eq!(packets.iter().map(|p| p.counts).collect::<Vec<_>>(), COUNTS);
    let counters: Vec<_> = packets.iter().map(|p| (p.counter, p.missing)).collect();
    assert_eq!(counters, [(0, 0), (1, 0), (2, 0), (127, 124), (160, 32), (255, 94), (0, 0), (3, 2)]);
    assert_eq!(packets[0].aux(), Acceleration(None));
    assert_eq!(packets[2].aux(), Acceleration(Some([16, -16, 8000])));
    assert_eq!(
        [16, -16, 8000].map(cyton::acceleration_g).map(f64::to_bits),
        [0.002, -0.002, 1.0].map(f64::to_bits)
    );
    assert_eq!(packets[5].aux(), Stamped { word: 0, time_ms: 123_456 });
    assert_eq!(packets[7].aux(), Raw([512, 1023, 0]));
    assert_eq!(cyton::microvolts(8_388_607, 24).to_bits(), 187_500_f64.to_bits());
    assert_eq!(cyton::microvolts(1, 24).to_bits(), 0.022_351_744_455_307_063_f64.to_bits());
    assert!(cyton::Decoder::new(5).is_err());
}

#[test]
fn cyton_stream_holds_twelve_packets_however_it_is_cut() {
    let stream = cyton_stream();
    assert_eq!(stream.len(), 452);
    for size in [1, 2, 7, 16, 32, 33, 34, 64, 100, 452] {
        let mut decoder = cyton::Decoder::new(24).unwrap();
        let packets: Vec<_> = stream.chunks(size).flat_map(|chunk| decoder.feed(chunk)).collect();
        let counters: Vec<u8> = packets.iter().map(|p| p.counter).collect();
        assert_eq!(counters, [0, 1, 2, 127, 160, 255, 0, 3, 127, 127, 127, 1], "chunks of {size}");
        assert_eq!((decoder.stats().skipped_bytes, decoder.stats().pending_bytes), (56, 0));
    }
}

#[test]
fn chords_packets() {
    let frames =
        ["C7 7C 00 00 00 00 00 00 00 01", "C7 7C 01 02 00 08 00 0F FF 01", "C7 7C FF C7 7C 00 01 01 00 01"];
    // A sync inside the payload makes the third wait for what follows.
    let stream = [frames.map(hex).concat(), hex("C7 7C 00 00 00 00 00 00 00 01")].concat();
    let mut decoder = chords::Decoder::new(3).unwrap();
    let packets = decoder.feed(&stream);
    let found: Vec<_> = packets.iter().map(|p| (p.counter, p.samples.clone())).collect();
    let wanted = [(0, vec![0; 3]), (1, vec![512, 2048, 4095]), (255, vec![51_068, 1, 256]), (0, vec![0; 3])];
    assert_eq!(found, wanted);
    assert_eq!(decoder.stats().missing_packets, 253);
    assert!(chords::Decoder::new(0).is_err());
    assert!(chords::Decoder::new(17).is_err());
}

#[test]
fn spiker_frames() {
    let frames = ["80 00 00 00 00 00", "87 7F 00 00 04 00", "83 7F 00 7F 01 00", "80"];
    let mut decoder = spiker::Decoder::new(3).unwrap();
    let found: Vec<_> = frames.iter().flat_map(|frame| decoder.feed(&hex(frame))).collect();
    assert_eq!(found, [[0, 0, 0], [1023, 0, 512], [511, 127, 128]]);
    assert!(spiker::Decoder::new(7).is_err());
}
