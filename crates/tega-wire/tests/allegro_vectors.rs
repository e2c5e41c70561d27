//! Allegro Hand frames, byte for byte: computed ones, and frames captured from a hand.
#![allow(clippy::unwrap_used, clippy::panic)] // a test's helpers may fail like the test

use tega_wire::allegro::{
    Command, DeviceId, Finger, Info, Message, Received, Rejection, Report, Request, Scale, angle_counts,
    angle_rad, decode, requested, temperature_c, torque_counts, torque_frames,
};

const OURS: DeviceId = DeviceId::FACTORY;

const TAU: [f64; 16] =
    [0.10, -0.20, 0.05, -0.05, 0.0, 0.25, -0.10, 0.02, 0.01, 0.15, 0.125, -0.2, 0.3, -0.3, 0.2, -0.2];

/// The vendor's home pose, a finger a row.
const HOME_DEG: [[f64; 4]; 4] =
    [[0.0, -10.0, 45.0, 45.0], [0.0, -10.0, 45.0, 45.0], [5.0, -5.0, 50.0, 45.0], [60.0, 25.0, 15.0, 45.0]];

fn hex(text: &str) -> Vec<u8> {
    text.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
}

fn data(id: u32, data: &[u8]) -> Received<'_> {
    Received { id, data, remote: false, extended: false, error: false }
}

fn assert_frames(torques: &[f64; 16], scale: Scale, wanted: [&str; 4]) {
    let frames = torque_frames(torques, OURS, scale).unwrap();
    for ((frame, bytes), id) in frames.iter().zip(wanted).zip([0x180, 0x184, 0x188, 0x18C]) {
        assert_eq!((frame.id(), frame.data()), (id, &hex(bytes)[..]));
        assert!(!frame.is_remote());
    }
}

fn counts_of(id: u32, bytes: &str) -> (Finger, [i16; 4]) {
    match decode(&data(id, &hex(bytes)), OURS) {
        Ok(
            Message::Report(Report::Position { finger, counts })
            | Message::Command(Command::SetTorque { finger, counts }),
        ) => (finger, counts),
        other => panic!("{other:?}"),
    }
}

#[test]
fn torque_within_limits() {
    let wanted = [
        "78 00 10 FF 3C 00 C4 FF",
        "00 00 2C 01 88 FF 18 00",
        "0C 00 B4 00 96 00 10 FF",
        "68 01 98 FE F0 00 10 FF",
    ];
    assert_frames(&TAU, Scale::V4, wanted);
}

#[test]
fn torque_clamped_at_each_joints_limit() {
    let finger = "77 01 A3 02 C2 01 1D 01";
    assert_frames(&[0.65; 16], Scale::V4, [finger, finger, finger, "0D 02 95 01 0E 01 0E 01"]);
    let finger = "89 FE 5D FD 3E FE E3 FE";
    assert_frames(&[-0.65; 16], Scale::V4, [finger, finger, finger, "F3 FD 6B FE F2 FE F2 FE"]);
}

#[test]
fn captured_torque_frames_are_read_and_written_again() {
    for (id, bytes, finger, counts) in [
        (0x180, "02 00 CB 00 42 00 25 00", Finger::Index, [2, 203, 66, 37]),
        (0x184, "01 00 B9 00 4A 00 33 00", Finger::Middle, [1, 185, 74, 51]),
        (0x188, "F1 FF C9 00 38 00 1F 00", Finger::Ring, [-15, 201, 56, 31]),
        // Thumb joint 0 is beyond the limit for torques; counts are not clamped.
        (0x18C, "58 02 05 00 8D FF FA FF", Finger::Thumb, [600, 5, -115, -6]),
    ] {
        assert_eq!(counts_of(id, bytes), (finger, counts));
        assert_eq!(finger.name(), format!("{finger:?}").to_lowercase());
        let frame = Command::SetTorque { finger, counts }.frame(OURS);
        assert_eq!((u32::from(frame.id()), frame.data()), (id, &hex(bytes)[..]));
    }
}

#[test]
fn captured_position_frames() {
    for (id, bytes, counts, angles) in [
        (
            0x080,
            "CA FD BD FE 90 FF CE FF",
            [-566, -323, -112, -50],
            [-0.050_240, -0.028_671, -0.009_941, -0.004_438],
        ),
        (
            0x084,
            "F9 FF CF FE 9A FF BE FF",
            [-7, -305, -102, -66],
            [-0.000_621, -0.027_073, -0.009_054, -0.005_858],
        ),
        (
            0x088,
            "18 00 D3 FE A7 FF D6 FF",
            [24, -301, -89, -42],
            [0.002_130, -0.026_718, -0.007_900, -0.003_728],
        ),
        (
            0x08C,
            "34 0A EF FF AF 00 FC FF",
            [2612, -17, 175, -4],
            [0.231_849, -0.001_509, 0.015_534, -0.000_355],
        ),
        (
            0x080,
            "FF 7F 00 80 FF FF 01 00",
            [32767, -32768, -1, 1],
            [2.908_502, -2.908_591, -0.000_089, 0.000_089],
        ),
    ] {
        let (_, found) = counts_of(id, bytes);
        assert_eq!(found, counts);
        for (counts, wanted) in counts.into_iter().zip(angles) {
            assert!((angle_rad(counts, Scale::V4) - wanted).abs() < 1e-6, "{counts}: {wanted}");
        }
    }
}

#[test]
fn home_pose_as_position_frames() {
    let wanted = [
        "00 00 52 F8 90 22 90 22",
        "00 00 52 F8 90 22 90 22",
        "D7 03 29 FC 67 26 90 22",
        "16 2E 34 13 85 0B 90 22",
    ];
    for ((finger, degrees), bytes) in Finger::ALL.into_iter().zip(HOME_DEG).zip(wanted) {
        let counts = degrees.map(|d: f64| angle_counts(d.to_radians(), Scale::V4).unwrap());
        let frame = Report::Position { finger, counts }.frame(OURS).unwrap();
        assert_eq!((frame.id(), frame.data()), (0x080 + 4 * u16::from(finger.number()), &hex(bytes)[..]));
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

    for (id, bytes, wanted) in [
        (0x0E0, "2B 2A 29 25", [Some(43), Some(42), Some(41), Some(37)]),
        (0x0E4, "29 2B 29 27", [Some(41), Some(43), Some(41), Some(39)]),
        (0x0E8, "27 27 27 24", [Some(39), Some(39), Some(39), Some(36)]),
        (0x0EC, "30 26 24 F6", [Some(48), Some(38), Some(36), None]),
    ] {
        let Ok(Message::Report(Report::Temperature { bytes, .. })) = decode(&data(id, &hex(bytes)), OURS)
        else {
            panic!("{id:#x}")
        };
        assert_eq!(bytes.map(temperature_c), wanted);
    }
}

#[test]
fn commands_and_requests() {
    for (device, on, off, info, period) in
        [(0, 0x100, 0x104, 0x200, 0x204), (1, 0x101, 0x105, 0x201, 0x205), (3, 0x103, 0x107, 0x203, 0x207)]
    {
        let device = DeviceId::new(device).unwrap();
        let zero = Command::SetPeriod { position_ms: 0, imu_ms: 0, temperature_ms: 0, status_ms: Some(0) };
        assert_eq!(
            (Command::ServoOn.frame(device).id(), Command::ServoOn.frame(device).data()),
            (on, &[][..])
        );
        assert_eq!(
            (Command::ServoOff.frame(device).id(), Command::ServoOff.frame(device).data()),
            (off, &[][..])
        );
        assert_eq!((zero.frame(device).id(), zero.frame(device).data()), (period, &[0; 8][..]));
        let request = Request::Info.frame(device);
        assert_eq!((request.id(), request.data(), request.is_remote()), (info, &[][..], true));
    }
    assert!(DeviceId::new(4).is_err());
    let ids = |make: fn(Finger) -> Request| Finger::ALL.map(|finger| make(finger).frame(OURS).id());
    assert_eq!(ids(Request::Position), [0x080, 0x084, 0x088, 0x08C]);
    assert_eq!(ids(Request::Temperature), [0x0E0, 0x0E4, 0x0E8, 0x0EC]);
    assert_eq!((Request::Serial.frame(OURS).id(), Request::Imu.frame(OURS).id()), (0x220, 0x0C0));
    for (temperature_ms, status_ms, bytes) in [
        (0, None, "03 00 00 00 00 00"),
        (500, None, "03 00 00 00 F4 01"),
        (0, Some(0), "03 00 00 00 00 00 00 00"),
        (500, Some(100), "03 00 00 00 F4 01 64 00"),
    ] {
        let command = Command::SetPeriod { position_ms: 3, imu_ms: 0, temperature_ms, status_ms };
        assert_eq!(command.frame(OURS).data(), hex(bytes));
        assert_eq!(decode(&data(0x204, &hex(bytes)), OURS), Ok(Message::Command(command)));
    }
    for request in [Request::Info, Request::Serial, Request::Imu, Request::Position(Finger::Ring)] {
        assert_eq!(requested(u32::from(request.frame(OURS).id()), OURS), Some(request));
    }
    assert_eq!(requested(0x100, OURS), None);
    assert_eq!(requested(0x201, OURS), None);
}

#[test]
fn one_control_step_from_captured_positions() {
    let kp = [[0.5, 0.5, 0.5, 0.833]; 3].into_iter().chain([[0.833, 0.833, 0.833, 0.5]]).flatten();
    let measured = [-566, -323, -112, -50, -7, -305, -102, -66, 24, -301, -89, -42, 2612, -17, 175, -4];
    let truncated = [30, -87, 450, 285, 0, -88, 450, 285, 51, -36, 450, 285, 525, 405, 246, 270];
    for (joint, (((kp, home), measured), wanted)) in
        kp.zip(HOME_DEG.as_flattened()).zip(measured).zip(truncated).enumerate()
    {
        let counts =
            torque_counts(kp * (home.to_radians() - angle_rad(measured, Scale::V4)), joint, Scale::V4)
                .unwrap();
        assert!((counts - wanted).abs() <= 1, "joint {joint}: {counts}, {wanted}");
    }
}

#[test]
fn velocity_from_two_frames() {
    let (_, before) = counts_of(0x080, "CA FD BD FE 90 FF CE FF");
    let (_, after) = counts_of(0x080, "D6 FD DF FE 89 FF CE FF");
    for ((a, b), wanted) in after.into_iter().zip(before).zip([0.355_05, 1.005_98, -0.207_11, 0.0]) {
        let rate = (angle_rad(a, Scale::V4) - angle_rad(b, Scale::V4)) / 0.003;
        assert!((rate - wanted).abs() < 1e-5, "{rate}");
    }
}

#[test]
fn version_five() {
    // The reference truncates 71.5 to 71; ours rounds it to 72.
    let frames = torque_frames(&TAU, OURS, Scale::V5).unwrap();
    let (_, counts) = counts_of(0x180, "8F 00 10 FF 47 00 B9 FF");
    let (ours, _) = frames[0].data().as_chunks::<2>();
    for (ours, reference) in ours.iter().zip(counts) {
        assert!((i16::from_le_bytes(*ours) - reference).abs() <= 1);
    }
    assert_eq!(frames[0].data(), hex("8F 00 10 FF 48 00 B8 FF"));
    for (counts, wanted) in
        [-566, -323, -112, -50].into_iter().zip([-0.869_314, -0.496_092, -0.172_020, -0.076_794])
    {
        assert!((angle_rad(counts, Scale::V5) - wanted).abs() < 1e-6);
    }
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
