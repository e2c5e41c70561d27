"""Define the records of the muscles: EMG samples, and the intents decoded from them."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.records.base import Count, Ns, Record, Share, Step, quantity


class EmgSamples(Record, frozen=True, kw_only=True):
    """Consecutive EMG samples, as they were read.

    Attributes:
        t_ns: When the last of them was complete, since the start of the session.
        received_ns: When the program had them; ``t_ns`` for those out of a file.
        first_index: Number of the first of them; a gap is a loss.
        samples: float64 (n · channels,), sample by sample, in the source's unit.
    """

    topic: ClassVar[str] = "/emg/samples"
    logged: ClassVar[str] = "received_ns"
    bulk: ClassVar[str] = "samples"

    t_ns: Ns
    received_ns: Ns
    first_index: int
    n_channels: Step
    samples: Annotated[NDArray[np.float64], quantity("the source's", "double*")]


class Intent(Record, frozen=True, kw_only=True):
    """Intent of the operator: the level or closure that the muscles ask of the hand.

    Attributes:
        t_ns: When the block of samples was complete, since the start of the session.
        taken_ns: The loop's tick at which it was taken in.
        channels: Level of each muscle, 0 to 5; 0 for one that cannot be believed.
        level: Closure level of all of them together, 1 to 5.
        closure: From 0 (open) to 1 (closed); ``None`` where the decoder knows levels only.
        confidence: How sure the decoder is, 0 to 1; ``None`` where it does not say.
        activity: Activity of each muscle, as a share of its maximum; empty if the decoder gives none.
    """

    topic: ClassVar[str] = "/emg/levels"
    schema: ClassVar[str] = "Levels"
    version: ClassVar[int] = 3
    table: ClassVar[tuple[str, ...]] = ("t_s", "channels", "level", "closure", "confidence")
    logged: ClassVar[str] = "taken_ns"

    t_ns: Ns
    taken_ns: Ns = 0
    channels: tuple[Step, ...] = ()
    level: Step = msgspec.field(default=1, name="fused")
    closure: Share | None = None
    confidence: Share | None = None
    activity: tuple[Share, ...] = ()


class BesideIntent(Record, frozen=True, kw_only=True):
    """Intent that a second decoder, ``stage``, finds in the same samples; fields as those of :class:`Intent`."""

    topic: ClassVar[str] = "/beside/{stage}/emg"
    unwritten: ClassVar[tuple[str, ...]] = ("stage",)
    table: ClassVar[tuple[str, ...]] = ("t_s", "stage", "channels", "level", "closure")

    stage: str
    t_ns: Ns
    channels: tuple[Step, ...] = ()
    level: Step = msgspec.field(default=1, name="fused")
    closure: Share | None = None
    confidence: Share | None = None


class AdaptationSwitch(Record, frozen=True, kw_only=True):
    """Switch of the online adaptation of EMG, as it was read at the end of a block.

    Attributes:
        t_ns: When the block was complete, since the start of the session.
        n_samples: Samples of each channel up to there, those that never came included.
        allowed: Whether gains and offsets may change: the run is armed or active, and no finger touches anything.
        target: Closure that the person is asked to hold, 0 to 1; ``None`` if there is none.
        n_undone: How often the key that undoes has been pressed.
    """

    topic: ClassVar[str] = "/emg/adaptation/switch"

    t_ns: Ns
    n_samples: Count
    allowed: bool = False
    target: Share | None = None
    n_undone: Count = 0


class Adaptation(Record, frozen=True, kw_only=True):
    """Gain and offset of every channel from now on: amplitude' = gain x (amplitude - offset).

    Attributes:
        t_ns: When the block was complete, since the start of the session.
        n_samples: Samples of each channel up to there; the next one is adapted by these numbers.
        why: ``rest``, ``target``, ``undone`` or ``again``.
        gains: Gain of each channel, 1 if unchanged.
        offsets: Offset of each channel, 0 if unchanged.
    """

    topic: ClassVar[str] = "/emg/adaptation"
    table: ClassVar[tuple[str, ...]] = ("t_s", "why", "gains", "offsets")

    t_ns: Ns
    n_samples: Count
    why: str
    gains: tuple[Share, ...]
    offsets: tuple[Annotated[float, quantity("the source's")], ...]


class MuscleCondition(Record, frozen=True, kw_only=True):
    """Condition of the muscles and their electrodes, once every second of effort.

    Attributes:
        t_ns: When the newest sample was complete, since the start of the session.
        median_hz: Median frequency of each channel over the last second of effort; NaN where there was none.
        slope_percent_per_min: Slope of that over the last minutes of effort, of its first value; NaN where not known.
        pattern_change: Distance of the channels' share in the effort from that of the run's first eight seconds of
            such an effort, weak or strong, 0 (the same) to 1 (another channel altogether); NaN where not known.
        said: Message to the user; ``""`` for none.
    """

    topic: ClassVar[str] = "/emg/condition"
    table: ClassVar[tuple[str, ...]] = ("t_s", "median_hz", "slope_percent_per_min", "pattern_change", "said")

    t_ns: Ns
    median_hz: tuple[Annotated[float, quantity("Hz")], ...] = ()
    slope_percent_per_min: tuple[Annotated[float, quantity("%/min")], ...] = ()
    pattern_change: Share = math.nan
    said: str = ""
