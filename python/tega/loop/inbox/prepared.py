"""Define the prepared sources of a run, with their baselines and maxima."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.config.calibration import Calibration, EmgMaxima
from tega.devices.base import EmgSource, TactileSource
from tega.loop.inbox.sources import SourceReport
from tega.loop.inbox.stream import Stream
from tega.records import Contact, HandLook, Intent
from tega.stages.base import Decoder


class Finger(NamedTuple):
    """One fingertip, ready to run.

    Attributes:
        baseline: Its untouched picture.
        measured: All frames, where they had to be measured beforehand.
        stream: Contacts of the finger from elsewhere; its source is then not read.
    """

    source: TactileSource
    baseline: NDArray[np.uint8]
    baseline_origin: str
    report: SourceReport
    measured: list[Contact] | None = None
    stream: Stream[Contact] | None = None


class Muscles(NamedTuple):
    """The EMG side, ready to run.

    Attributes:
        maxima: Its maxima and the conditions they hold under.
        decoder: Samples to intents; ``None`` where they are made somewhere else.
        stream: The intents, where they are known from somewhere else; its source is then not read.
    """

    source: EmgSource
    maxima: EmgMaxima
    decoder: Decoder | None
    report: SourceReport
    stream: Stream[Intent] | None = None


class Prepared(NamedTuple):
    """Prepared sources of a run: fingers and muscles.

    Attributes:
        fingers: By name, thumb first.
        muscles: The EMG side; ``None`` without EMG.
        calibration_name: Base name of the maxima's file, or their person; ``""`` when from the recording.
        poll_hand: Returns at a tick, by the requested level, a reading of hand and arm from another source;
            those of the run are then not read.
    """

    fingers: Mapping[str, Finger]
    muscles: Muscles | None
    calibration: Calibration
    calibration_name: str
    warnings: tuple[str, ...] = ()
    poll_hand: Callable[[int, float], HandLook | None] | None = None

    @property
    def sources(self) -> list[TactileSource | EmgSource]:
        """All sources, thumb first, EMG last."""
        found: list[TactileSource | EmgSource] = [finger.source for finger in self.fingers.values()]
        return found if self.muscles is None else [*found, self.muscles.source]
