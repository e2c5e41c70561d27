//! Vest frames and HID reports, byte for byte.
#![allow(clippy::unwrap_used, clippy::panic)] // a test's helpers may fail like the test

use tega_wire::bhaptics::{Intensities, ble_frame, motor_step, x16_steps};
use tega_wire::hid::{Motor, Status, decode_motor, decode_status, motor_report, status_report};

use crate::hex;

const CCI: [u8; 4] = [80, 60, 40, 20];
const EDA: [u8; 4] = [10, 0, 100, 55];

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
    let intensities = [0, 1, 3, 4, 5, 10, 20, 25, 30, 40, 50, 60, 70, 75, 80, 90, 96, 97, 100, 255];
    let levels = [0, 0, 0, 1, 1, 2, 3, 4, 5, 6, 8, 9, 11, 11, 12, 14, 14, 15, 15, 15];
    assert_eq!(intensities.map(motor_step), levels);
}

#[test]
fn bluetooth_frames() {
    assert_eq!(ble(&of(|_| 0)), [0; 20]);
    assert_eq!(ble(&of(|_| 100)), [0xFF; 20]);
    let one = |lit: usize, value: u8| ble(&of(|motor| if motor == lit { value } else { 0 }));
    assert_eq!(one(3, 100), hex("f0 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00"));
    assert_eq!(one(39, 50), hex("00 00 00 00 00 00 00 00 00 00 00 00 00 00 08 00 00 00 00 00"));
    assert_eq!(ble(&columns(4)), hex("36 36 36 36 00 20 20 20 20 00 f8 f8 f8 f8 00 9c 9c 9c 9c 00"));
    let mirrored = ble_frame(&columns(4), true);
    assert_eq!(mirrored[..], hex("c9 c9 c9 c9 00 20 20 20 20 00 f8 f8 f8 f8 00 63 63 63 63 00"));
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
