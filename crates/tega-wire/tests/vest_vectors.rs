//! Vest frames and HID reports, byte for byte.
#![allow(clippy::unwrap_used, clippy::panic)] // a test's helpers may fail like the test

use tega_wire::bhaptics::{BleFrame, Intensities, ble_frame, ble_steps, motor_step, x16_steps};
use tega_wire::hid::{Motor, Status, decode_motor, decode_status, motor_report, status_report};

const CCI: [u8; 4] = [80, 60, 40, 20];
const EDA: [u8; 4] = [10, 0, 100, 55];

fn hex(text: &str) -> Vec<u8> {
    text.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
}

fn of(values: impl Fn(usize) -> u8) -> Intensities {
    Intensities::new(&(0..40).map(values).collect::<Vec<u8>>()).unwrap()
}

/// Four finger columns, the same in the given number of rows.
fn columns(rows: usize) -> Intensities {
    of(|motor| match (motor / 20, motor % 20 / 4) {
        (_, row) if row >= rows => 0,
        (0, _) => CCI[motor % 4],
        _ => EDA[motor % 4],
    })
}

fn ble(intensities: &Intensities) -> Vec<u8> {
    ble_frame(intensities, false).to_vec()
}

#[test]
fn sixteen_levels() {
    let table = [
        (0, 0),
        (1, 0),
        (3, 0),
        (4, 1),
        (5, 1),
        (10, 2),
        (20, 3),
        (25, 4),
        (30, 5),
        (40, 6),
        (50, 8),
        (60, 9),
        (70, 11),
        (75, 11),
        (80, 12),
        (90, 14),
        (96, 14),
        (97, 15),
        (100, 15),
        (255, 15),
    ];
    for (intensity, wanted) in table {
        assert_eq!(motor_step(intensity), wanted, "{intensity}");
    }
}

#[test]
fn bluetooth_frames() {
    assert_eq!(ble(&of(|_| 0)), [0; 20]);
    assert_eq!(ble(&of(|_| 100)), [0xFF; 20]);
    let one = |lit: usize, value: u8| ble(&of(|motor| if motor == lit { value } else { 0 }));
    assert_eq!(one(0, 100), hex("00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 0f 00 00 00 00"));
    assert_eq!(one(3, 100), hex("f0 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00"));
    assert_eq!(one(20, 100), hex("00 00 00 00 00 f0 00 00 00 00 00 00 00 00 00 00 00 00 00 00"));
    assert_eq!(one(39, 50), hex("00 00 00 00 00 00 00 00 00 00 00 00 00 00 08 00 00 00 00 00"));
    let front = of(|motor| if motor < 20 { 5 * motor as u8 } else { 0 });
    assert_eq!(ble(&front), hex("22 55 88 bb ee 00 00 00 00 00 00 00 00 00 00 10 43 76 a9 dc"));
    let back = of(|motor| if motor < 20 { 0 } else { 5 * (motor - 20) as u8 });
    assert_eq!(ble(&back), hex("00 00 00 00 00 01 34 67 9a cd 22 55 88 bb ee 00 00 00 00 00"));
    assert_eq!(ble(&columns(4)), hex("36 36 36 36 00 20 20 20 20 00 f8 f8 f8 f8 00 9c 9c 9c 9c 00"));
    assert_eq!(ble(&columns(5)), hex("36 36 36 36 36 20 20 20 20 20 f8 f8 f8 f8 f8 9c 9c 9c 9c 9c"));
    let mirrored = ble_frame(&columns(4), true);
    assert_eq!(mirrored[..], hex("c9 c9 c9 c9 00 20 20 20 20 00 f8 f8 f8 f8 00 63 63 63 63 00"));
}

#[test]
fn a_frame_of_an_independent_implementation_is_read() {
    let frame: BleFrame =
        hex("01 23 45 67 89 ab cd ef 00 00 00 00 00 00 00 00 00 00 00 00").try_into().unwrap();
    let mut wanted = [0; 40];
    for (motor, level) in [(2, 1), (7, 2), (6, 3), (11, 4), (10, 5), (15, 6), (14, 7), (19, 8), (18, 9)] {
        wanted[motor] = level;
    }
    for (dot, level) in [(0, 10), (1, 11), (4, 12), (5, 13), (8, 14), (9, 15)] {
        wanted[20 + dot] = level;
    }
    assert_eq!(ble_steps(&frame, false), wanted);
}

#[test]
fn what_an_x16_makes_of_it() {
    let half = |levels: [u8; 4]| [levels, levels].concat();
    for rows in [4, 5] {
        let frame = ble_frame(&columns(rows), false);
        assert_eq!(x16_steps(&frame, false)[..], [half([12, 9, 6, 3]), half([2, 0, 15, 8])].concat());
    }
}

#[test]
fn hid_reports() {
    let frame = Motor::Levels { levels: columns(4).values().to_vec(), ttl_ms: 150, request_status: false };
    let wanted = hex(
        "01 10 01 00 96 00 00 28 50 3c 28 14 50 3c 28 14 50 3c 28 14 50 3c 28 14 00 00 00 00 0a 00 64 37 \
                      0a 00 64 37 0a 00 64 37 0a 00 64 37 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 79 a6 59 de",
    );
    assert_eq!(motor_report(1, &frame).unwrap()[..], wanted);
    assert_eq!(decode_motor(&wanted), Ok((1, frame)));
    let stop = motor_report(2, &Motor::Stop).unwrap();
    assert_eq!(stop[..], [hex("01 11 02 00 00 00 00 28"), vec![0; 52], hex("e6 ef be 8b")].concat());
    assert_eq!(decode_motor(&stop), Ok((2, Motor::Stop)));
    let status =
        Status { sequence: 9, link: 2, battery: None, faults: 3, uptime_ms: 70_000, dropped: 1, flags: 0 };
    assert_eq!(decode_status(&status_report(&status)), Ok(status));
}
