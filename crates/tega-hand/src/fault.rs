//! Why a link to a hand gave up.

/// A reason to let go of the hand for good; the message says what was seen, the hint what to do.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Fault {
    /// Another program steers the same hand.
    #[error("another program sends torques on this bus (frame {id:#05x})")]
    ForeignHost {
        /// The frame's identifier.
        id: u32,
    },
    /// No INFORMATION came back.
    #[error("no hand answered {tries} requests for its version")]
    NoAnswer {
        /// Requests sent.
        tries: u32,
    },
    /// The hand is not a version 4 one.
    #[error("the hand says it is version {}.{} (firmware {}.{}), not 4", hardware >> 8, hardware & 0xFF, firmware >> 8, firmware & 0xFF)]
    WrongVersion {
        /// Hardware version as sent.
        hardware: u16,
        /// Firmware version as sent.
        firmware: u16,
    },
    /// The hand is of the other side.
    #[error("the hand says it is a {said} hand, the settings say {wanted}")]
    WrongSide {
        /// What the hand says.
        said: &'static str,
        /// What the settings say.
        wanted: &'static str,
    },
    /// After a silence a hand of another serial number answers.
    #[error("another hand answers, with another serial number than before")]
    OtherHand,
    /// The motors are off although this side has not switched them off.
    #[error("the hand reports that its motors were switched off, and not by this program")]
    MotorsOff,
    /// The hand reports a temperature fault.
    #[error("the hand reports a temperature fault (status bits {status:#07b}, palm {palm_c} °C)")]
    Reported {
        /// Status bits as sent.
        status: u8,
        /// Palm board, °C.
        palm_c: u8,
    },
    /// A joint is too hot.
    #[error("{joint} is at {temperature_c} °C; the limit is 80 °C")]
    TooHot {
        /// The joint.
        joint: &'static str,
        /// Its temperature, °C.
        temperature_c: u8,
    },
    /// No complete set of positions came.
    #[error("the {finger} finger sends no joint positions")]
    NoPositions {
        /// The finger that is missing.
        finger: &'static str,
    },
    /// Positions come too seldom.
    #[error("the hand sends its joint positions {rate_hz:.0} times a second; {lowest_hz:.0} are needed")]
    TooSlow {
        /// Sets of positions per second.
        rate_hz: f64,
        /// The least that is accepted.
        lowest_hz: f64,
    },
    /// An angle that no joint can have.
    #[error("{joint} reads {angle_rad:.3} rad, further than any joint goes")]
    Angle {
        /// The joint.
        joint: &'static str,
        /// Its angle.
        angle_rad: f64,
    },
    /// Angles that jump from set to set.
    #[error("{joint} jumps by {jump_rad:.2} rad within 3 ms, again and again")]
    Jumping {
        /// The joint.
        joint: &'static str,
        /// The last jump.
        jump_rad: f64,
    },
    /// The angles stand still to the last count while the target moves.
    #[error(
        "no joint angle has changed by a single count for {still_s:.1} s although the hand was commanded to move"
    )]
    Frozen {
        /// For how long.
        still_s: f64,
    },
    /// The hand fell silent and did not come back.
    #[error("the hand fell silent and {}", not_back(*tries))]
    Silent {
        /// Attempts to reach it again.
        tries: u32,
    },
}

fn not_back(tries: u32) -> String {
    match tries {
        0 => "is not opened again: reconnects = 0".to_owned(),
        1 => "did not come back in 1 attempt".to_owned(),
        _ => format!("did not come back in {tries} attempts"),
    }
}

impl Fault {
    /// One word for programs.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::ForeignHost { .. } => "foreign-host",
            Self::NoAnswer { .. } => "no-answer",
            Self::WrongVersion { .. } => "wrong-version",
            Self::WrongSide { .. } => "wrong-side",
            Self::OtherHand => "other-hand",
            Self::MotorsOff => "motors-off",
            Self::Reported { .. } => "reported",
            Self::TooHot { .. } => "too-hot",
            Self::NoPositions { .. } => "no-positions",
            Self::TooSlow { .. } => "too-slow",
            Self::Angle { .. } => "angle",
            Self::Jumping { .. } => "jumping",
            Self::Frozen { .. } => "frozen",
            Self::Silent { .. } => "silent",
        }
    }

    /// The next step for the person who reads the message.
    pub fn hint(&self) -> &'static str {
        match self {
            Self::ForeignHost { .. } => "end the other program; two hosts on one hand fight each other",
            Self::NoAnswer { .. } => {
                "check 12 V power, CAN H/L, termination, 1 Mbit/s, device_id, and that the adapter passes remote frames"
            }
            Self::WrongVersion { .. } => {
                "torque counts and angles mean something else there; this driver steers version 4 only"
            }
            Self::WrongSide { .. } => "set side in the driver's options to the hand that is mounted",
            Self::OtherHand => {
                "start again if this is the hand that is meant; each hand needs a bus of its own"
            }
            Self::MotorsOff => "end other programs that use the hand, look at its supply, then start again",
            Self::Reported { .. } | Self::TooHot { .. } => {
                "let it cool with the power off, then use lower levels or shorter grips"
            }
            Self::NoPositions { .. } => {
                "switch the hand's power off and on; if it stays, that finger's board or cable"
            }
            Self::TooSlow { .. } => {
                "give the hand a CAN adapter of its own; look for a busy bus or an adapter that loses frames"
            }
            Self::Angle { .. } | Self::Jumping { .. } => {
                "do not steer it: a sensor, its cable or the bus is broken"
            }
            Self::Frozen { .. } => "check that motor power is on, then switch the hand off and on",
            Self::Silent { .. } => "check power, cable and adapter, then start again",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hand_that_may_not_be_opened_again_has_no_attempts() {
        let texts = [0, 1, 5].map(|tries| Fault::Silent { tries }.to_string());
        assert_eq!(texts[0], "the hand fell silent and is not opened again: reconnects = 0");
        assert_eq!(texts[1], "the hand fell silent and did not come back in 1 attempt");
        assert_eq!(texts[2], "the hand fell silent and did not come back in 5 attempts");
    }
}
