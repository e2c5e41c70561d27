//! Lines of decimal numbers, one sample a line, as Arduino sketches print them.
//!
//! Fields are separated by `,` or `;`, with blanks or tabs around them or alone; one separator may trail. A field is
//! a decimal number, with a point and an exponent if it likes, or `name:number`. The number of fields is fixed:
//! `leading` ones, such as a time stamp, which are read and dropped, then the channels. Any other line is refused and
//! counted. What comes before the first line break is dropped, since a port is rarely opened between two lines.

use tega_error::OutOfRange;

use crate::WireError;

/// Longest line accepted, in bytes; a longer one is refused whole.
pub const LINE_MAX: usize = 256;

/// What a stream held so far.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct AsciiStats {
    /// Lines accepted.
    pub lines: u64,
    /// Lines refused.
    pub rejected_lines: u64,
    /// Bytes dropped before the first line break.
    pub dropped_bytes: u64,
    /// Bytes of the line in progress.
    pub pending_bytes: usize,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    /// Before the first line break.
    Unsynced,
    Line,
    /// In a line that is too long already.
    Overlong,
}

/// Finds samples in a stream of any bytes.
///
/// ```
/// let mut decoder = tega_wire::ascii::Decoder::new(3, 0, true)?;
/// let samples = decoder.feed(b"48.0\r\n512,510.5,-9.25E-4,\r\nch1:1 ch2:2 ch3:3\n");
/// assert_eq!(samples, [512.0, 510.5, -9.25e-4, 1.0, 2.0, 3.0]);
/// # Ok::<(), tega_wire::WireError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Decoder {
    channels: usize,
    leading: usize,
    state: State,
    line: Vec<u8>,
    last_rejected: Vec<u8>,
    stats: AsciiStats,
}

impl Decoder {
    /// A decoder for lines of `leading + channels` numbers. With `drop_first` the bytes up to the first line break are
    /// dropped; without, the stream begins with a whole line, as a file does.
    ///
    /// # Errors
    /// [`WireError::Setting`] unless there are 1 to 64 channels and at most 64 leading fields.
    pub fn new(channels: usize, leading: usize, drop_first: bool) -> Result<Self, WireError> {
        if !(1..=64).contains(&channels) {
            return Err(WireError::Setting(OutOfRange::new("channels", channels as f64, "", "1 to 64")));
        }
        if leading > 64 {
            return Err(WireError::Setting(OutOfRange::new("leading", leading as f64, "", "0 to 64")));
        }
        let state = if drop_first { State::Unsynced } else { State::Line };
        let (line, last_rejected, stats) = (Vec::new(), Vec::new(), AsciiStats::default());
        Ok(Self { channels, leading, state, line, last_rejected, stats })
    }

    /// Channels per sample.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Take the next bytes and give the samples they complete, channel by channel.
    pub fn feed(&mut self, data: &[u8]) -> Vec<f64> {
        let mut samples = Vec::new();
        for &byte in data {
            match (self.state, byte) {
                (State::Unsynced, _) => {
                    self.stats.dropped_bytes += 1;
                    if byte == b'\n' {
                        self.state = State::Line;
                    }
                }
                (_, b'\n') => {
                    let whole = self.state == State::Line;
                    self.end_line(whole, &mut samples);
                }
                (State::Line, _) if self.line.len() < LINE_MAX => self.line.push(byte),
                (State::Line | State::Overlong, _) => self.state = State::Overlong,
            }
        }
        samples
    }

    fn end_line(&mut self, whole: bool, samples: &mut Vec<f64>) {
        let before = samples.len();
        let read = if whole { parse(&self.line, self.leading, samples) } else { None };
        if read == Some(self.channels) {
            self.stats.lines += 1;
        } else {
            samples.truncate(before);
            self.stats.rejected_lines += 1;
            self.last_rejected.clone_from(&self.line);
        }
        self.line.clear();
        self.state = State::Line;
    }

    /// The line refused last, cut to [`LINE_MAX`] bytes: often a banner or an error text of the board.
    pub fn last_rejected(&self) -> &[u8] {
        &self.last_rejected
    }

    /// Counters since the start.
    pub fn stats(&self) -> AsciiStats {
        AsciiStats { pending_bytes: self.line.len(), ..self.stats }
    }
}

/// Read a line's fields behind the `leading` ones into `samples`; how many there were, or nothing for a bad line.
fn parse(line: &[u8], leading: usize, samples: &mut Vec<f64>) -> Option<usize> {
    let mut rest = line.trim_ascii();
    let mut fields = 0;
    while !rest.is_empty() {
        if let Some(named) = skip_name(rest) {
            rest = named;
        }
        let end = rest.iter().position(|&byte| is_separator(byte)).unwrap_or(rest.len());
        let (field, tail) = rest.split_at_checked(end)?;
        let value = number(field)?;
        if fields >= leading {
            samples.push(value);
        }
        fields += 1;
        // Blanks, at most one comma or semicolon, blanks.
        let tail = tail.trim_ascii_start();
        rest = tail.strip_prefix(b",").or_else(|| tail.strip_prefix(b";")).unwrap_or(tail).trim_ascii_start();
    }
    fields.checked_sub(leading)
}

fn is_separator(byte: u8) -> bool {
    matches!(byte, b',' | b';' | b'\t' | b' ')
}

/// What follows `name:` at the start of `rest`, and blanks; nothing if there is no name.
fn skip_name(rest: &[u8]) -> Option<&[u8]> {
    let end = rest.iter().position(|&byte| byte == b':' || !byte.is_ascii_graphic() || is_separator(byte))?;
    let (name, tail) = rest.split_at_checked(end)?;
    let tail = tail.strip_prefix(b":")?;
    (!name.is_empty()).then(|| tail.trim_ascii_start())
}

/// A decimal number; neither "nan" nor "inf", nor one too large for double precision.
fn number(field: &[u8]) -> Option<f64> {
    let decimal = |byte: &u8| matches!(byte, b'0'..=b'9' | b'+' | b'-' | b'.' | b'e' | b'E');
    if !field.iter().all(decimal) {
        return None;
    }
    std::str::from_utf8(field).ok()?.parse::<f64>().ok().filter(|value| value.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(line: &str) -> Option<Vec<f64>> {
        let mut decoder = Decoder::new(3, 0, false).unwrap();
        let samples = decoder.feed(format!("{line}\n").as_bytes());
        (decoder.stats().rejected_lines == 0).then_some(samples)
    }

    #[test]
    fn shapes_seen_in_the_wild_are_read() {
        let plain = ["1,2,3", "1,2,3\r", "1;2;3;", "1\t2\t3", "1 2 3", "\r1,2,3"];
        let odd = [" 1 ,  2 ;\t3 , ", "a:1,b:2,c:3", "a: 1 b: 2 c: 3", "+1,2.,3.0e0", "10E-1,.2e1,0003"];
        for line in plain.into_iter().chain(odd) {
            assert_eq!(read(line), Some(vec![1.0, 2.0, 3.0]), "{line:?}");
        }
        assert_eq!(read("2048.0,2066.0,-9.25E-4,"), Some(vec![2048.0, 2066.0, -9.25e-4]));
    }

    #[test]
    fn anything_else_is_refused() {
        let short = [
            "", "\r", "1,2", "1,2,3,4", ",1,2,3", "1,,2,3", "1,2,3,,", "1,2,nan", "1,2,inf", "1,2,0x3",
            "1,2,", "a:,2,3", ":1,2,3", "1,2,--3", "1,2,e", "1,2,.", "MyoWare", "1,2,３",
        ];
        let long = ["1,2,3e999", "1,2,3 mV", "1,2,3,label", "1 000,2,3", "a:b:1,2,3"];
        for line in short.into_iter().chain(long) {
            assert_eq!(read(line), None, "{line:?}");
        }
    }

    #[test]
    fn leading_fields_are_read_and_dropped() {
        let mut decoder = Decoder::new(2, 1, true).unwrap();
        assert_eq!(decoder.feed(b"\n1234567,5,6\nx,5,6\n5,6\n"), [5.0, 6.0]);
        assert_eq!((decoder.stats().lines, decoder.stats().rejected_lines), (1, 2));
        assert_eq!(decoder.last_rejected(), b"5,6");
    }

    #[test]
    fn a_line_without_end_is_not_kept() {
        let mut decoder = Decoder::new(1, 0, false).unwrap();
        assert!(decoder.feed(&[b'1'; 10_000]).is_empty());
        assert_eq!(decoder.stats().pending_bytes, LINE_MAX);
        assert_eq!(decoder.feed(b"\n7\n"), [7.0]);
        assert_eq!(decoder.stats().rejected_lines, 1);
    }

    #[test]
    fn a_channel_or_a_field_too_many_to_ask_for() {
        assert!(Decoder::new(0, 0, true).is_err());
        assert!(Decoder::new(65, 0, true).is_err());
        assert!(Decoder::new(1, 65, true).is_err());
    }
}
