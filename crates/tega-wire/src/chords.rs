//! Chords firmware (UNO, Pico, NPG-Lite and others): packets of unsigned 16-bit channels, high byte first.
//!
//! | byte | content |
//! |---|---|
//! | 0, 1 | 0xC7 0x7C |
//! | 2 | counter, wraps at 256 |
//! | 3 … 2 + 2 N | N channels |
//! | 3 + 2 N | 0x01 |

use tega_error::OutOfRange;

use crate::WireError;
use crate::framing::{Framing, Shape};

pub use crate::framing::StreamStats;

/// The most channels a board with this firmware has.
pub const CHANNELS_MAX: usize = 16;

const SYNC: &[u8] = &[0xC7, 0x7C];

fn shape(channels: usize) -> Shape {
    Shape { len: 2 * channels + 4, header: SYNC, counter_at: 2, end: 1..=1 }
}

/// One packet.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Packet {
    /// The board's counter; only its differences mean anything.
    pub counter: u8,
    /// Packets missing before this one, by the counter, modulo 256.
    pub missing: u8,
    /// The channels in converter counts, around mid-range at rest.
    pub samples: Vec<u16>,
}

/// Finds packets in a stream of any bytes.
///
/// ```
/// let mut decoder = tega_wire::chords::Decoder::new(3)?;
/// let packets = decoder.feed(&[0xC7, 0x7C, 1, 2, 0, 8, 0, 0x0F, 0xFF, 1]);
/// assert_eq!(packets[0].samples, [512, 2048, 4095]);
/// # Ok::<(), tega_wire::WireError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Decoder {
    framing: Framing,
}

impl Decoder {
    /// A decoder for packets of `channels` channels.
    ///
    /// # Errors
    /// [`WireError::Setting`] unless there are 1 to 16.
    pub fn new(channels: usize) -> Result<Self, WireError> {
        if !(1..=CHANNELS_MAX).contains(&channels) {
            return Err(WireError::Setting(OutOfRange::new("channels", channels as f64, "", "1 to 16")));
        }
        Ok(Self { framing: Framing::new(shape(channels)) })
    }

    /// Take the next bytes and give the packets they complete.
    pub fn feed(&mut self, data: &[u8]) -> Vec<Packet> {
        let mut packets = Vec::new();
        self.framing.feed(data, |frame, missing| {
            if let &[_, _, counter, ref body @ .., _] = frame {
                let (words, _) = body.as_chunks::<2>();
                let samples = words.iter().map(|&word| u16::from_be_bytes(word)).collect();
                packets.push(Packet { counter, missing, samples });
            }
        });
        packets
    }

    /// Counters since the start.
    pub fn stats(&self) -> StreamStats {
        self.framing.stats()
    }
}

/// How many channels the packets in a stretch of stream have: the number that yields most packets in unbroken order,
/// at least three. The name a board answers with does not settle it for all of them.
///
/// Looks at the first 4096 bytes.
pub fn detect_channels(data: &[u8]) -> Option<usize> {
    let sample = data.get(..4096).unwrap_or(data);
    let in_order = |channels: usize| {
        let (mut framing, mut count) = (Framing::new(shape(channels)), 0_usize);
        framing.feed(sample, |_, missing| count += usize::from(missing == 0));
        count * (2 * channels + 4)
    };
    let (channels, bytes) = (1..=CHANNELS_MAX).map(|n| (n, in_order(n))).max_by_key(|&(_, bytes)| bytes)?;
    (bytes >= 3 * (2 * channels + 4)).then_some(channels)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_channel_count_is_read_off_the_stream() {
        for channels in 1..=CHANNELS_MAX {
            let mut stream = b"NPG-LITE\r\n".to_vec();
            for counter in 250..=258_u16 {
                stream.extend([0xC7, 0x7C, counter as u8]);
                (0..channels).for_each(|channel| stream.extend((2000 + channel as u16 * 7).to_be_bytes()));
                stream.push(1);
            }
            assert_eq!(detect_channels(&stream), Some(channels));
        }
        assert_eq!(detect_channels(b"UNO-R4\r\n"), None);
    }
}
