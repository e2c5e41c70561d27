"""Define the records of touch: a fingertip camera's picture, the contacts measured in it, and the events."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.records.base import (
    Grey,
    GreyPerPixel,
    Millimetres,
    Newtons,
    Ns,
    Percent,
    Pixels,
    Record,
    Share,
    SquareMillimetres,
    SquarePixels,
    quantity,
)
from tega.records.table import record_html

_NAN = math.nan

# Fields that version 2 spelled as values of the metric's own.
_ONCE_NAMED = {"area_mm2": "mm²", "depth_mm": "mm", "force_n": "N", "strength": "1", "broad": "1"}


class Picture(Record, frozen=True, kw_only=True):
    """One picture of a fingertip camera, as it was read.

    Attributes:
        image: uint8 (H, W, 3), blue, green, red; borrowed and read-only.
        t_ns: When it was taken, since the start of the session.
        received_ns: When the program had it; ``t_ns`` for one out of a file.
        seq: Its number from the camera; a gap is a lost picture.
        name: Name in error messages.
        pixels_crc32: CRC-32 of its pixels; known for a file, not for a camera.
        loaded: Whether another finger was in contact when it was measured.
        rezeroed: Whether the picture before it was taken for a new baseline.
        cells: In a file with JPEG images, the sums over cells of 8 x 8 pixels that the metric ``live`` reads, int16
            (3, cells), little-endian; else empty.
    """

    topic: ClassVar[str] = "/tactile/{finger}/image"
    schema: ClassVar[str] = "Frame"
    version: ClassVar[int] = 4
    unwritten: ClassVar[tuple[str, ...]] = ("finger", "image")
    logged: ClassVar[str] = "received_ns"
    bulk: ClassVar[str] = "image"

    finger: str
    image: NDArray[np.uint8]
    t_ns: Ns
    received_ns: Ns
    seq: int
    name: str
    pixels_crc32: Annotated[int, quantity("1", "uint32")] = 0
    loaded: bool = False
    rezeroed: bool = False
    cells: bytes = b""


class NamedValue(msgspec.Struct, frozen=True):
    """A number that a metric of one's own gives.

    Attributes:
        name: Name of the value, such as ``embedding_1``.
        unit: Unit of the value; ``1`` for a plain number.
    """

    name: str
    value: float
    unit: str = "1"


class Contact(Record, frozen=True, kw_only=True):
    """Contact in one frame of a fingertip, and its output to the wearer.

    A metric fills in ``finger``, ``t_ns``, ``in_contact`` and its other measurements; the loop adds ``taken_ns``,
    ``known_ns``, ``cci_norm``, ``eda_norm``, ``front`` and ``back``. Without contact, places and lengths are NaN, and
    ``eda`` and ``cci`` 0.

    Attributes:
        t_ns: When the picture was taken, since the start of the session.
        taken_ns: The loop's tick at which it was taken in.
        mass: Sum of the grey map.
        centroid_xy: Middle of the contact, column and row (Eq 2).
        spread: σ: pixels (Eq 3, spatial) or grey values (intensity).
        threshold: T (Eq 4).
        eda: Effective deformation area, pixels above T (Eq 5).
        cci: Contact concentration index (Eq 6); of the metric ``live`` the peak over the root of ``eda``.
        peak: Largest grey value.
        peak_xy: Where that is, column and row.
        cci_norm: CCI as a share of the finger's maximum, 0 to 1.
        eda_norm: EDA likewise.
        front: Share of full of the finger's front column: of the intensity (Eq 7, 8), or of the sensation above the
            wearer's threshold (``equal-steps``).
        back: Share of full of its back column (Eq 9), likewise.
        known_ns: When the loop had done so.
        area_mm2: Area of the contact; ``None``, as below, where the metric does not say.
        depth_mm: Depth of the dent.
        force_n: Normal force.
        strength: How firm the contact is, 0 to 1.
        broad: How broad it is, from 0 (a point or an edge) to 1 (a face).
        more: Values of one's own.
    """

    topic: ClassVar[str] = "/tactile/{finger}/contact"
    version: ClassVar[int] = 3
    unwritten: ClassVar[tuple[str, ...]] = ("finger",)
    table: ClassVar[tuple[str, ...]] = (
        *("t_s", "finger", "cci", "eda", "cci_norm", "eda_norm", "peak", "in_contact", "front", "back"),
        *("area_mm2", "depth_mm", "force_n", "strength", "broad"),
    )
    logged: ClassVar[str] = "taken_ns"

    finger: str
    t_ns: Ns
    taken_ns: Ns = 0
    mass: Grey = 0.0
    centroid_xy: tuple[Pixels, Pixels] = (_NAN, _NAN)
    spread: Annotated[float, quantity("px or grey")] = _NAN
    threshold: Grey = _NAN
    eda: SquarePixels = 0
    cci: GreyPerPixel = 0.0
    peak: Grey = 0.0
    peak_xy: tuple[Annotated[int, quantity("px", "int32")], Annotated[int, quantity("px", "int32")]] = (0, 0)
    in_contact: bool
    cci_norm: Share = 0.0
    eda_norm: Share = 0.0
    front: Percent = 0.0
    back: Percent = 0.0
    known_ns: Ns = 0
    area_mm2: SquareMillimetres | None = None
    depth_mm: Millimetres | None = None
    force_n: Newtons | None = None
    strength: Share | None = None
    broad: Share | None = None
    more: tuple[NamedValue, ...] = ()

    def _repr_html_(self) -> str:
        return record_html(self, f"{self.finger}, {self.t_ns / 1e9:.3f} s")

    def current(self) -> Contact:
        """Return the contact with each named value that has a field of its name and unit in that field."""
        if not self.more:
            return self
        named = {
            one.name: one.value
            for one in self.more
            if _ONCE_NAMED.get(one.name) == one.unit and getattr(self, one.name) is None
        }
        if not named:
            return self
        more = tuple(one for one in self.more if one.name not in named)
        return msgspec.structs.replace(self, more=more, **named)


class BesideContact(Record, frozen=True, kw_only=True):
    """Contact that a second metric, ``stage``, finds in a picture; fields as those of :class:`Contact`."""

    topic: ClassVar[str] = "/beside/{stage}/{finger}"
    unwritten: ClassVar[tuple[str, ...]] = ("stage", "finger")
    table: ClassVar[tuple[str, ...]] = ("t_s", "stage", "finger", "in_contact", "cci", "eda", "peak")

    stage: str
    finger: str
    t_ns: Ns
    in_contact: bool
    eda: SquarePixels = 0
    cci: GreyPerPixel = 0.0
    peak: Grey = 0.0
    centroid_xy: tuple[Pixels, Pixels] = (math.nan, math.nan)
    more: tuple[NamedValue, ...] = ()


CERTAIN: Final[float] = 0.5
"""Confidence from which an event counts as certain."""


class Event(Record, frozen=True, kw_only=True):
    """An event of touch: a finger makes contact, lets go, or the object slips, as :mod:`tega.stages.events` finds it.

    Attributes:
        t_ns: Time of the picture, or the tick of the look at the hand, that showed it, since the start of the session.
        finger: Name of the finger; ``""`` for the whole hand.
        kind: ``contact``, ``release`` or ``slip``.
        confidence: 0 to 1; half where it is just an event. A slip on a rig that cannot observe slips has less.
        began_ns: Estimated time of its beginning.
        taken_ns: The loop's tick at which it was found.
    """

    topic: ClassVar[str] = "/touch/event"
    table: ClassVar[tuple[str, ...]] = ("t_s", "finger", "kind", "confidence")
    logged: ClassVar[str] = "taken_ns"

    t_ns: Ns
    finger: str
    kind: str
    confidence: Share = 1.0
    began_ns: Ns = 0
    taken_ns: Ns = 0

    @property
    def certain(self) -> bool:
        """Whether the event is certain enough to be shown to the wearer."""
        return self.confidence >= CERTAIN

    @property
    def words(self) -> str:
        """Description of the event, with its finger."""
        kind = self.kind if self.certain else f"{self.kind}?"
        return f"{kind}: {self.finger}" if self.finger else kind
