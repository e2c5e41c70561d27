//! The whole conversation with a hand on a bus, without a bus and without a clock: received frames and the time go
//! in, frames to send come out.
//!
//! Nothing but a request is sent before the hand has said that it is the one that was meant. Torques answer complete
//! sets of positions, so the hand's own 3 ms are the clock. Whatever ends the conversation ends it with zero torque and
//! SERVO OFF, since some firmware is said to ignore the latter.

mod receive;
mod send;

use tega_wire::allegro::{CanFrame, DeviceId, Info, Received, Scale, torque_frames};

use crate::fault::Fault;
use crate::heat::Heat;
use crate::joints::{JOINTS, Joints};
use crate::sets::PositionSets;
use crate::{Asked, HandController, HandError};

/// A millisecond.
const MS: i64 = 1_000_000;
/// The torque limits go to zero within this time.
const RELEASE_NS: i64 = 200 * MS;
/// Zero torque and SERVO OFF are sent so often.
const LIMP_TIMES: u32 = 3;

/// How a link treats its hand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinkSettings {
    /// The hand's number on the bus.
    pub device: DeviceId,
    /// Whether a left hand is meant.
    pub left: bool,
    /// Whether to switch the motors on; without it the hand is only read.
    pub torque: bool,
    /// Without a set of positions for so long the motors go off, in nanoseconds.
    pub silent_after_ns: i64,
    /// Sets of positions a second that are needed.
    pub lowest_rate_hz: f64,
    /// How often a silent hand is looked for again.
    pub reconnects: u32,
}

impl Default for LinkSettings {
    fn default() -> Self {
        let device = DeviceId::FACTORY;
        let (silent_after_ns, lowest_rate_hz) = (30 * MS, 250.0);
        Self { device, left: false, torque: true, silent_after_ns, lowest_rate_hz, reconnects: 5 }
    }
}

/// Where the conversation stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// Is another program on the bus?
    Listening,
    /// Asking for version and side.
    Identifying,
    /// Looking at the first sets of positions.
    Checking,
    /// Torques, or reading only.
    Running,
    /// The hand is silent; waiting to look for it again.
    Silent,
    /// The torque limits go to zero.
    Releasing,
    /// Let go, because it was asked for.
    Stopped,
    /// Let go, because of a [`Fault`].
    Faulted,
}

/// What happened so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// Sets of positions used.
    pub sets: u64,
    /// Sets in which a finger's frame was missing.
    pub incomplete: u64,
    /// Frames that came twice.
    pub copies: u64,
    /// Gaps of more than 9 ms, in which the last torque was held.
    pub late: u64,
    /// Times the hand fell silent and the motors went off.
    pub silences: u64,
    /// Sets not used since a joint jumped.
    pub jumps: u64,
    /// Known messages of the wrong length.
    pub malformed: u64,
    /// Frames of the hand's kind that are no message it has.
    pub unknown: u64,
    /// Error frames, requests, and other devices' frames.
    pub others: u64,
}

/// A conversation with one hand.
#[derive(Debug, Clone, PartialEq)]
pub struct HandLink {
    settings: LinkSettings,
    controller: HandController,
    phase: Phase,
    fault: Option<Fault>,
    /// When this phase began, and when its next frame is due.
    since_ns: Option<i64>,
    due_ns: i64,
    tries: u32,
    attempts: u32,
    sets: PositionSets,
    heat: Heat,
    info: Option<Info>,
    /// Whether the hand has confirmed, in this phase, that its motors are on.
    motors_on: bool,
    /// Sets counted when they were reported off after that.
    off_sets: Option<u64>,
    serial: [u8; 8],
    angles_rad: Option<Joints>,
    torques: Joints,
    counts: Counts,
    first_set_ns: i64,
    last_set_ns: i64,
    n_checked: u32,
    late: bool,
    jumpiness: u32,
    still: Option<Still>,
    info_due_ns: i64,
    /// When the rate was looked at last, and the number of sets then; later by each standstill of this side.
    rated: (i64, u64),
    exchanged_ns: i64,
    poll_due_ns: i64,
}

/// Since when, and at which target, the counts have stood still.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Still {
    counts: [[i16; 4]; 4],
    since_ns: i64,
    target_rad: Joints,
}

impl HandLink {
    /// A link that has not begun; the first [`exchange`](Self::exchange) does.
    pub fn new(settings: LinkSettings, controller: HandController) -> Self {
        Self {
            settings,
            controller,
            phase: Phase::Listening,
            fault: None,
            since_ns: None,
            due_ns: 0,
            tries: 0,
            attempts: 0,
            sets: PositionSets::default(),
            heat: Heat::default(),
            info: None,
            motors_on: false,
            off_sets: None,
            serial: [0; 8],
            angles_rad: None,
            torques: [0.0; JOINTS],
            counts: Counts::default(),
            first_set_ns: 0,
            last_set_ns: 0,
            n_checked: 0,
            late: false,
            jumpiness: 0,
            still: None,
            info_due_ns: 0,
            rated: (0, 0),
            exchanged_ns: 0,
            poll_due_ns: 0,
        }
    }

    /// Take what was received and return what is to be sent, in order; call it at least every few milliseconds.
    ///
    /// `t_ns` is the time of any clock that never goes back. Of several sets of positions in one call each is a cycle of
    /// the controller, and only the last one's torques are sent.
    ///
    /// # Errors
    /// A level outside 1 to 5, or an addition that is out of range; nothing has changed then.
    pub fn exchange(
        &mut self,
        frames: &[Received<'_>],
        t_ns: i64,
        asked: impl Into<Asked>,
    ) -> Result<Vec<CanFrame>, HandError> {
        let asked = asked.into().check()?;
        self.since_ns.get_or_insert(t_ns);
        let mut out = Vec::new();
        let mut torques = None;
        let (stood_ns, sets) = (t_ns - self.exchanged_ns, self.counts.sets);
        self.exchanged_ns = t_ns;
        for frame in frames {
            if let Some(computed) = self.take(frame, t_ns, asked) {
                torques = Some(computed);
            }
        }
        if stood_ns > self.settings.silent_after_ns {
            // An adapter keeps some frames of that time and loses the others, which says nothing of the hand's rate.
            self.rated = (self.rated.0 + stood_ns, self.rated.1 + self.counts.sets - sets);
        }
        if let Some(torques) = torques.filter(|_| matches!(self.phase, Phase::Running | Phase::Releasing)) {
            out.extend(torque_frames(&torques, self.settings.device, Scale::V4).into_iter().flatten());
        }
        self.advance(t_ns, &mut out);
        Ok(out)
    }

    /// Let go of the hand: the torque limits go to zero within 0.2 s, then the motors go off.
    pub fn release(&mut self, t_ns: i64) {
        if matches!(self.phase, Phase::Running) && self.settings.torque {
            self.enter(Phase::Releasing, t_ns);
        } else if !matches!(self.phase, Phase::Faulted | Phase::Releasing | Phase::Stopped) {
            self.enter(Phase::Stopped, t_ns);
        }
    }

    /// The frames that leave the hand without force and silent, whatever the phase: for the last way out. None
    /// where no hand has said that it is the one that was meant.
    pub fn abandon(&self) -> Vec<CanFrame> {
        if self.info.is_none() {
            return Vec::new();
        }
        let mut out = self.limp();
        out.push(self.period(0, 0));
        out
    }

    fn fail(&mut self, fault: Fault, t_ns: i64) {
        if !matches!(self.phase, Phase::Faulted | Phase::Stopped) {
            self.fault = Some(fault);
            self.enter(Phase::Faulted, t_ns);
        }
    }

    fn enter(&mut self, phase: Phase, t_ns: i64) {
        (self.phase, self.motors_on, self.off_sets) = (phase, false, None);
        self.since_ns = Some(t_ns);
        if phase == Phase::Checking {
            // `tries` stays above zero until the hand has been sent what to report.
            self.sets.restart();
            (self.n_checked, self.jumpiness, self.late, self.still) = (0, 0, false, None);
            self.angles_rad = None;
            (self.first_set_ns, self.last_set_ns) = (t_ns, t_ns);
        } else {
            self.tries = 0;
        }
        if !matches!(phase, Phase::Running | Phase::Releasing) {
            self.torques = [0.0; JOINTS];
        }
        self.due_ns = t_ns;
    }

    /// Where the conversation stands.
    pub const fn phase(&self) -> Phase {
        self.phase
    }

    /// Whether the hand was let go on request and all that was to be said is said.
    pub const fn released(&self) -> bool {
        matches!(self.phase, Phase::Stopped) && self.tries >= LIMP_TIMES
    }

    /// Why it was given up.
    pub const fn fault(&self) -> Option<&Fault> {
        self.fault.as_ref()
    }

    /// The last joint angles used; none before the first set.
    pub const fn angles_rad(&self) -> Option<&Joints> {
        self.angles_rad.as_ref()
    }

    /// Joint targets of the last cycle.
    pub fn target_rad(&self) -> Option<Joints> {
        self.controller.target_rad()
    }

    /// The last torques, in units of full duty.
    pub const fn torques(&self) -> &Joints {
        &self.torques
    }

    /// What the hand said of itself last.
    pub const fn info(&self) -> Option<&Info> {
        self.info.as_ref()
    }

    /// The serial number's characters, zeros where it is not known.
    pub const fn serial(&self) -> &[u8; 8] {
        &self.serial
    }

    /// Joint temperatures, °C; none where a sensor does not answer.
    pub const fn joints_c(&self) -> &[Option<u8>; JOINTS] {
        &self.heat.joints_c
    }

    /// Share of the torque limits that the temperature leaves at a time.
    pub fn heat_share(&self, t_ns: i64) -> f64 {
        self.heat.share(t_ns)
    }

    /// What happened so far.
    pub const fn counts(&self) -> Counts {
        self.counts
    }
}
