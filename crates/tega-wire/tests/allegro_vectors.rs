//! Allegro Hand frames, byte for byte.
#![allow(clippy::unwrap_used, clippy::panic)] // a test's helpers may fail like the test

use tega_wire::allegro::{
    Command, DeviceId, Finger, Info, Message, Received, Rejection, Report, Request, Scale, angle_rad, decode,
    requested, temperature_c, torque_frames,
};

use crate::hex;

const OURS: DeviceId = DeviceId::FACTORY;

const TAU: [f64; 16] =
    [0.10, -0.20, 0.05, -0.05, 0.0, 0.25, -0.10, 0.02, 0.01, 0.15, 0.125, -0.2, 0.3, -0.3, 0.2, -0.2];

fn data(id: u32, data: &[u8]) -> Received<'_> {
    Received { id, data, remote: false, extended: false, error: false }
}

#[test]
fn torque_within_limits_and_clamped_at_each_joint_s_limit() {
    let (high, low) = ("77 01 A3 02 C2 01 1D 01", "89 FE 5D FD 3E FE E3 FE");
    let tau = [
        "78 00 10 FF 3C 00 C4 FF",
        "00 00 2C 01 88 FF 18 00",
        "0C 00 B4 00 96 00 10 FF",
        "68 01 98 FE F0 00 10 FF",
    ];
    for (torques, wanted) in [
        (TAU, tau),
        ([0.65; 16], [high, high, high, "0D 02 95 01 0E 01 0E 01"]),
        ([-0.65; 16], [low, low, low, "F3 FD 6B FE F2 FE F2 FE"]),
    ] {
        let frames = torque_frames(&torques, OURS, Scale::V4).unwrap();
        for ((frame, bytes), id) in frames.iter().zip(wanted).zip([0x180, 0x184, 0x188, 0x18C]) {
            assert_eq!((frame.id(), frame.data(), frame.is_remote()), (id, &hex(bytes)[..], false));
        }
    }
    // The reference truncates 71.5 to 71; ours rounds it to 72.
    let version_five = torque_frames(&TAU, OURS, Scale::V5).unwrap();
    assert_eq!(version_five[0].data(), hex("8F 00 10 FF 48 00 B8 FF"));
}

#[test]
fn captured_torque_and_position_frames_are_read_and_written_again() {
    for (id, bytes, finger, counts) in [
        (0x180, "02 00 CB 00 42 00 25 00", Finger::Index, [2, 203, 66, 37]),
        // Thumb joint 0 is beyond the limit for torques; counts are not clamped.
        (0x18C, "58 02 05 00 8D FF FA FF", Finger::Thumb, [600, 5, -115, -6]),
        (0x084, "F9 FF CF FE 9A FF BE FF", Finger::Middle, [-7, -305, -102, -66]),
        (0x088, "FF 7F 00 80 FF FF 01 00", Finger::Ring, [32767, -32768, -1, 1]),
    ] {
        let (command, report) = (Command::SetTorque { finger, counts }, Report::Position { finger, counts });
        let (message, frame) = match id {
            0x180.. => (Message::Command(command), command.frame(OURS)),
            _ => (Message::Report(report.clone()), report.frame(OURS).unwrap()),
        };
        assert_eq!(decode(&data(id, &hex(bytes)), OURS), Ok(message));
        assert_eq!(finger.name(), format!("{finger:?}").to_lowercase());
        assert_eq!((u32::from(frame.id()), frame.data()), (id, &hex(bytes)[..]));
    }
    for (counts, scale, wanted) in [
        (2612, Scale::V4, 0.231_849),
        (32767, Scale::V4, 2.908_502),
        (-32768, Scale::V4, -2.908_591),
        (-566, Scale::V5, -0.869_314),
    ] {
        assert!((angle_rad(counts, scale) - wanted).abs() < 1e-6, "{counts}: {wanted}");
    }
}

#[test]
fn information_serial_and_temperature() {
    let info = Info { hardware: 0x0402, firmware: 0x0406, side: 0, palm_c: 60, status: 5 };
    let bytes = hex("02 04 06 04 00 3C 05");
    assert_eq!(decode(&data(0x200, &bytes), OURS), Ok(Message::Report(Report::Info(info))));
    assert_eq!(Report::Info(info).frame(OURS).unwrap().data(), bytes);
    assert_eq!((info.major(), info.servo_on(), info.must_stop(), info.must_warn()), (4, true, false, true));
    let serial = Report::Serial(*b"A080R\0\0\0");
    assert_eq!(decode(&data(0x220, b"A080R\0\0\0"), OURS), Ok(Message::Report(serial)));
    let temperature = Report::Temperature { finger: Finger::Thumb, bytes: [0x30, 0x26, 0x24, 0xF6] };
    assert_eq!(decode(&data(0x0EC, &hex("30 26 24 F6")), OURS), Ok(Message::Report(temperature)));
    assert_eq!([0x30, 0x26, 0xF6].map(temperature_c), [Some(48), Some(38), None]);
}

#[test]
fn commands_and_requests() {
    let third = DeviceId::new(3).unwrap();
    assert_eq!((Command::ServoOn.frame(third).id(), Command::ServoOff.frame(third).id()), (0x103, 0x107));
    assert!(DeviceId::new(4).is_err());
    for (temperature_ms, status_ms, bytes) in
        [(500, None, "03 00 00 00 F4 01"), (500, Some(100), "03 00 00 00 F4 01 64 00")]
    {
        let command = Command::SetPeriod { position_ms: 3, imu_ms: 0, temperature_ms, status_ms };
        assert_eq!(command.frame(OURS).data(), hex(bytes));
        assert_eq!(decode(&data(0x204, &hex(bytes)), OURS), Ok(Message::Command(command)));
    }
    for (request, id) in [
        (Request::Info, 0x200),
        (Request::Serial, 0x220),
        (Request::Imu, 0x0C0),
        (Request::Position(Finger::Ring), 0x088),
        (Request::Temperature(Finger::Thumb), 0x0EC),
    ] {
        let frame = request.frame(OURS);
        assert_eq!((frame.id(), frame.data(), frame.is_remote()), (id, &[][..], true));
        assert_eq!(requested(u32::from(id), OURS), Some(request));
    }
    assert_eq!((requested(0x100, OURS), requested(0x201, OURS)), (None, None));
}

#[test]
fn what_is_not_for_us_is_classified() {
    let position = data(0x080, &[0; 8]);
    assert!(decode(&position, OURS).is_ok());
    for (frame, wanted) in [
        (Received { remote: true, data: &[], ..position }, Rejection::Remote),
        (Received { error: true, ..position }, Rejection::ErrorFrame),
        (Received { extended: true, ..position }, Rejection::Extended),
        (Received { id: 0x880, ..position }, Rejection::Extended),
        (Received { id: 0x081, ..position }, Rejection::ForeignDevice),
        (data(0x001, &[0; 4]), Rejection::ForeignDevice),
        (data(0x000, &[0; 4]), Rejection::Unknown),
        (data(0x3C0, &[0; 8]), Rejection::Unknown),
        (data(0x3C8, &[0; 8]), Rejection::Unknown),
        (data(0x080, &[0; 7]), Rejection::Malformed),
        (data(0x180, &[0; 6]), Rejection::Malformed),
        (data(0x0E0, &[0; 8]), Rejection::Malformed),
        (data(0x200, &[0; 8]), Rejection::Malformed),
        (data(0x204, &[0; 7]), Rejection::Malformed),
        (data(0x0C0, &[0; 5]), Rejection::Malformed),
        (data(0x100, &[0]), Rejection::Malformed),
        (data(0x040, &[0; 9]), Rejection::Malformed),
    ] {
        assert_eq!(decode(&frame, OURS), Err(wanted), "{frame:?}");
    }
    assert_eq!(decode(&data(0x040, &[7]), OURS), Ok(Message::Report(Report::Status(vec![7]))));
    assert_eq!(
        decode(&data(0x0C0, &[1, 0, 2, 0, 3, 0]), OURS),
        Ok(Message::Report(Report::Imu(vec![1, 2, 3])))
    );
    let config = Message::Config([1, 2, 0, 0, 0, 0]);
    assert_eq!(decode(&data(0x1A0, &[1, 2, 0, 0, 0, 0]), OURS), Ok(config.clone()));
    assert_eq!(decode(&data(0x160, &[1, 2, 0, 0, 0, 0]), OURS), Ok(config));
    let pose = Message::Pose { finger: Finger::Thumb, counts: [1, 0, 0, 0] };
    assert_eq!(decode(&data(0x38C, &[1, 0, 0, 0, 0, 0, 0, 0]), OURS), Ok(pose));
}
