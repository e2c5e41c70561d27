//! Finding fixed-length frames with a header, an end byte and a counter in a stream of any bytes.
//!
//! A header and an end byte in the right places are no proof: a payload may hold both, at the same places in every
//! frame, and a scanner that starts inside it then never leaves. The rules here:
//!
//! 1. After a frame that does not hold, the search goes on at the byte behind its header, so that nothing which
//!    overlaps it is lost.
//! 2. A frame that follows an accepted one at once, with the next counter, is accepted.
//! 3. Otherwise it is accepted if no other header begins inside it: in a stream without holes, a false frame always
//!    has the true header inside.
//! 4. Otherwise every frame that begins inside it is followed for two more frames. The chain whose counter advances
//!    by one most often is the true one; chains that cannot be distinguished are dropped, never guessed.
//!
//! Each decision is taken as soon as, and only when, a fixed number of bytes is there, so it does not depend on how
//! the stream was cut.

use std::ops::RangeInclusive;

/// Shape of a frame.
#[derive(Debug, Clone)]
pub(crate) struct Shape {
    pub len: usize,
    pub header: &'static [u8],
    /// Where the 8-bit counter is.
    pub counter_at: usize,
    /// Allowed values of the last byte.
    pub end: RangeInclusive<u8>,
}

/// What a stream held so far. `received = len * frames + skipped + pending` at any time.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct StreamStats {
    /// Packets given out.
    pub packets: u64,
    /// Bytes that belong to no packet.
    pub skipped_bytes: u64,
    /// Packets missing by the counter, modulo 256 each time: a loss of exactly 256 is invisible, so compare with the
    /// elapsed time as well.
    pub missing_packets: u64,
    /// Bytes held back until more arrive.
    pub pending_bytes: usize,
}

#[derive(Debug, Clone)]
pub(crate) struct Framing {
    shape: Shape,
    pending: Vec<u8>,
    /// Counter of the last accepted frame.
    last: Option<u8>,
    /// Whether the next byte follows an accepted frame.
    contiguous: bool,
    stats: StreamStats,
}

enum Step {
    Wait,
    Skip(usize),
    Accept { counter: u8 },
}

/// Longest run of new bytes looked at at once; bounds what is held while a large chunk is fed.
const PIECE: usize = 4096;

impl Framing {
    pub fn new(shape: Shape) -> Self {
        Self { shape, pending: Vec::new(), last: None, contiguous: false, stats: StreamStats::default() }
    }

    pub fn stats(&self) -> StreamStats {
        StreamStats { pending_bytes: self.pending.len(), ..self.stats }
    }

    /// Take `data` and hand each frame, with the number of frames missing before it, to `accept`.
    pub fn feed(&mut self, data: &[u8], mut accept: impl FnMut(&[u8], u8)) {
        for piece in data.chunks(PIECE) {
            self.pending.extend_from_slice(piece);
            let mut at = 0;
            loop {
                let rest = self.pending.get(at..).unwrap_or_default();
                match self.step(rest) {
                    Step::Wait => break,
                    Step::Skip(n) => {
                        at += n;
                        self.stats.skipped_bytes += n as u64;
                        self.contiguous = false;
                    }
                    Step::Accept { counter } => {
                        let missing = self.last.map_or(0, |last| counter.wrapping_sub(last).wrapping_sub(1));
                        accept(rest.get(..self.shape.len).unwrap_or_default(), missing);
                        at += self.shape.len;
                        self.stats.packets += 1;
                        self.stats.missing_packets += u64::from(missing);
                        self.last = Some(counter);
                        self.contiguous = true;
                    }
                }
            }
            self.pending.drain(..at);
        }
    }

    fn step(&self, rest: &[u8]) -> Step {
        let Shape { len, header, counter_at, .. } = self.shape;
        let Some(start) = rest.iter().position(|byte| header.first() == Some(byte)) else {
            return if rest.is_empty() { Step::Wait } else { Step::Skip(rest.len()) };
        };
        if start > 0 {
            return Step::Skip(start);
        }
        if !begins(rest, header) {
            return Step::Skip(1);
        }
        if rest.len() < len {
            return Step::Wait;
        }
        let Some(&counter) = rest.get(counter_at).filter(|_| self.framed(rest, 0)) else {
            return Step::Skip(1);
        };
        if self.contiguous && self.last.map(|last| last.wrapping_add(1)) == Some(counter) {
            return Step::Accept { counter };
        }
        let frame = rest.get(..len).unwrap_or_default();
        if !(1..len).any(|at| begins(frame.get(at..).unwrap_or_default(), header)) {
            return Step::Accept { counter };
        }
        if rest.len() < 2 * len - 1 {
            return Step::Wait;
        }
        let mut rivals = (1..len).filter(|&at| self.framed(rest, at)).peekable();
        if rivals.peek().is_none() {
            return Step::Accept { counter };
        }
        if rest.len() < 4 * len - 1 {
            return Step::Wait;
        }
        let own = self.chain(rest, 0);
        match rivals.map(|at| self.chain(rest, at)).max() {
            Some(best) if best > own || (best == own && own.0 == 0) => Step::Skip(1),
            _ => Step::Accept { counter },
        }
    }

    /// Whether a header is at `at`, and an end byte where its frame ends.
    fn framed(&self, rest: &[u8], at: usize) -> bool {
        let end = rest.get(at + self.shape.len - 1);
        rest.get(at..).is_some_and(|rest| rest.starts_with(self.shape.header))
            && end.is_some_and(|end| self.shape.end.contains(end))
    }

    /// Of the two frames that follow the one at `at`: how many counters advance by one, how many frames there are.
    fn chain(&self, rest: &[u8], at: usize) -> (u8, u8) {
        let mut score = (0, 0);
        for before in [at, at + self.shape.len] {
            let after = before + self.shape.len;
            if !self.framed(rest, after) {
                break;
            }
            score.1 += 1;
            let counter = |at: usize| rest.get(at + self.shape.counter_at).copied().unwrap_or_default();
            score.0 += u8::from(counter(after) == counter(before).wrapping_add(1));
        }
        score
    }
}

/// Whether as much of `header` as there is room for is at the start of `bytes`.
fn begins(bytes: &[u8], header: &[u8]) -> bool {
    !bytes.is_empty() && bytes.iter().zip(header).all(|(a, b)| a == b)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shape() -> Shape {
        Shape { len: 5, header: &[0xA0], counter_at: 1, end: 0xC0..=0xC6 }
    }

    fn counters(stream: &[u8]) -> (Vec<u8>, StreamStats) {
        let (mut framing, mut found) = (Framing::new(shape()), vec![]);
        framing.feed(stream, |frame, _| found.push(frame[1]));
        (found, framing.stats())
    }

    #[test]
    fn a_lone_frame_without_a_rival_comes_at_once() {
        assert_eq!(counters(&[0xA0, 7, 0, 0, 0xC0]).0, [7]);
    }

    #[test]
    fn a_header_inside_waits_for_what_follows() {
        let frame = [0xA0, 7, 0xA0, 0, 0xC0];
        assert_eq!(counters(&frame).0, [0_u8; 0]);
        assert_eq!(counters(&[&frame[..], &[0xA0, 9, 0, 0, 0xC0]].concat()).0, [7, 9]);
    }

    #[test]
    fn chains_that_look_alike_are_dropped() {
        let (found, stats) = counters(&[0xA0, 9, 0xC0, 0xA0, 0xC0].repeat(20));
        assert!(found.is_empty(), "{found:?}");
        assert!(stats.pending_bytes < 20);
    }

    #[test]
    fn a_large_chunk_is_not_kept() {
        let mut framing = Framing::new(shape());
        framing.feed(&vec![0xA0; 100_000], |_, _| ());
        assert!(framing.pending.capacity() <= 4 * PIECE);
        assert!(framing.stats().pending_bytes < 20);
    }
}
