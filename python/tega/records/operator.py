"""Define the records of the operator's input devices: their state and their buttons."""

from __future__ import annotations

from typing import ClassVar

from tega.records.base import Ns, Record, Share


class InputState(Record, frozen=True, kw_only=True):
    """State of an input device from now on.

    Attributes:
        seat: Purpose of the device, such as ``dead_man``.
        t_ns: When it was seen, since the start of the session.
        live: False is "no data".
        motion: Speed asked for along x, y, z and about them, each a share of full deflection.
        held: Names of the buttons that are down, in alphabetic order.
    """

    topic: ClassVar[str] = "/input/{seat}"
    schema: ClassVar[str] = "Input"
    unwritten: ClassVar[tuple[str, ...]] = ("seat",)

    seat: str
    t_ns: Ns
    live: bool
    motion: tuple[Share, ...]
    held: tuple[str, ...]


class Button(Record, frozen=True, kw_only=True):
    """A button that went down or up.

    Attributes:
        seat: Purpose of the device.
        t_ns: When, since the start of the session.
        seq: The event's number from the device.
        button: Name of the button.
        pressed: Whether it went down.
    """

    topic: ClassVar[str] = "/input/{seat}/button"
    unwritten: ClassVar[tuple[str, ...]] = ("seat",)

    seat: str
    t_ns: Ns
    seq: int
    button: str
    pressed: bool
