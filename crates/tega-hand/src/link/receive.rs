//! What a frame from the bus changes.

use tega_wire::allegro::{Command, Finger, Info, Message, Received, Rejection, Report, decode};

use super::{HandLink, MS, Phase, RELEASE_NS, Still};
use crate::Asked;
use crate::fault::Fault;
use crate::joints::{JOINT_LIMITS_RAD, JOINT_NAMES, JOINTS, Joints};
use crate::sets::{HELD_NS, Taken};

/// Real hands were recorded up to 0.18 rad outside the printed limits.
const PLAUSIBLE_RAD: f64 = 0.25;
/// Further in one cycle than ten times the fastest joint.
const JUMP_RAD: f64 = 0.3;
/// A jump counts two and a set without one takes one off: ten in a row are too many, and so is every other one.
const TOO_JUMPY: u32 = 20;
/// After so many sets since the motors were reported off they are not off because the hand was let go.
const OFF_SETS: u64 = 34;
/// Still to the last count for this long, while the target moved this far, is not a hand that is blocked.
const STILL_NS: i64 = 300 * MS;
const MOVED_RAD: f64 = 0.15;

impl HandLink {
    pub(super) fn take(&mut self, frame: &Received<'_>, t_ns: i64, asked: Asked) -> Option<Joints> {
        match decode(frame, self.settings.device) {
            Ok(Message::Report(report)) => return self.report(report, t_ns, asked),
            Ok(Message::Command(Command::SetTorque { .. } | Command::ServoOn)) => {
                self.fail(Fault::ForeignHost { id: frame.id }, t_ns);
            }
            Err(Rejection::Malformed) => self.counts.malformed += 1,
            Err(Rejection::Unknown) => self.counts.unknown += 1,
            Ok(_) | Err(_) => self.counts.others += 1,
        }
        None
    }

    fn report(&mut self, report: Report, t_ns: i64, asked: Asked) -> Option<Joints> {
        match report {
            Report::Position { finger, counts } => return self.position(finger, counts, t_ns, asked),
            Report::Temperature { finger, bytes } => {
                self.heat.take(finger, bytes, t_ns);
                if let Some((joint, temperature_c)) = self.heat.too_hot().filter(|_| self.steers()) {
                    self.fail(Fault::TooHot { joint, temperature_c }, t_ns);
                }
            }
            Report::Info(info) => self.identify(info, t_ns),
            Report::Serial(serial) => self.recognise(serial, t_ns),
            Report::Imu(_) | Report::Status(_) => {}
        }
        None
    }

    fn identify(&mut self, info: Info, t_ns: i64) {
        if matches!(self.phase, Phase::Listening | Phase::Stopped | Phase::Faulted) {
            return;
        }
        let said = match info.side {
            0 => "right",
            1 => "left",
            _ => "neither right nor left",
        };
        let wanted = if self.settings.left { "left" } else { "right" };
        self.heat.take_status(info.must_warn(), t_ns);
        if self.phase == Phase::Identifying {
            // Until it is known to be the hand that was meant, again after every silence.
            self.info = None;
        }
        if info.major() != 4 {
            self.fail(Fault::WrongVersion { hardware: info.hardware, firmware: info.firmware }, t_ns);
        } else if said != wanted {
            self.fail(Fault::WrongSide { said, wanted }, t_ns);
        } else if info.must_stop() && self.settings.torque {
            self.info = Some(info);
            self.fail(Fault::Reported { status: info.status, palm_c: info.palm_c }, t_ns);
        } else {
            self.info = Some(info);
            self.watch_motors(info.servo_on());
            if self.phase == Phase::Identifying {
                self.enter(Phase::Checking, t_ns);
            }
        }
    }

    /// Notes whether the motors are off that were on. A hand that goes on reporting positions then was not let go by
    /// this side or its guard.
    fn watch_motors(&mut self, on: bool) {
        if on || !self.motors_on {
            self.motors_on = on && self.settings.torque && self.phase == Phase::Running;
            self.off_sets = None;
        } else {
            self.off_sets.get_or_insert(self.counts.sets);
        }
    }

    /// Another hand on the same bus is not steered by what was found out of the first.
    fn recognise(&mut self, serial: [u8; 8], t_ns: i64) {
        if self.serial == [0; 8] || self.serial == serial {
            self.serial = serial;
        } else {
            self.fail(Fault::OtherHand, t_ns);
        }
    }

    fn position(&mut self, finger: Finger, counts: [i16; 4], t_ns: i64, asked: Asked) -> Option<Joints> {
        if !matches!(self.phase, Phase::Checking | Phase::Running | Phase::Releasing) {
            return None;
        }
        let taken = self.sets.take(finger, counts, t_ns);
        (self.counts.copies, self.counts.incomplete) = (self.sets.n_copies, self.sets.n_incomplete);
        if matches!(taken, Taken::Partly | Taken::Unusable) {
            return None;
        }
        let angles = self.sets.angles_rad();
        if !self.plausible(&angles, t_ns) {
            return None;
        }
        self.angles_rad = Some(angles);
        self.counts.sets += 1;
        self.last_set_ns = t_ns;
        self.late = false;
        if self.off_sets.is_some_and(|off| self.counts.sets - off > OFF_SETS) {
            self.fail(Fault::MotorsOff, t_ns);
            return None;
        }
        if self.phase == Phase::Checking {
            if self.n_checked == 0 {
                self.first_set_ns = t_ns;
            }
            self.n_checked += 1;
            return None;
        }
        if !self.settings.torque || self.frozen(t_ns) {
            return None;
        }
        let share = match (self.phase, self.since_ns) {
            (Phase::Releasing, Some(since)) => (1.0 - (t_ns - since) as f64 / RELEASE_NS as f64).max(0.0),
            _ => 1.0,
        };
        // Who lets go adds nothing.
        let asked = if self.phase == Phase::Releasing { asked.level.into() } else { asked };
        let share = share * self.heat.share(t_ns);
        // What is asked was checked, and no sixteen bits make an angle that is refused.
        self.torques = self.controller.step_within(share, &angles, asked, None).unwrap_or([0.0; JOINTS]);
        Some(self.torques)
    }

    /// Whether these angles can be a hand's, right after the last ones.
    fn plausible(&mut self, angles: &Joints, t_ns: i64) -> bool {
        let outside = |(j, angle): (usize, &f64)| {
            let (low, high) = JOINT_LIMITS_RAD[j];
            !(low - PLAUSIBLE_RAD..=high + PLAUSIBLE_RAD).contains(angle)
        };
        if self.phase == Phase::Checking
            && let Some(j) = angles.iter().enumerate().position(outside)
        {
            self.fail(Fault::Angle { joint: JOINT_NAMES[j], angle_rad: angles[j] }, t_ns);
            return false;
        }
        let Some(last) = self.angles_rad.filter(|_| t_ns - self.last_set_ns <= HELD_NS) else { return true };
        let jumped = (0..JOINTS).find(|&j| (angles[j] - last[j]).abs() > JUMP_RAD);
        let Some(j) = jumped else {
            self.jumpiness = self.jumpiness.saturating_sub(1);
            return true;
        };
        self.counts.jumps += 1;
        self.jumpiness += 2;
        // The hand does answer, so it is not silent.
        self.last_set_ns = t_ns;
        if self.jumpiness >= TOO_JUMPY {
            self.fail(Fault::Jumping { joint: JOINT_NAMES[j], jump_rad: angles[j] - last[j] }, t_ns);
        }
        false
    }

    fn frozen(&mut self, t_ns: i64) -> bool {
        let counts = self.sets.counts();
        let target_rad = self.controller.target_rad().unwrap_or_default();
        let Some(still) = self.still.filter(|still| still.counts == counts) else {
            self.still = Some(Still { counts, since_ns: t_ns, target_rad });
            return false;
        };
        let moved = target_rad.iter().zip(still.target_rad).any(|(now, then)| (now - then).abs() > MOVED_RAD);
        let frozen = moved && t_ns - still.since_ns > STILL_NS;
        if frozen {
            self.fail(Fault::Frozen { still_s: (t_ns - still.since_ns) as f64 * 1e-9 }, t_ns);
        }
        frozen
    }
}
