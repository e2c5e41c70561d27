"""Define the records of stages beside the connected ones: their unconnected outputs."""

from __future__ import annotations

import math
from typing import ClassVar

import msgspec

from tega.records.base import Grey, GreyPerPixel, Ns, Pixels, Record, Share, SquarePixels, Step
from tega.records.touch import NamedValue


class BesideContact(Record, frozen=True, kw_only=True):
    """Contact that a second metric finds in a picture.

    Attributes:
        stage: Its name in the recording.
        finger: Finger of the frame.
        t_ns: When that was taken, since the start of the session.
        in_contact: Whether anything touches.
        eda: Effective deformation area.
        cci: Contact concentration index.
        peak: Largest grey value.
        centroid_xy: Middle of the contact, column and row.
        more: Values of the metric's own.
    """

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


class BesideIntent(Record, frozen=True, kw_only=True):
    """Intent that a second decoder finds in the same samples.

    Attributes:
        stage: Its name in the recording.
        t_ns: When the newest sample was complete, since the start of the session.
        channels: Level of each muscle, 0 to 5; 0 for one that cannot be believed.
        level: Closure level of all of them together, 1 to 5.
        closure: From 0 (open) to 1 (closed); ``None`` where the decoder knows levels only.
        confidence: How sure the decoder is, 0 to 1; ``None`` where it does not say.
    """

    topic: ClassVar[str] = "/beside/{stage}/emg"
    unwritten: ClassVar[tuple[str, ...]] = ("stage",)
    table: ClassVar[tuple[str, ...]] = ("t_s", "stage", "channels", "level", "closure")

    stage: str
    t_ns: Ns
    channels: tuple[Step, ...] = ()
    level: Step = msgspec.field(default=1, name="fused")
    closure: Share | None = None
    confidence: Share | None = None
