//! What stands at the other end of the link.

use tega_hand::CLOSURE_POSES_RAD;
use tega_wire::allegro::{CanFrame, Scale, angle_counts};

/// It answers, reports every 3 ms once told to, and moves to where its duty drives it.
pub struct Hand {
    pub hardware: u16,
    pub side: u8,
    pub status: u8,
    pub joint_c: u8,
    pub index_c: Option<u8>,
    pub missing_heat: Option<u32>,
    pub serial: u8,
    pub mute_info: bool,
    pub reports_temperature: bool,
    pub missing_finger: Option<usize>,
    pub mute: bool,
    pub twice: bool,
    pub every_ms: i64,
    pub angles: [f64; 16],
    pub moves: bool,
    pub servo_on: bool,
    pub told: bool,
    pub duties: [i16; 16],
}

impl Default for Hand {
    fn default() -> Self {
        Self {
            hardware: 0x0402,
            side: 0,
            status: 0,
            joint_c: 40,
            index_c: None,
            missing_heat: None,
            serial: b'R',
            mute_info: false,
            reports_temperature: true,
            missing_finger: None,
            mute: false,
            twice: false,
            every_ms: 3,
            angles: CLOSURE_POSES_RAD[0],
            moves: true,
            servo_on: false,
            told: false,
            duties: [0; 16],
        }
    }
}

/// Identifier and data of a frame.
pub type Owned = (u32, Vec<u8>);

impl Hand {
    pub fn hear(&mut self, frames: &[CanFrame]) -> Vec<Owned> {
        let mut out = Vec::new();
        for frame in frames {
            match (frame.id(), frame.is_remote()) {
                (0x200, true) if self.mute_info => {}
                (0x200, true) => {
                    let [h0, h1] = self.hardware.to_le_bytes();
                    let status = self.status | u8::from(self.servo_on);
                    out.push((0x200, vec![h0, h1, 6, 4, self.side, 50, status]));
                }
                (0x220, true) => out.push((0x220, vec![b'A', b'0', b'8', b'0', self.serial, 0, 0, 0])),
                (id @ (0xE0 | 0xE4 | 0xE8 | 0xEC), true) if self.missing_heat.is_none() => {
                    out.push((u32::from(id), vec![self.joint_c; 4]));
                }
                (0xE0..=0xEC, true) => {}
                (0x100, false) => self.servo_on = true,
                (0x104, false) => self.servo_on = false,
                (0x204, false) => self.told = frame.data()[0] == 3,
                (id @ 0x180..=0x18C, false) => {
                    for (j, bytes) in frame.data().chunks(2).enumerate() {
                        self.duties[usize::from(id - 0x180) + j] = i16::from_le_bytes([bytes[0], bytes[1]]);
                    }
                }
                other => panic!("not expected on the bus: {other:?}"),
            }
        }
        if self.mute { Vec::new() } else { out }
    }

    pub fn report(&mut self, t_ms: i64) -> Vec<Owned> {
        if !self.told || self.mute {
            return Vec::new();
        }
        let mut out = Vec::new();
        if t_ms % self.every_ms == 0 {
            for (angle, duty) in self.angles.iter_mut().zip(self.duties) {
                if self.servo_on && self.moves {
                    *angle += 0.003 * 9.52 * f64::from(duty) / 1200.0;
                }
            }
            for finger in (0..4).filter(|&f| self.missing_finger != Some(f)) {
                let counts = |j: usize| angle_counts(self.angles[4 * finger + j], Scale::V4).unwrap();
                let data = (0..4).flat_map(|j| counts(j).to_le_bytes()).collect();
                let frame: Owned = (0x80 + 4 * finger as u32, data);
                out.extend(std::iter::repeat_n(frame, if self.twice { 2 } else { 1 }));
            }
        }
        if self.reports_temperature && t_ms % 500 == 0 {
            let index_c = self.index_c.unwrap_or(self.joint_c);
            for f in (0..4).filter(|&f| self.missing_heat != Some(f)) {
                let others = if f == 0 { index_c } else { self.joint_c };
                out.push((0xE0 + 4 * f, vec![self.joint_c, others, others, others]));
            }
        }
        out
    }
}
