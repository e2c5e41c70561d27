//! `OpenBCI` Cyton: 33-byte packets of eight signed 24-bit channels, big-endian, 250 a second.
//!
//! | byte | content |
//! |---|---|
//! | 0 | 0xA0 |
//! | 1 | counter, wraps at 256 |
//! | 2 to 25 | eight channels of three bytes |
//! | 26 to 31 | auxiliary bytes, meaning by the footer |
//! | 32 | footer 0xC0 to 0xC6 |
//!
//! A packet counts only with both ends in place, and where a false one could be mistaken for it, only once the
//! counters that follow say so.

use tega_error::OutOfRange;

use crate::WireError;
use crate::framing::{Framing, Shape};

pub use crate::framing::StreamStats;

/// Channels of a board without its extension.
pub const CHANNELS: usize = 8;

/// Gains the board's amplifiers have; 24 after a reset.
pub const GAINS: [u8; 7] = [1, 2, 4, 6, 8, 12, 24];

/// What the auxiliary bytes hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Aux {
    /// Footer 0xC0: acceleration X, Y, Z in 0.002/16 g; nothing when there is no new reading (all zero on the wire).
    Acceleration(Option<[i16; 3]>),
    /// Footer 0xC1: three words of the analog, digital or marker mode.
    Raw([u16; 3]),
    /// Footer 0xC2: six bytes of the user's own.
    User([u8; 6]),
    /// Footers 0xC3 to 0xC6: one word, and the board's time in ms. The word is one axis of the accelerometer
    /// (0xC3, 0xC4) or a raw auxiliary word (0xC5, 0xC6).
    Stamped {
        /// The word.
        word: u16,
        /// The board's clock, ms.
        time_ms: u32,
    },
}

/// One packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Packet {
    /// The board's counter.
    pub counter: u8,
    /// Packets missing before this one, by the counter, modulo 256.
    pub missing: u8,
    /// Eight channels in counts.
    pub counts: [i32; CHANNELS],
    /// The auxiliary bytes as sent.
    pub aux_bytes: [u8; 6],
    /// The footer, 0xC0 to 0xC6.
    pub footer: u8,
}

impl Packet {
    fn parse(frame: &[u8], missing: u8) -> Option<Self> {
        let &[_, counter, ref body @ .., a, b, c, d, e, f, footer] = frame else { return None };
        let mut counts = [0; CHANNELS];
        for (to, bytes) in counts.iter_mut().zip(body.chunks_exact(3)) {
            if let &[high, middle, low] = bytes {
                // The top byte carries the sign: shifted up and back down, it fills the 32 bits.
                *to = i32::from_be_bytes([high, middle, low, 0]) >> 8;
            }
        }
        Some(Self { counter, missing, counts, aux_bytes: [a, b, c, d, e, f], footer })
    }

    /// The auxiliary bytes, read as the footer says.
    pub fn aux(&self) -> Aux {
        let [a, b, c, d, e, f] = self.aux_bytes;
        let words = [[a, b], [c, d], [e, f]];
        match self.footer {
            0xC0 => {
                let axes = words.map(i16::from_be_bytes);
                Aux::Acceleration((axes != [0; 3]).then_some(axes))
            }
            0xC1 => Aux::Raw(words.map(u16::from_be_bytes)),
            0xC3..=0xC6 => {
                Aux::Stamped { word: u16::from_be_bytes([a, b]), time_ms: u32::from_be_bytes([c, d, e, f]) }
            }
            _ => Aux::User(self.aux_bytes),
        }
    }

    /// Acceleration X, Y, Z in g; NaN where the packet holds no new reading.
    pub fn acceleration_g(&self) -> [f64; 3] {
        match self.aux() {
            Aux::Acceleration(Some(axes)) => axes.map(acceleration_g),
            Aux::Acceleration(None) | Aux::Raw(_) | Aux::User(_) | Aux::Stamped { .. } => [f64::NAN; 3],
        }
    }

    /// The board's clock in ms, where the packet holds it.
    pub fn time_ms(&self) -> Option<u32> {
        match self.aux() {
            Aux::Stamped { time_ms, .. } => Some(time_ms),
            Aux::Acceleration(_) | Aux::Raw(_) | Aux::User(_) => None,
        }
    }
}

/// Counts to microvolts at a gain: 4.5 V over `gain * (2^23 - 1)` counts.
///
/// Both products are exact, so the one division makes the result the nearest number there is.
pub fn microvolts(counts: i32, gain: u8) -> f64 {
    f64::from(counts) * 4.5e6 / (f64::from(gain) * 8_388_607.0)
}

/// Acceleration counts to g.
pub fn acceleration_g(counts: i16) -> f64 {
    f64::from(counts) / 8000.0
}

/// Finds packets in a stream of any bytes.
///
/// ```
/// use tega_wire::cyton::{Decoder, microvolts};
///
/// let mut packet = [0; 33];
/// (packet[0], packet[1], packet[4], packet[32]) = (0xA0, 7, 1, 0xC0);
/// let mut decoder = Decoder::new(24)?;
/// assert!(decoder.feed(&packet[..20]).is_empty());
/// let packets = decoder.feed(&packet[20..]);
/// assert_eq!((packets[0].counter, packets[0].counts[0]), (7, 1));
/// assert_eq!(decoder.microvolts(&packets[0])[0], 0.022351744455307063);
/// # Ok::<(), tega_wire::WireError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Decoder {
    framing: Framing,
    gain: u8,
}

impl Decoder {
    /// A decoder for a board whose channels are all set to `gain`.
    ///
    /// # Errors
    /// [`WireError::Setting`] for a gain the board does not have.
    pub fn new(gain: u8) -> Result<Self, WireError> {
        if !GAINS.contains(&gain) {
            let wanted = "1, 2, 4, 6, 8, 12 or 24";
            return Err(WireError::Setting(OutOfRange::new("gain", f64::from(gain), "", wanted)));
        }
        let shape = Shape { len: 33, header: &[0xA0], counter_at: 1, end: 0xC0..=0xC6 };
        Ok(Self { framing: Framing::new(shape), gain })
    }

    /// Take the next bytes and give the packets they complete.
    pub fn feed(&mut self, data: &[u8]) -> Vec<Packet> {
        let mut packets = Vec::new();
        self.framing.feed(data, |frame, missing| packets.extend(Packet::parse(frame, missing)));
        packets
    }

    /// A packet's channels in microvolts.
    pub fn microvolts(&self, packet: &Packet) -> [f64; CHANNELS] {
        packet.counts.map(|counts| microvolts(counts, self.gain))
    }

    /// Counters since the start.
    pub fn stats(&self) -> StreamStats {
        self.framing.stats()
    }
}
