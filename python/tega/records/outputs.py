"""Define the records of hand and vest: commands, frames on the hand's bus, joint angles, and frames of the motors."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Any, ClassVar

import msgspec

from tega.records.base import Millimetres, Ns, Record, Share, Step, quantity

Levels = Annotated[float, quantity("level")]


class BusFrame(msgspec.Struct, frozen=True):
    """One frame of a CAN bus.

    Attributes:
        data: The payload, 0 to 8 bytes.
        remote: Whether it asks for the data frame of the same identifier.
        flags: 1 for an identifier of 29 bits, plus 2 for an error frame.
    """

    schema: ClassVar[str] = "CanFrame"

    id: Annotated[int, quantity("1", "uint32")]
    data: bytes
    remote: bool = False
    flags: Annotated[int, quantity("1", "uint32")] = 0


def bus_frames(frames: Iterable[Any]) -> tuple[BusFrame, ...]:
    """Return frames of :mod:`tega.wire` or :mod:`tega.hand.link` as parts of a record."""
    return tuple(
        [
            BusFrame(number, bytes(data), remote, flags[0] + 2 * flags[1] if flags else 0)
            for number, data, remote, *flags in frames
        ]
    )


def frames_text(frames: Iterable[Any]) -> str:
    """Return frames for people: identifier and bytes of each, ``R`` for one that asks."""
    return " ".join([f"{f.id:03X}#{'R' if f.remote else f.data.hex()}" for f in frames]).upper()


class HandCommand(Record, frozen=True, kw_only=True):
    """Command to a hand in one tick, and its frames.

    Attributes:
        t_ns: The tick, since the start of the session.
        level: Closure level including a reflex's addition, 1 to 5; 0 when it is let go.
        frames: CAN frames of this tick; none where a hand closes its own loop.
        closure: From 0 (open) to 1 (closed), where it lies between two levels.
    """

    topic: ClassVar[str] = "/hand/frames"
    schema: ClassVar[str] = "CanFrames"
    version: ClassVar[int] = 2
    table: ClassVar[tuple[str, ...]] = ("t_s", "frames")

    t_ns: Ns
    level: Step
    frames: tuple[BusFrame, ...] = ()
    closure: Share | None = None


class HandExchange(Record, frozen=True, kw_only=True):
    """One exchange with a hand that closes its own loop.

    Attributes:
        t_ns: Time on the machine's monotonic clock, as it was passed to the link.
        level: Closure level asked for, or the nearest.
        received: Frames received since the last exchange.
        sent: Frames given to the adapter, also those that it did not take, which an alert reports.
        action: ``exchange``, ``release`` or ``abandon``.
        closure: From 0 (open) to 1 (closed), where it lies between two levels.
        added: Addition of a reflex to the level.
    """

    topic: ClassVar[str] = "/hand/bus"
    version: ClassVar[int] = 3

    t_ns: Ns
    level: Step
    received: tuple[BusFrame, ...]
    sent: tuple[BusFrame, ...]
    action: str
    closure: Share | None = None
    added: Levels = 0.0


class Imposed(Record, frozen=True, kw_only=True):
    """A level that is set against the muscles, such as by a guard.

    Attributes:
        t_ns: The tick from which on.
        level: It, or the nearest; 0 for no longer.
        closure: From 0 (open) to 1 (closed), where it lies between two levels.
    """

    topic: ClassVar[str] = "/hand/imposed"
    version: ClassVar[int] = 2

    t_ns: Ns
    level: Step
    closure: Share | None = None


class ReflexGrip(Record, frozen=True, kw_only=True):
    """Addition of the reflex to the closure that the person asks for, at each tick at which it was asked.

    Attributes:
        t_ns: The tick, since the start of the session.
        own: Closure that the person asks for, 1 to 5 with fractions.
        added: Levels that the hand is commanded beyond that.
        authority: Share of the largest addition that the reflex may use.
        allowed: Whether the run was active.
        measured: Closure of the hand by its joints; ``None`` where no hand is measured.
        wish: Request of the reflex, -1 (take back) to 1.
    """

    topic: ClassVar[str] = "/hand/reflex"
    table: ClassVar[tuple[str, ...]] = (
        *("t_s", "own", "added", "authority", "allowed", "measured", "wish", "cause"),
    )

    t_ns: Ns
    own: Levels
    added: Levels
    authority: Share = 0.0
    allowed: bool = True
    measured: Levels | None = None
    wish: Share = 0.0
    cause: str = ""


class HandLook(Record, frozen=True, kw_only=True):
    """State of hand and arm for slip detection, recorded if mapping or reflex want events.

    Attributes:
        t_ns: The tick, since the start of the session.
        seen_ns: When it was looked.
        level: Closure asked for, including a reflex's addition, 1 to 5; ``None``, like all following fields, if hand
            or arm reported nothing fresh: slips were then detected by touch alone.
        closure: Closure by the hand's joints, levels.
        height_m: Height of the arm's end.
        tips_mm: Height of each fingertip over the palm, thumb first; empty where not known.
    """

    topic: ClassVar[str] = "/hand/look"

    t_ns: Ns
    seen_ns: Ns = 0
    level: Levels | None = None
    closure: Levels | None = None
    height_m: Annotated[float, quantity("m")] | None = None
    tips_mm: tuple[Millimetres, ...] = ()


class Joints(Record, frozen=True, kw_only=True):
    """Joint angles of the hand.

    Attributes:
        t_ns: The tick, since the start of the session.
        angles_rad: Angles of the 16 joints, in the order of :data:`tega.hand.JOINT_NAMES`.
    """

    topic: ClassVar[str] = "/hand/joints"
    schema: ClassVar[str] = "foxglove.JointStates"

    t_ns: Ns
    angles_rad: tuple[Annotated[float, quantity("rad")], ...]


class VestRecord(Record, frozen=True, kw_only=True):
    """Intensity of every motor of a layout at one moment; its subclasses define the source.

    Attributes:
        t_ns: The tick it was made at, since the start of the session.
        intensities: Intensity of each motor, front row by row from the top, then the back.
        handed_ns: When it was handed over.
    """

    schema: ClassVar[str] = "VestFrame"
    table: ClassVar[tuple[str, ...]] = ("t_s", "intensities")

    t_ns: Ns
    layout: str
    intensities: tuple[Annotated[int, quantity("%", "uint32")], ...]
    handed_ns: Ns = 0


class VestFrame(VestRecord, frozen=True, kw_only=True):
    """A frame as the loop made it, once all vests were given it."""

    topic: ClassVar[str] = "/vest/frame"


class TriedMotor(Record, frozen=True, kw_only=True):
    """A motor that is tested while the run is armed.

    Attributes:
        t_ns: The tick from which on, since the start of the session.
        motor: Its place in the vest frame.
        percent: How hard; 0 for no longer.
    """

    topic: ClassVar[str] = "/vest/tried"

    t_ns: Ns
    motor: Annotated[int, quantity("1", "uint32")]
    percent: Annotated[int, quantity("%", "uint32")]


class ProgramFrame(Record, frozen=True, kw_only=True):
    """Frame that a program sends in the place of the loop's own.

    Attributes:
        t_ns: The tick from which on, since the start of the session.
        intensities: Of each motor, as in a vest frame; empty while the loop's own frames stand.
    """

    topic: ClassVar[str] = "/vest/program"

    t_ns: Ns
    intensities: tuple[Annotated[int, quantity("%", "uint32")], ...] = ()


class SentFrame(VestRecord, frozen=True, kw_only=True):
    """Frame that a real vest was sent, after its own limits."""

    topic: ClassVar[str] = "/vest/sent"
