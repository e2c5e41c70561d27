"""Define the record of a delay: from a camera frame to the vest, or from an EMG block to hand or joints."""

from __future__ import annotations

from itertools import pairwise
from typing import ClassVar, Final

from tega.records.base import Ns, Record

TOUCH_STAGES: Final = ("camera", "contact", "wait", "map", "held", "hand-over", "own", "in-hand", "whole")
INTENT_STAGES: Final = ("sample", "levels", "wait", "report", "hand-over", "own", "whole")
MOTION_STAGES: Final = ("sample", "levels", "wait", "joint", "whole")

# Recordings of before there was a greatest rate do not tell when it let a frame go.
_STAMPS_WITHOUT_HELD: Final = 6
# Older recordings do not tell when the hand reported, either.
_STAMPS_WITHOUT_REPORT: Final = 5


class Latency(Record, frozen=True, kw_only=True):
    """The way of one camera frame to the vest, or of one block of EMG to the hand or to the first motion of a joint.

    Attributes:
        path: ``touch``, ``intent`` or ``motion``.
        source: The finger, or ``emg``.
        stamps_ns: Times since the start of the session: captured, received, measured. Then, for touch: taken up,
            made, let go and handed over. For intent: command to the hand, arrival of the report that the torques
            answer, and hand-over. For motion: command to the hand, and first observed motion of a joint.
    """

    topic: ClassVar[str] = "/latency/{path}"

    path: str
    source: str
    stamps_ns: tuple[Ns, ...]

    @property
    def log_ns(self) -> int:
        """Time at which the frame or block arrived."""
        return self.stamps_ns[-1]

    def stages_ns(self) -> dict[str, int]:
        """Return the delay of each stage, by :data:`TOUCH_STAGES`, :data:`INTENT_STAGES` or :data:`MOTION_STAGES`."""
        stamps = self.stamps_ns
        if self.path == "touch" and len(stamps) == _STAMPS_WITHOUT_HELD:
            stamps = (*stamps[:5], stamps[4], stamps[5])
        elif self.path == "intent" and len(stamps) == _STAMPS_WITHOUT_REPORT:
            stamps = (*stamps[:4], stamps[3], stamps[4])
        steps = [later - sooner for sooner, later in pairwise(stamps)]
        whole = stamps[-1] - stamps[0]
        if self.path == "touch":
            own = steps[1] + steps[3] + steps[5]
            return dict(zip(TOUCH_STAGES, (*steps, own, whole - steps[0], whole), strict=True))
        if self.path == "motion":
            return dict(zip(MOTION_STAGES, (*steps, whole), strict=True))
        return dict(zip(INTENT_STAGES, (*steps, steps[1] + steps[4], whole), strict=True))
