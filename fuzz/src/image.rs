//! What the PNG reader owes to any file at all.

use tega_image::decode_png;

use crate::bytes::{Bytes, Target};

/// All of them.
pub const TARGETS: &[Target] =
    &[("png_decode_never_panics_and_is_whole", png_decode_never_panics_and_is_whole)];

const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";

/// Any file, and any file of whole chunks: no panic, every pixel there, and no file that is cut short is read. A file
/// written from known pixels gives them back, and with one byte changed never gives others.
pub fn png_decode_never_panics_and_is_whole(data: &[u8]) {
    let mut bytes = Bytes(data);
    match bytes.byte() % 3 {
        0 => whole_or_refused(bytes.0),
        1 => whole_or_refused(&chunked(bytes.0)),
        _ => written_is_read(&mut bytes),
    }
}

fn whole_or_refused(file: &[u8]) {
    let Ok(Some(picture)) = decode_png(file) else { return };
    assert_eq!(picture.bytes.len(), 3 * picture.height * picture.width);
    let end = end_of_chunks(file).expect("a file that is read ends its chunks");
    for cut in [8, end / 2, end - 12, end - 1] {
        assert!(decode_png(&file[..cut]).is_err(), "cut at {cut} of {end}");
    }
}

/// Where the IEND chunk ends.
fn end_of_chunks(file: &[u8]) -> Option<usize> {
    let mut at = SIGNATURE.len();
    loop {
        let length = u32::from_be_bytes(file.get(at..at + 4)?.try_into().ok()?) as usize;
        let last = file.get(at + 4..at + 8)? == b"IEND";
        at = at.checked_add(length)?.checked_add(12)?;
        if last {
            return Some(at);
        }
    }
}

/// A small header, then chunks of the types a decoder knows, all with right lengths and checksums.
fn chunked(data: &[u8]) -> Vec<u8> {
    let mut bytes = Bytes(data);
    let mut file = SIGNATURE.to_vec();
    let [width, height, depth, colour, interlaced] = bytes.take();
    let header = [0, 0, 0, width, 0, 0, 0, height, 1 << (depth % 5), colour % 7, 0, 0, interlaced & 1];
    chunk(&mut file, b"IHDR", &header);
    while !bytes.0.is_empty() {
        let kind = bytes.pick(&[b"IDAT", b"PLTE", b"tRNS", b"gAMA", b"tEXt", b"acTL", b"fcTL", b"fdAT"]);
        let length = bytes.up_to(255).min(bytes.0.len());
        let (body, rest) = bytes.0.split_at(length);
        bytes.0 = rest;
        if kind == b"IDAT" && bytes.flag() {
            chunk(&mut file, kind, &stored(body));
        } else {
            chunk(&mut file, kind, body);
        }
    }
    chunk(&mut file, b"IEND", &[]);
    file
}

/// Writes a picture of known pixels, reads it, then changes a byte and reads it again.
fn written_is_read(bytes: &mut Bytes<'_>) {
    let (height, width) = (1 + bytes.up_to(11), 1 + bytes.up_to(11));
    let (colour, channels) = bytes.pick(&[(0, 1), (2, 3), (4, 2), (6, 4)]);
    let (at, change) = (usize::from(bytes.word()), bytes.byte());
    let mut raw = vec![];
    let mut wanted = vec![];
    let mut above = vec![0; width * channels];
    for _ in 0..height {
        let filter = bytes.byte() % 3;
        let row: Vec<u8> = (0..width * channels).map(|_| bytes.byte()).collect();
        raw.push(filter);
        for (i, value) in row.iter().enumerate() {
            let left = if i < channels { 0 } else { row[i - channels] };
            raw.push(value.wrapping_sub(match filter {
                0 => 0,
                1 => left,
                _ => above[i],
            }));
        }
        wanted.extend(row.chunks_exact(channels).flat_map(|pixel| match *pixel {
            [r, g, b, ..] => [b, g, r],
            [grey, ..] => [grey; 3],
            [] => unreachable!(),
        }));
        above = row;
    }
    let mut file = SIGNATURE.to_vec();
    let header = [0, 0, 0, width as u8, 0, 0, 0, height as u8, 8, colour, 0, 0, 0];
    chunk(&mut file, b"IHDR", &header);
    chunk(&mut file, b"IDAT", &stored(&raw));
    chunk(&mut file, b"IEND", &[]);
    let picture = decode_png(&file).unwrap().unwrap();
    assert_eq!((picture.height, picture.width, &picture.bytes), (height, width, &wanted));
    whole_or_refused(&file);
    let length = file.len();
    file[at % length] ^= change;
    if let Ok(changed) = decode_png(&file) {
        assert_eq!(changed, Some(picture), "byte {} changed by {change}", at % length);
    }
}

/// Appends a chunk: length, type, body, checksum of the latter two.
fn chunk(file: &mut Vec<u8>, kind: &[u8; 4], body: &[u8]) {
    file.extend((body.len() as u32).to_be_bytes());
    let from = file.len();
    file.extend(kind);
    file.extend(body);
    let crc = crate::bytes::crc32(&file[from..]);
    file.extend(crc.to_be_bytes());
}

/// A zlib stream of one stored block.
fn stored(body: &[u8]) -> Vec<u8> {
    let length = body.len() as u16;
    let mut stream = vec![0x78, 0x01, 1];
    stream.extend(length.to_le_bytes());
    stream.extend((!length).to_le_bytes());
    stream.extend(body);
    let (mut a, mut b) = (1_u32, 0_u32);
    for byte in body {
        a = (a + u32::from(*byte)) % 65_521;
        b = (b + a) % 65_521;
    }
    stream.extend((b << 16 | a).to_be_bytes());
    stream
}
