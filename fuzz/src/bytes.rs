//! A fuzzer's bytes, and what all properties share.

/// A property: its name, which is also its folder of seeds, and its body.
pub type Target = (&'static str, fn(&[u8]));

/// The first bytes of `data`, zero where there are none, and the rest.
pub fn head<const N: usize>(data: &[u8]) -> ([u8; N], &[u8]) {
    let mut head = [0; N];
    head.iter_mut().zip(data).for_each(|(to, from)| *to = *from);
    (head, data.get(N..).unwrap_or_default())
}

/// Bytes taken from the front; past the end there are zeros.
pub struct Bytes<'a>(pub &'a [u8]);

impl Bytes<'_> {
    pub fn take<const N: usize>(&mut self) -> [u8; N] {
        let (head, rest) = head(self.0);
        self.0 = rest;
        head
    }

    pub fn byte(&mut self) -> u8 {
        let [byte] = self.take();
        byte
    }

    pub fn word(&mut self) -> u16 {
        u16::from_le_bytes(self.take())
    }

    pub fn long(&mut self) -> i64 {
        i64::from_le_bytes(self.take())
    }

    /// A number from 0 to `most`, which is under 65,536.
    pub fn up_to(&mut self, most: usize) -> usize {
        if most < 256 { usize::from(self.byte()) % (most + 1) } else { usize::from(self.word()) % (most + 1) }
    }

    pub fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.up_to(from.len() - 1)]
    }

    pub fn flag(&mut self) -> bool {
        self.byte() & 1 != 0
    }
}

/// The IEEE polynomial, bit by bit: the checksum's own oracle.
pub fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, &byte| {
        (0..8).fold(
            crc ^ u32::from(byte),
            |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xEDB8_8320 } else { crc >> 1 },
        )
    })
}
