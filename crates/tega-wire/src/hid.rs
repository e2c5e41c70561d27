//! The 64-byte reports of this project's own USB bridge or home-made vest. No bHaptics vest is a HID device.
//!
//! Host to device, report 0x01, little-endian:
//!
//! | offset | bytes | field |
//! |---|---|---|
//! | 0 | 1 | report number |
//! | 1 | 1 | high nibble: format version 1; low nibble: bit 0 stop all, bit 1 send status |
//! | 2 | 2 | sequence, wraps |
//! | 4 | 2 | time to live in ms: the device goes silent when no further frame comes within it; 0 only to stop |
//! | 6 | 1 | layout: 0 is two panels of 5 × 4, 1 is two of 4 × 4 |
//! | 7 | 1 | number of levels, 40 or 32 |
//! | 8 | 40 | levels 0 to 100 in the wearer's order, the rest zero |
//! | 48 | 12 | zero |
//! | 60 | 4 | CRC-32 of bytes 0 to 59 |
//!
//! Device to host, report 0x02: version and flags at 1, sequence last seen at 2 (2 bytes), link at 4, battery at 5,
//! fault bits at 6 (2), uptime in ms at 8 (4), dropped frames at 12 (4), CRC-32 at 60.

use crate::WireError;
use crate::bhaptics::check;
use tega_error::OutOfRange;

/// A report as written to or read from the device, its report number included.
pub type HidReport = [u8; 64];

/// The report descriptor of a device that takes report 1 and sends report 2: vendor page 0xFF00, 63 bytes each.
pub const REPORT_DESCRIPTOR: [u8; 31] = [
    0x06, 0x00, 0xFF, 0x09, 0x01, 0xA1, 0x01, 0x15, 0x00, 0x26, 0xFF, 0x00, 0x75, 0x08, 0x85, 0x01, 0x95,
    0x3F, 0x09, 0x02, 0x91, 0x02, 0x85, 0x02, 0x95, 0x3F, 0x09, 0x03, 0x81, 0x02, 0xC0,
];

const MOTOR_REPORT: u8 = 1;
const STATUS_REPORT: u8 = 2;
const VERSION: u8 = 1;
const STOP_ALL: u8 = 1;
const REQUEST_STATUS: u8 = 2;

/// What a motor report says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Motor {
    /// Set all motors.
    Levels {
        /// 40 or 32 levels, 0 to 100, in the wearer's order.
        levels: Vec<u8>,
        /// How long they last without a further frame, ms; at least 1.
        ttl_ms: u16,
        /// Whether the device is to answer with a status report.
        request_status: bool,
    },
    /// Everything off, whatever the levels.
    Stop,
}

fn seal(mut report: HidReport) -> HidReport {
    let (body, tail) = report.split_at_mut(60);
    tail.copy_from_slice(&crc32fast::hash(body).to_le_bytes());
    report
}

/// The bytes of a report whose length and checksum are right.
fn open(packet: &'static str, bytes: &[u8], number: u8) -> Result<HidReport, WireError> {
    let report: HidReport =
        bytes.try_into().map_err(|_| WireError::PacketLength { packet, got: bytes.len(), wanted: "64" })?;
    if report[0] != number {
        let wanted = if number == MOTOR_REPORT { "0x1" } else { "0x2" };
        return Err(WireError::Field { packet, field: "report number", got: u32::from(report[0]), wanted });
    }
    if report[1] >> 4 != VERSION {
        let got = u32::from(report[1] >> 4);
        return Err(WireError::Field { packet, field: "format version", got, wanted: "0x1" });
    }
    let sealed = seal(report);
    if sealed != report {
        let crc = |r: &HidReport| u32::from_le_bytes([r[60], r[61], r[62], r[63]]);
        return Err(WireError::Checksum { packet, got: crc(&report), computed: crc(&sealed) });
    }
    Ok(report)
}

/// The report that carries a motor frame.
///
/// # Errors
/// [`WireError::Length`] unless there are 40 or 32 levels, [`WireError::OutOfRange`] for one above 100 and for a
/// time to live of 0.
///
/// ```
/// use tega_wire::hid::{Motor, decode_motor, motor_report};
/// let frame = Motor::Levels { levels: vec![50; 40], ttl_ms: 150, request_status: false };
/// let report = motor_report(7, &frame)?;
/// assert_eq!(decode_motor(&report)?, (7, frame));
/// # Ok::<(), tega_wire::WireError>(())
/// ```
pub fn motor_report(sequence: u16, motor: &Motor) -> Result<HidReport, WireError> {
    let mut report = [0; 64];
    let (flags, ttl_ms, layout, levels): (u8, u16, u8, &[u8]) = match motor {
        Motor::Stop => (STOP_ALL, 0, 0, &[0; 40]),
        Motor::Levels { levels, ttl_ms, request_status } => {
            let layout = match levels.len() {
                40 => 0,
                32 => 1,
                got => return Err(WireError::Length { name: "intensities", got, wanted: "40 or 32" }),
            };
            check(levels)?;
            if *ttl_ms == 0 {
                let wanted = "1 to 65535; only a stop has 0";
                return Err(OutOfRange::new("ttl_ms", 0.0, "ms", wanted).into());
            }
            (if *request_status { REQUEST_STATUS } else { 0 }, *ttl_ms, layout, levels)
        }
    };
    let [[s0, s1], [t0, t1]] = [sequence, ttl_ms].map(u16::to_le_bytes);
    let head = [MOTOR_REPORT, VERSION << 4 | flags, s0, s1, t0, t1, layout, levels.len() as u8];
    report.iter_mut().zip(head.iter().chain(levels)).for_each(|(to, from)| *to = *from);
    Ok(seal(report))
}

/// The sequence number and content of a motor report: what a device does with it. Anything the format does not have
/// is refused, so that a device never guesses.
///
/// # Errors
/// [`WireError::PacketLength`], [`WireError::Field`], [`WireError::Checksum`].
pub fn decode_motor(bytes: &[u8]) -> Result<(u16, Motor), WireError> {
    let packet = "motor report";
    let field = |field, got: u8, wanted| WireError::Field { packet, field, got: u32::from(got), wanted };
    let report = open(packet, bytes, MOTOR_REPORT)?;
    let sequence = u16::from_le_bytes([report[2], report[3]]);
    let ttl_ms = u16::from_le_bytes([report[4], report[5]]);
    let flags = report[1] & 15;
    if flags & STOP_ALL != 0 {
        return Ok((sequence, Motor::Stop));
    }
    let count = match (report[6], report[7]) {
        (0, 40) => 40,
        (1, 32) => 32,
        (0 | 1, got) => return Err(field("number of levels", got, "40 for layout 0, 32 for layout 1")),
        (got, _) => return Err(field("layout", got, "0 or 1")),
    };
    if flags & !REQUEST_STATUS != 0 {
        return Err(field("flags", flags, "bits 0 and 1 only"));
    }
    if ttl_ms == 0 {
        return Err(field("time to live", 0, "1 ms or more"));
    }
    let (levels, rest) = report[8..60].split_at(count);
    if let Some(&got) = levels.iter().find(|&&level| level > 100) {
        return Err(field("a level", got, "0 to 100"));
    }
    if let Some(&got) = rest.iter().find(|&&byte| byte != 0) {
        return Err(field("an unused byte", got, "0"));
    }
    Ok((
        sequence,
        Motor::Levels { levels: levels.to_vec(), ttl_ms, request_status: flags & REQUEST_STATUS != 0 },
    ))
}

/// What the device says of itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Status {
    /// Flags, 4 bits; none is defined yet.
    pub flags: u8,
    /// The sequence number it saw last.
    pub sequence: u16,
    /// Its link to the vest: 0 none, 1 scanning, 2 connected.
    pub link: u8,
    /// The vest's battery in percent, if known.
    pub battery: Option<u8>,
    /// Fault bits.
    pub faults: u16,
    /// Time since it started, ms.
    pub uptime_ms: u32,
    /// Frames it refused.
    pub dropped: u32,
}

/// The report a device sends.
pub fn status_report(status: &Status) -> HidReport {
    let mut report = [0; 64];
    let [s0, s1] = status.sequence.to_le_bytes();
    let [f0, f1] = status.faults.to_le_bytes();
    let head = [
        STATUS_REPORT,
        VERSION << 4 | status.flags & 15,
        s0,
        s1,
        status.link,
        status.battery.unwrap_or(u8::MAX),
        f0,
        f1,
    ];
    let numbers = [status.uptime_ms.to_le_bytes(), status.dropped.to_le_bytes()];
    let bytes = head.iter().chain(numbers.as_flattened());
    report.iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
    seal(report)
}

/// Decode a status report. Bytes that version 1 leaves unused are ignored.
///
/// # Errors
/// [`WireError::PacketLength`], [`WireError::Field`], [`WireError::Checksum`].
pub fn decode_status(bytes: &[u8]) -> Result<Status, WireError> {
    let packet = "status report";
    let r = open(packet, bytes, STATUS_REPORT)?;
    if r[4] > 2 {
        return Err(WireError::Field { packet, field: "link", got: u32::from(r[4]), wanted: "0, 1 or 2" });
    }
    Ok(Status {
        flags: r[1] & 15,
        sequence: u16::from_le_bytes([r[2], r[3]]),
        link: r[4],
        battery: (r[5] != u8::MAX).then_some(r[5]),
        faults: u16::from_le_bytes([r[6], r[7]]),
        uptime_ms: u32::from_le_bytes([r[8], r[9], r[10], r[11]]),
        dropped: u32::from_le_bytes([r[12], r[13], r[14], r[15]]),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_flipped_bit_is_noticed() {
        let frame = Motor::Levels { levels: vec![50; 32], ttl_ms: 150, request_status: true };
        let motor = motor_report(515, &frame).unwrap();
        let status =
            status_report(&Status { sequence: 515, link: 2, battery: Some(98), ..Status::default() });
        for bit in 0..512 {
            let mut bad = motor;
            bad[bit / 8] ^= 1 << (bit % 8);
            assert!(decode_motor(&bad).is_err());
            let mut bad = status;
            bad[bit / 8] ^= 1 << (bit % 8);
            assert!(decode_status(&bad).is_err());
        }
    }

    #[test]
    fn a_device_refuses_what_the_format_does_not_have() {
        let frame = Motor::Levels { levels: vec![0; 32], ttl_ms: 1, request_status: false };
        let good = motor_report(0, &frame).unwrap();
        for (offset, value) in
            [(0, 2), (1, 0x20), (1, 0x14), (4, 0), (6, 2), (6, 0), (7, 40), (8, 101), (59, 1)]
        {
            let mut bad = good;
            bad[offset] = value;
            assert!(decode_motor(&seal(bad)).is_err(), "offset {offset}");
        }
        assert!(decode_motor(&good[..63]).is_err());
        assert!(
            motor_report(0, &Motor::Levels { levels: vec![0; 40], ttl_ms: 0, request_status: false })
                .is_err()
        );
    }

    #[test]
    fn the_descriptor_declares_two_reports_of_64_bytes() {
        let ids: Vec<u8> = REPORT_DESCRIPTOR.windows(2).filter(|w| w[0] == 0x85).map(|w| w[1]).collect();
        let counts: Vec<u8> = REPORT_DESCRIPTOR.windows(2).filter(|w| w[0] == 0x95).map(|w| w[1]).collect();
        assert_eq!((ids, counts), (vec![MOTOR_REPORT, STATUS_REPORT], vec![63, 63]));
    }
}
