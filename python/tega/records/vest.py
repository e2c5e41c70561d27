"""Define the records of the vest: the loop's frames, and those that a vest says it was sent."""

from __future__ import annotations

from typing import Annotated, ClassVar

from tega.records.base import Ns, Record, quantity


class VestRecord(Record, frozen=True, kw_only=True):
    """Intensity of every motor of a layout at one moment; its subclasses define the source.

    Attributes:
        t_ns: The tick it was made at, since the start of the session.
        layout: Name of the layout.
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
