//! Backyard Brains `SpikerShield`: two bytes of seven bits a channel, the first byte of a frame marked by its top bit.
//!
//! There is neither a counter nor a checksum. A frame is given out when the next one begins, since a loss shows only
//! as a frame of the wrong length; a frame whose upper bytes are too large for the converter is refused as well.

use tega_error::OutOfRange;

use crate::WireError;

/// Largest upper byte of a 10-bit value.
const HIGH_MAX: u8 = 7;

/// What a stream held so far. `received = 2 * channels * frames + skipped + pending` at any time.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct SpikerStats {
    /// Frames given out.
    pub frames: u64,
    /// Frames refused: too short, too long, or a value above 1023.
    pub bad_frames: u64,
    /// Bytes that belong to no frame given out.
    pub skipped_bytes: u64,
    /// Bytes held back until more arrive.
    pub pending_bytes: usize,
}

/// Finds frames in a stream of any bytes.
///
/// ```
/// let mut decoder = tega_wire::spiker::Decoder::new(3)?;
/// let frames = decoder.feed(&[0x87, 0x7F, 0, 0, 4, 0, 0x80]);
/// assert_eq!(frames, [[1023, 0, 512]]);
/// # Ok::<(), tega_wire::WireError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Decoder {
    channels: usize,
    /// The frame being received; never longer than it may be.
    frame: Vec<u8>,
    /// Whether the frame began with a marked byte and is not too long.
    sound: bool,
    stats: SpikerStats,
}

impl Decoder {
    /// A decoder for frames of `channels` channels.
    ///
    /// # Errors
    /// [`WireError::Setting`] unless there are 1 to 6.
    pub fn new(channels: usize) -> Result<Self, WireError> {
        if !(1..=6).contains(&channels) {
            return Err(WireError::Setting(OutOfRange::new("channels", channels as f64, "", "1 to 6")));
        }
        Ok(Self { channels, frame: Vec::new(), sound: false, stats: SpikerStats::default() })
    }

    /// Take the next bytes and give the frames they complete, as 10-bit values.
    pub fn feed(&mut self, data: &[u8]) -> Vec<Vec<u16>> {
        let mut frames = Vec::new();
        for &byte in data {
            if byte >= 0x80 {
                frames.extend(self.finish());
                self.frame.push(byte & 0x7F);
                self.sound = true;
            } else if self.sound && self.frame.len() < 2 * self.channels {
                self.frame.push(byte);
            } else {
                if self.sound {
                    self.drop_frame();
                }
                self.stats.skipped_bytes += 1;
            }
        }
        frames
    }

    /// Close the frame in progress.
    fn finish(&mut self) -> Option<Vec<u16>> {
        if !self.sound {
            return None;
        }
        let (pairs, _) = self.frame.as_chunks::<2>();
        if self.frame.len() < 2 * self.channels || pairs.iter().any(|&[high, _]| high > HIGH_MAX) {
            self.drop_frame();
            return None;
        }
        let values = pairs.iter().map(|&[high, low]| u16::from(high) << 7 | u16::from(low)).collect();
        self.stats.frames += 1;
        self.frame.clear();
        Some(values)
    }

    fn drop_frame(&mut self) {
        self.stats.bad_frames += 1;
        self.stats.skipped_bytes += self.frame.len() as u64;
        self.frame.clear();
        self.sound = false;
    }

    /// Counters since the start.
    pub fn stats(&self) -> SpikerStats {
        SpikerStats { pending_bytes: self.frame.len(), ..self.stats }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_of_the_wrong_length_is_refused_and_the_next_one_read() {
        let mut decoder = Decoder::new(3).unwrap();
        let good = [0x83, 0x7F, 0, 0x7F, 1, 0];
        // One byte short; one byte long, as after a lost start; then good.
        let stream = [&b"StartUp!"[..], &good[..5], &good, &[1], &good, &[0x80]].concat();
        assert_eq!(decoder.feed(&stream), [[511, 127, 128]]);
        let stats = decoder.stats();
        assert_eq!(
            (stats.frames, stats.bad_frames, stats.skipped_bytes, stats.pending_bytes),
            (1, 2, 8 + 5 + 7, 1)
        );
    }

    #[test]
    fn values_beyond_ten_bits_are_refused() {
        let mut decoder = Decoder::new(1).unwrap();
        assert_eq!(decoder.feed(&[0x88, 0, 0x87, 0x7F, 0x80]), [[1023]]);
        assert_eq!(decoder.stats().bad_frames, 1);
    }
}
