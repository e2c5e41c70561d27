//! What is sent as time goes by.

use tega_wire::allegro::{CanFrame, Command, Finger, Request, Scale, torque_frames};

use super::{HandLink, LIMP_TIMES, MS, Phase, RELEASE_NS};
use crate::fault::Fault;
use crate::joints::JOINTS;
use crate::sets::HELD_NS;

/// Listening for another program before anything is sent.
const LISTEN_NS: i64 = 50 * MS;
/// Requests for the version: so many, so far apart.
const TRIES: u32 = 20;
const TRY_NS: i64 = 10 * MS;
/// Sets of positions that are looked at before the motors go on, and how long they may take.
const CHECKED_SETS: u32 = 34;
const CHECK_NS: i64 = 1_000 * MS;
const POSITION_MS: u16 = 3;
const TEMPERATURE_MS: u16 = 500;
/// Without periodic temperatures for so long they are asked for, this often.
const POLL_AFTER_NS: i64 = 2_000 * MS;
const POLL_NS: i64 = 500 * MS;
/// The status is asked for this often.
const INFO_NS: i64 = 1_000 * MS;
/// So long sets of positions are counted before their rate is judged.
const RATED_NS: i64 = 1_000 * MS;
/// Rest before a silent hand is looked for again.
const RETRY_NS: i64 = 1_000 * MS;
/// Zero torque and SERVO OFF are sent so far apart, after a fault on and on.
const LIMP_NS: i64 = 5 * MS;
const LIMP_AGAIN_NS: i64 = 100 * MS;

impl HandLink {
    pub(super) fn advance(&mut self, t_ns: i64, out: &mut Vec<CanFrame>) {
        let in_phase_ns = t_ns - self.since_ns.unwrap_or(t_ns);
        match self.phase {
            Phase::Listening if in_phase_ns >= LISTEN_NS => {
                self.enter(Phase::Identifying, t_ns);
                self.ask(t_ns, out);
            }
            Phase::Identifying if t_ns >= self.due_ns => self.ask(t_ns, out),
            Phase::Checking => self.check(t_ns, in_phase_ns, out),
            Phase::Running => self.watch(t_ns, out),
            Phase::Silent if t_ns >= self.due_ns => {
                self.attempts += 1;
                self.enter(Phase::Identifying, t_ns);
                self.ask(t_ns, out);
            }
            Phase::Releasing if in_phase_ns >= RELEASE_NS => {
                self.enter(Phase::Stopped, t_ns);
                self.let_go(t_ns, out);
            }
            Phase::Stopped | Phase::Faulted => self.let_go(t_ns, out),
            _ => {}
        }
    }

    fn ask(&mut self, t_ns: i64, out: &mut Vec<CanFrame>) {
        if self.tries >= TRIES {
            if self.attempts == 0 {
                self.fail(Fault::NoAnswer { tries: TRIES }, t_ns);
            } else {
                self.look_again(t_ns);
            }
            return;
        }
        self.tries += 1;
        self.due_ns = t_ns + TRY_NS;
        out.push(Request::Info.frame(self.settings.device));
    }

    fn check(&mut self, t_ns: i64, in_phase_ns: i64, out: &mut Vec<CanFrame>) {
        if self.tries > 0 {
            self.tries = 0;
            out.extend(self.limp());
            out.push(Request::Serial.frame(self.settings.device));
            out.push(self.period(POSITION_MS, TEMPERATURE_MS));
        }
        let spent_s = (self.last_set_ns - self.first_set_ns) as f64 * 1e-9;
        let rate_hz = if spent_s > 0.0 { f64::from(self.n_checked.saturating_sub(1)) / spent_s } else { 0.0 };
        let enough = self.n_checked >= CHECKED_SETS;
        let lowest_hz = self.settings.lowest_rate_hz;
        if !enough && in_phase_ns < CHECK_NS {
            return;
        }
        if self.n_checked == 0 {
            let finger = self.sets.silent_finger(t_ns - CHECK_NS / 2).unwrap_or(Finger::Index);
            self.fail(Fault::NoPositions { finger: finger.name() }, t_ns);
        } else if enough && (spent_s == 0.0 || (rate_hz < lowest_hz && in_phase_ns < CHECK_NS)) {
            // Everything came in one go, or too little, after a stall; look at some more while the motors are off.
            self.n_checked = 0;
        } else if rate_hz < lowest_hz {
            if self.attempts == 0 {
                self.fail(Fault::TooSlow { rate_hz, lowest_hz }, t_ns);
            } else {
                self.look_again(t_ns);
            }
        } else if let Some(angles) = self.angles_rad {
            self.enter(Phase::Running, t_ns);
            self.heat.start(t_ns);
            self.attempts = 0;
            // Angles out of sixteen bits are never refused.
            if self.settings.torque && self.controller.reset(&angles).is_ok() {
                out.extend(
                    torque_frames(&[0.0; JOINTS], self.settings.device, Scale::V4).into_iter().flatten(),
                );
                out.push(Command::ServoOn.frame(self.settings.device));
                out.push(Request::Info.frame(self.settings.device));
            }
            self.rated = (t_ns, self.counts.sets);
            (self.info_due_ns, self.poll_due_ns) = (t_ns + INFO_NS, t_ns + POLL_AFTER_NS);
        }
    }

    fn watch(&mut self, t_ns: i64, out: &mut Vec<CanFrame>) {
        let silent_ns = t_ns - self.last_set_ns;
        if silent_ns > self.settings.silent_after_ns {
            self.counts.silences += 1;
            self.look_again(t_ns);
            if self.settings.torque {
                out.extend(self.limp());
            }
            return;
        }
        if silent_ns > HELD_NS && !self.late {
            self.late = true;
            self.counts.late += 1;
        }
        if t_ns >= self.info_due_ns {
            self.info_due_ns = t_ns + INFO_NS;
            out.push(Request::Info.frame(self.settings.device));
        }
        let (rated_ns, sets) = (t_ns - self.rated.0, self.counts.sets - self.rated.1);
        if rated_ns >= RATED_NS {
            self.rated = (t_ns, self.counts.sets);
            let rate_hz = sets as f64 / (rated_ns as f64 * 1e-9);
            if rate_hz < self.settings.lowest_rate_hz {
                self.fail(Fault::TooSlow { rate_hz, lowest_hz: self.settings.lowest_rate_hz }, t_ns);
                return;
            }
        }
        if self.heat.silent_ns(t_ns) > POLL_AFTER_NS && t_ns >= self.poll_due_ns {
            self.poll_due_ns = t_ns + POLL_NS;
            out.extend(Finger::ALL.map(|finger| Request::Temperature(finger).frame(self.settings.device)));
        }
    }

    fn look_again(&mut self, t_ns: i64) {
        if self.attempts >= self.settings.reconnects {
            self.fail(Fault::Silent { tries: self.attempts }, t_ns);
            return;
        }
        self.enter(Phase::Silent, t_ns);
        self.due_ns = t_ns + RETRY_NS;
    }

    fn let_go(&mut self, t_ns: i64, out: &mut Vec<CanFrame>) {
        let over = self.phase == Phase::Stopped && self.tries >= LIMP_TIMES;
        if over || t_ns < self.due_ns {
            return;
        }
        self.tries = self.tries.saturating_add(1);
        self.due_ns = t_ns + if self.tries < LIMP_TIMES { LIMP_NS } else { LIMP_AGAIN_NS };
        if self.settings.torque || self.phase == Phase::Stopped {
            out.extend(self.abandon());
        }
    }

    pub(super) fn limp(&self) -> Vec<CanFrame> {
        let zero = torque_frames(&[0.0; JOINTS], self.settings.device, Scale::V4);
        let mut out: Vec<CanFrame> = zero.into_iter().flatten().collect();
        out.push(Command::ServoOff.frame(self.settings.device));
        out
    }

    pub(super) fn period(&self, position_ms: u16, temperature_ms: u16) -> CanFrame {
        let period = Command::SetPeriod { position_ms, imu_ms: 0, temperature_ms, status_ms: Some(0) };
        period.frame(self.settings.device)
    }

    pub(super) fn steers(&self) -> bool {
        self.settings.torque && matches!(self.phase, Phase::Running | Phase::Releasing)
    }
}
