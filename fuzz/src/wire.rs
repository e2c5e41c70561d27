//! What every decoder owes to any bytes at all.

use tega_wire::allegro::{self, DeviceId, Message, Received, Report, Request};
use tega_wire::bhaptics::{self, Intensities};
use tega_wire::{ascii, chords, cyton, hid, spiker};

use crate::bytes::{Target, crc32, head};

/// All of them.
pub const TARGETS: &[Target] = &[
    ("allegro_decode_then_encode_is_identity", allegro_decode_then_encode_is_identity),
    ("x40_levels_survive_the_frame", x40_levels_survive_the_frame),
    ("hid_decode_then_encode_is_identity", hid_decode_then_encode_is_identity),
    ("cyton_any_chunking_is_the_same", cyton_any_chunking_is_the_same),
    ("cyton_finds_a_clean_run_behind_garbage", cyton_finds_a_clean_run_behind_garbage),
    ("chords_any_chunking_is_the_same", chords_any_chunking_is_the_same),
    ("spiker_any_chunking_is_the_same", spiker_any_chunking_is_the_same),
    ("ascii_any_chunking_is_the_same", ascii_any_chunking_is_the_same),
];

/// Feed `stream` whole, byte by byte and in chunks of `size`; the answers must agree.
fn same_for_every_chunking<D: Clone, T: PartialEq + std::fmt::Debug>(
    decoder: &D,
    stream: &[u8],
    size: u8,
    feed: impl Fn(&mut D, &[u8]) -> Vec<T>,
) -> (D, Vec<T>) {
    let mut whole = decoder.clone();
    let packets = feed(&mut whole, stream);
    for size in [1, usize::from(size).max(1)] {
        let mut cut = decoder.clone();
        let parts: Vec<T> = stream.chunks(size).flat_map(|chunk| feed(&mut cut, chunk)).collect();
        assert_eq!(parts, packets, "chunks of {size}");
    }
    (whole, packets)
}

/// Any frame: no panic; what decodes is encoded back to the same bytes, and nothing but a data frame of ours decodes.
pub fn allegro_decode_then_encode_is_identity(data: &[u8]) {
    let ([low, high, flags], payload) = head(data);
    let device = DeviceId::new(flags >> 6).unwrap();
    let received = Received {
        id: u32::from(u16::from_le_bytes([low, high])),
        data: payload,
        remote: flags & 1 != 0,
        extended: flags & 2 != 0,
        error: flags & 4 != 0,
    };
    if let Some(request) = allegro::requested(received.id, device) {
        assert_eq!(u32::from(request.frame(device).id()), received.id);
        assert!(matches!(request, Request::Info | Request::Serial | Request::Imu) || received.id < 0x100);
    }
    let frame = match allegro::decode(&received, device) {
        Err(_) | Ok(Message::Pose { .. } | Message::Config(_)) => return,
        Ok(Message::Command(command)) => command.frame(device),
        Ok(Message::Report(report)) => {
            if let Report::Position { counts, .. } = report {
                for counts in counts {
                    let angle = allegro::angle_rad(counts, allegro::Scale::V4);
                    assert_eq!(allegro::angle_counts(angle, allegro::Scale::V4), Ok(counts));
                }
            }
            report.frame(device).unwrap()
        }
    };
    assert_eq!((u32::from(frame.id()), frame.data()), (received.id, received.data));
    assert!(flags & 7 == 0 && !frame.is_remote());
}

/// Any forty intensities: their levels come back from the frame, and an X16 makes the maxima of them.
pub fn x40_levels_survive_the_frame(data: &[u8]) {
    let (bytes, rest) = head::<40>(data);
    let mirror = rest.first().is_some_and(|byte| byte & 1 != 0);
    let intensities = Intensities::new(&bytes.map(|byte| byte % 101)).unwrap();
    let frame = bhaptics::ble_frame(&intensities, mirror);
    let levels = bhaptics::ble_steps(&frame, mirror);
    assert_eq!(levels, intensities.values().map(bhaptics::motor_step));
    let x16 = bhaptics::x16_steps(&frame, mirror);
    for (motor, &level) in x16.iter().enumerate() {
        let rows = if motor / 4 % 2 == 0 { 0..2 } else { 2..5 };
        let column = |row: usize| levels[motor / 8 * 20 + 4 * row + motor % 4];
        assert_eq!(Some(level), rows.map(column).max());
    }
}

/// Any 60 bytes under a right checksum: no panic; a motor frame that is accepted is encoded back to the same bytes.
pub fn hid_decode_then_encode_is_identity(data: &[u8]) {
    assert!(hid::decode_motor(data).is_err() || data.len() == 64);
    assert!(hid::decode_status(data).is_err() || data.len() == 64);
    let (body, _) = head::<60>(data);
    let mut report = [0; 64];
    report[..60].copy_from_slice(&body);
    report[60..].copy_from_slice(&crc32(&body).to_le_bytes());
    if let Ok((sequence, motor)) = hid::decode_motor(&report) {
        let again = hid::motor_report(sequence, &motor).unwrap();
        match motor {
            hid::Motor::Levels { .. } => assert_eq!(again, report),
            hid::Motor::Stop => assert_eq!(hid::decode_motor(&again), Ok((sequence, hid::Motor::Stop))),
        }
    }
    if let Ok(status) = hid::decode_status(&report) {
        assert_eq!(hid::decode_status(&hid::status_report(&status)), Ok(status));
    }
}

/// Any stream: the same packets and counters for every chunking; every byte is accounted for; little is held back.
pub fn cyton_any_chunking_is_the_same(data: &[u8]) {
    let ([size], stream) = head(data);
    let decoder = cyton::Decoder::new(24).unwrap();
    let (decoder, packets) = same_for_every_chunking(&decoder, stream, size, cyton::Decoder::feed);
    let stats = decoder.stats();
    assert_eq!(stream.len() as u64, 33 * stats.packets + stats.skipped_bytes + stats.pending_bytes as u64);
    assert_eq!(stats.packets, packets.len() as u64);
    assert!(stats.pending_bytes < 4 * 33);
    for pair in packets.windows(2) {
        assert_eq!(pair[1].missing, pair[1].counter.wrapping_sub(pair[0].counter).wrapping_sub(1));
    }
    for packet in packets {
        assert!(packet.counts.iter().all(|counts| (-8_388_608..=8_388_607).contains(counts)));
        let _ = packet.aux();
    }
}

/// Any garbage, then six packets of any payload with counters in order: exactly those six end the answer.
pub fn cyton_finds_a_clean_run_behind_garbage(data: &[u8]) {
    let ([first, garbage_len], rest) = head(data);
    let (garbage, payload) = rest.split_at(usize::from(garbage_len).min(rest.len()));
    let mut stream = garbage.to_vec();
    let mut wanted = vec![];
    let mut payload = payload.iter().copied().chain(std::iter::repeat(0));
    for counter in 0..6 {
        let mut packet = [0; 33];
        packet.fill_with(|| payload.next().unwrap_or_default());
        (packet[0], packet[1], packet[32]) = (0xA0, first.wrapping_add(counter), 0xC0 + packet[32] % 7);
        stream.extend(packet);
        wanted.push(packet);
    }
    if a_false_chain_counts(&stream, garbage.len()) {
        return;
    }
    let mut decoder = cyton::Decoder::new(24).unwrap();
    let packets = decoder.feed(&stream);
    let found = packets.get(packets.len().saturating_sub(6)..).unwrap_or_default();
    let counters: Vec<u8> = found.iter().map(|packet| packet.counter).collect();
    assert_eq!(counters, wanted.iter().map(|packet| packet[1]).collect::<Vec<_>>());
    for (packet, wanted) in found.iter().zip(&wanted) {
        assert_eq!((packet.footer, &packet.aux_bytes[..]), (wanted[32], &wanted[26..32]));
    }
}

/// Whether bytes that are not the run look just like it: header, footer and a counter that advances, out of phase.
/// Nothing can tell such bytes from packets, so they prove nothing.
fn a_false_chain_counts(stream: &[u8], run_at: usize) -> bool {
    let framed = |at: usize| {
        stream.get(at) == Some(&0xA0)
            && stream.get(at + 32).is_some_and(|footer| (0xC0..=0xC6).contains(footer))
    };
    (0..stream.len().saturating_sub(66))
        .filter(|at| *at < run_at || !(at - run_at).is_multiple_of(33))
        .any(|at| framed(at) && framed(at + 33) && stream[at + 34] == stream[at + 1].wrapping_add(1))
}

/// As for the Cyton, for every channel count.
pub fn chords_any_chunking_is_the_same(data: &[u8]) {
    let ([size, channels], stream) = head(data);
    let channels = 1 + usize::from(channels) % chords::CHANNELS_MAX;
    let decoder = chords::Decoder::new(channels).unwrap();
    let (decoder, packets) = same_for_every_chunking(&decoder, stream, size, chords::Decoder::feed);
    let (stats, len) = (decoder.stats(), 2 * channels + 4);
    assert_eq!(
        stream.len() as u64,
        len as u64 * stats.packets + stats.skipped_bytes + stats.pending_bytes as u64
    );
    assert!(stats.pending_bytes < 4 * len);
    assert!(packets.iter().all(|packet| packet.samples.len() == channels));
    assert!(chords::detect_channels(stream).is_none_or(|n| (1..=chords::CHANNELS_MAX).contains(&n)));
}

/// As for the Cyton; values have ten bits.
pub fn spiker_any_chunking_is_the_same(data: &[u8]) {
    let ([size, channels], stream) = head(data);
    let channels = 1 + usize::from(channels) % 6;
    let decoder = spiker::Decoder::new(channels).unwrap();
    let (decoder, frames) = same_for_every_chunking(&decoder, stream, size, spiker::Decoder::feed);
    let (stats, len) = (decoder.stats(), 2 * channels as u64);
    assert_eq!(stream.len() as u64, len * stats.frames + stats.skipped_bytes + stats.pending_bytes as u64);
    assert!(stats.pending_bytes <= 2 * channels);
    assert!(frames.iter().flatten().all(|&value| value < 1024));
}

/// As for the Cyton; every value is finite, and every line break but the first ends a line that is counted.
pub fn ascii_any_chunking_is_the_same(data: &[u8]) {
    let ([size, options], stream) = head(data);
    let (channels, leading) = (1 + usize::from(options % 4), usize::from(options >> 4) % 3);
    let decoder = ascii::Decoder::new(channels, leading, true).unwrap();
    let bits = |decoder: &mut ascii::Decoder, chunk: &[u8]| {
        let samples = decoder.feed(chunk);
        assert!(samples.iter().all(|value| value.is_finite()));
        samples.into_iter().map(f64::to_bits).collect()
    };
    let (decoder, samples) = same_for_every_chunking(&decoder, stream, size, bits);
    let stats = decoder.stats();
    let breaks = stream.iter().filter(|&&byte| byte == b'\n').count() as u64;
    assert_eq!(stats.lines + stats.rejected_lines, breaks.saturating_sub(1));
    assert_eq!(samples.len() as u64, stats.lines * channels as u64);
    assert!(stats.pending_bytes <= ascii::LINE_MAX && decoder.last_rejected().len() <= ascii::LINE_MAX);
}
