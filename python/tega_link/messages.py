"""Define the messages between the stations; msgpack, one message a sample."""

from __future__ import annotations

import math
from typing import TypeVar

import msgspec

from tega.config.calibration import TouchMaxima
from tega.config.fingers import FingerName
from tega.records import Contact, Intent, PoseNumbers, RunState

PROTOCOL = 3
"""Raised by whatever the other side could not understand; stations of two numbers refuse each other."""

# Of the largest picture that is measured; see tega.tactile.
_MOST_PIXELS = 4096 * 4096


class Stamped(msgspec.Struct, frozen=True, kw_only=True):
    """Fields that every message of a stream begins with.

    ``session`` is the sender's: the operator's, or the robot station's. ``sequence`` rises within stream and
    session; ``sent_ns`` is on the sender's monotonic clock.
    """

    session: int
    sequence: int
    sent_ns: int


class HandMessage(Stamped, frozen=True, tag="HandCommand", kw_only=True):
    """Command for the hand.

    ``intent`` is the newest block of EMG with the level or closure that the hand is asked for, its times on
    the sender's clock; ``None`` where nothing is known of the muscles.
    """

    intent: Intent | None = None

    def malformed(self) -> str:
        """Return why the command cannot be used, ``""`` if it can."""
        requested = self.intent
        if requested is None:
            return ""
        if requested.closure is not None and not 0.0 <= requested.closure <= 1.0:
            return f"closure {requested.closure} is not from 0 to 1"
        if requested.confidence is not None and not 0.0 <= requested.confidence <= 1.0:
            return f"confidence {requested.confidence} is not from 0 to 1"
        if not all(map(math.isfinite, requested.activity)):
            return "an activity is not finite"
        return "" if 1 <= requested.level <= 5 else f"level {requested.level} is not from 1 to 5"


class ArmMessage(Stamped, frozen=True, tag="ArmCommand", kw_only=True):
    """Command for the arm: the forearm's pose and the switches that the operator holds.

    ``pose`` is the newest one, in the sender's clock and the tracker's axes; ``None`` before there is one.
    ``recover`` is whether the button is pressed that allows to go on after a fault.
    """

    pose: PoseNumbers | None = None
    dead_man: bool = False
    clutch: bool = False
    recover: bool = False

    def malformed(self) -> str:
        """Return why the command cannot be used, ``""`` if it can."""
        if (pose := self.pose) is None:
            return ""
        if (len(pose.position), len(pose.quaternion)) != (3, 4):
            return "the pose has not three and four numbers"
        whole = all(map(math.isfinite, (*pose.position, *pose.quaternion)))
        return "" if whole else "a number of the pose is not finite"


class Feature(Stamped, frozen=True, tag=True, kw_only=True):
    """Contact in one picture of a fingertip.

    Attributes:
        t_ns: When the picture was taken, sender's clock.
        contact: The measured contact; its times are those of the sender's session.
    """

    t_ns: int
    contact: Contact

    def malformed(self) -> str:
        """Return why the contact cannot be used, ``""`` if it can."""
        felt = self.contact
        further = (felt.area_mm2, felt.depth_mm, felt.force_n, felt.strength, felt.broad)
        known = (felt.mass, felt.cci, felt.peak, *(one for one in further if one is not None))
        if not all(map(math.isfinite, known)):
            return "a number of the contact is not finite"
        return "" if 0 <= felt.eda <= _MOST_PIXELS else f"eda {felt.eda} is not from 0 to {_MOST_PIXELS}"


class Image(Stamped, frozen=True, tag=True, kw_only=True):
    """A picture of a fingertip for display, as JPEG."""

    t_ns: int
    number: int
    jpeg: bytes


class Samples(Stamped, frozen=True, tag=True, kw_only=True):
    """Consecutive EMG samples, for the robot's recording; see ``tega.devices.EmgChunk``.

    ``t_ns`` is when the last was complete, sender's clock; ``first_index`` is the number of the first: a gap
    is a loss. ``samples`` is float64, little-endian, sample by sample.
    """

    t_ns: int
    first_index: int
    n_channels: int
    samples: bytes

    def malformed(self) -> str:
        """Return why the samples cannot be used, ``""`` if they can."""
        whole = 1 <= self.n_channels <= 64 and len(self.samples) % (8 * self.n_channels) == 0
        return "" if whole and self.samples and self.first_index >= 0 else "not a whole number of samples"


class State(Stamped, frozen=True, tag=True, kw_only=True):
    """State of the robot's station; ten a second, and the sign that it is there.

    Attributes:
        leader: Session of the operator who leads; 0 for none.
        state: State of the run; ``""`` while it is being prepared.
        reason: Why it is so.
        alerts: Present problems, one sentence each.
        arm: State of the arm, in one line.
        angles_rad: The hand's joint angles; empty without a hand.
        refused: Commands of this operator's session that were not obeyed, by why.
        problem: Problem with the operator's messages, such as an unknown clock offset.
    """

    leader: int = 0
    state: str = ""
    reason: str = ""
    alerts: tuple[str, ...] = ()
    arm: str = ""
    angles_rad: tuple[float, ...] = ()
    refused: dict[str, int] = {}
    problem: str = ""


class Change(Stamped, frozen=True, tag="Event", kw_only=True):
    """Change of the run's state; its time is that of the sender's session."""

    change: RunState


class Ping(msgspec.Struct, frozen=True, tag=True):
    """Asks the other station's time; ``session`` is the operator's, ``t0_ns`` the asker's."""

    session: int
    t0_ns: int


class Pong(msgspec.Struct, frozen=True, tag=True):
    """Answers a ping: when the question came and when this left, on the answerer's clock."""

    session: int
    t0_ns: int
    t1_ns: int
    t2_ns: int


class Join(msgspec.Struct, frozen=True, tag=True):
    """Asks for the lead, for an operator.

    Attributes:
        session: A number drawn for this.
        frame: Axes of its tracker's poses; ``""`` where it has none.
    """

    session: int
    name: str
    protocol: int = PROTOCOL
    tega: str = ""
    frame: str = ""
    dead_man: bool = False
    muscles: bool = False


class Welcome(msgspec.Struct, frozen=True, tag=True):
    """Gives the operator the lead.

    Attributes:
        station: Session of the robot's station: another one after it was started again.
        fingers: Pictures a second of each fingertip, thumb first; 0 where that is not known.
        preset: By which readings it measures touch.
        baselines: The fingertips' untouched pictures, as PNG, where pictures are sent.
        sent_ns: When it was sent, on the robot's clock; a state from before knows nothing of it.
        records: Whether it records, and wants EMG samples for that.
        touch: What counts as full touch of each fingertip, as far as that is known there.
    """

    station: int
    fingers: dict[FingerName, float]
    hand: bool
    arm: bool
    tega: str = ""
    preset: str = "live"
    baselines: dict[str, bytes] = {}
    sent_ns: int = 0
    records: bool = False
    touch: dict[str, TouchMaxima] = {}


class Refused(msgspec.Struct, frozen=True, tag=True):
    """Refuses the operator the lead.

    ``hint`` is what to do; ``final`` is whether asking again is of no use.
    """

    why: str
    hint: str = ""
    final: bool = True


_Message = TypeVar("_Message", bound=msgspec.Struct)
_decoders: dict[type, msgspec.msgpack.Decoder[msgspec.Struct]] = {}
encode = msgspec.msgpack.Encoder().encode


def decode(kind: type[_Message], data: bytes) -> _Message:
    """Return a message of a kind."""
    decoder = _decoders.get(kind)
    if decoder is None:
        decoder = _decoders[kind] = msgspec.msgpack.Decoder(kind)
    try:
        message = decoder.decode(data)
    except (UnicodeError, OverflowError, RecursionError) as error:  # which the decoder lets through
        raise msgspec.DecodeError(str(error)) from error
    if not isinstance(message, kind):
        raise msgspec.DecodeError(f"not a {kind.__name__}")
    return message
