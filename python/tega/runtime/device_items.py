"""Define the items that drivers and their users exchange: settings, descriptions, frames, samples, events."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import msgspec

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


Kind = Literal["tactile", "emg", "vest", "hand", "input", "tracker", "arm"]


class Options(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Base of every driver's options: one field per key of its ``options`` table, with the unit in its name."""


class DeviceInfo(msgspec.Struct, frozen=True, kw_only=True):
    """Description of a device: its name, rate, channels, unit and notes.

    Attributes:
        driver: Name under which the driver is registered.
        kind: Protocol that the device implements.
        label: Name of the device or recording: a base name, a serial number, a bus; never a full path.
        live: Whether it runs on the monotonic clock; false for a recording.
        rate_hz: Frames or samples per second; ``None`` where only the open device knows, or for a sink.
        channels: Names of an EMG source's channels, such as ``ch3``.
        unit: Unit of the numbers it delivers or takes.
        n_items: Frames or samples it will deliver, where that is known.
        notes: Things a reader of the results must know, one sentence each.
    """

    driver: str
    kind: Kind
    label: str
    live: bool
    rate_hz: float | None = None
    channels: tuple[str, ...] = ()
    unit: str = ""
    n_items: int | None = None
    notes: tuple[str, ...] = ()


class Found(msgspec.Struct, frozen=True, kw_only=True):
    """Something on this machine that a driver can open, or could if nothing stood in the way.

    Attributes:
        label: Name that a person would look for: a serial number, a port, a bus.
        options: The driver's options that reach it, as they stand in a settings file.
        problem: Problem that prevents opening it, one sentence, with its fix, ``hint``; ``""`` if none is known.
        may_open: Whether it may be opened for a closer check. False for a port with an unknown device, since opening
            it can restart the device, and for checks that take long.
    """

    driver: str
    label: str
    options: dict[str, Any] = msgspec.field(default_factory=dict)
    problem: str = ""
    hint: str = ""
    note: str = ""
    may_open: bool = True


class TactileFrame(NamedTuple):
    """One picture of a fingertip.

    The frame belongs to its reader: a source never writes into an array that it has given away, since other threads
    read it. A driver with one buffer gives a copy of it.

    Attributes:
        t_ns: Time of the picture in nanoseconds.
        seq: Its number, from 0; a gap is a lost frame.
        image: uint8 (H, W, 3), blue, green, red.
        name: Name in error messages: a file name, or a video's name and the frame's number.
    """

    t_ns: int
    seq: int
    image: NDArray[np.uint8]
    name: str


class EmgChunk(NamedTuple):
    """Consecutive EMG samples; given away for good, as :class:`TactileFrame` is.

    Attributes:
        t_ns: Time at which the last of them was complete, in nanoseconds.
        first_index: Number of the first of them, from 0; a gap is a loss.
        samples: float64 (n, channels), in the source's unit.
    """

    t_ns: int
    first_index: int
    samples: NDArray[np.float64]


class InputReading(NamedTuple):
    """State of an operator's input device.

    Attributes:
        t_ns: Time of its last report, on the monotonic clock; a device at rest may be silent for hours.
        live: False is "no data": it is away, or stands still in the middle of a motion. Then ``motion`` is zero and
            nothing is held.
        motion: Speed asked for, each a share of full deflection from -1 to 1: along x (forward), y (left), z
            (up) of the robot's base, then about them, right-handed. Zero for a device without axes.
        held: Names of the buttons that are down.
    """

    t_ns: int
    live: bool
    motion: tuple[float, float, float, float, float, float]
    held: frozenset[str]


class InputEvent(NamedTuple):
    """A button that went down or up.

    Attributes:
        t_ns: When it was seen, on the monotonic clock.
        seq: Its number, from 0; a gap is an event that was not fetched in time.
        button: The button's name.
        pressed: Whether it went down.
    """

    t_ns: int
    seq: int
    button: str
    pressed: bool


class CameraCounts(msgspec.Struct, kw_only=True):
    """Counts of the pictures that a camera sent: ``received`` in all, of which ``used`` were passed on.

    Attributes:
        dropped: Pictures that never came, by the gaps between the others; an estimate.
        torn: Frames with a missing end, or with the end of the previous frame.
        duplicate: Pictures equal to the one before to the last bit.
        stuck: Times the source sent the same picture three times or more.
        black: Pictures without light.
        odd_size: Pictures of another size than the first.
        foreign: Pictures that show, in part or whole, what another sensor sees.
        unlike: Pictures that are far from the own baseline nearly everywhere and near to no other's; used.
        lost: Times the camera went away.
    """

    received: int = 0
    used: int = 0
    dropped: int = 0
    torn: int = 0
    duplicate: int = 0
    stuck: int = 0
    black: int = 0
    odd_size: int = 0
    foreign: int = 0
    unlike: int = 0
    lost: int = 0
