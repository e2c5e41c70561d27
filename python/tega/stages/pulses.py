"""Show touch by its events: pulses when a finger touches, lets go, or the object slips, and rest in between.

The policy is that of event-driven feedback (Cipriani and others 2014, "Humans can integrate feedback of discrete
events in their sensorimotor control of a robotic hand"): only the transitions between the phases of a task are shown.
The place identifies the event: contact in front, release at the back, slip on both.
"""

from __future__ import annotations

from collections.abc import Mapping as AnyMapping
from collections.abc import Sequence
from typing import Annotated, ClassVar, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.haptics import FINGERS
from tega.records import Contact, Event
from tega.stages.base import Mapping, StageOptions, VestSetup
from tega.stages.columns import FingerColumns, finger_columns

_Percent = Annotated[float, msgspec.Meta(ge=0, le=100)]


class PulsesOptions(StageOptions, frozen=True):
    """Options of the mapping ``pulses``.

    Attributes:
        contact: A finger begins to touch: intensity of its front column, percent; 0 leaves it out.
        release: A finger lets go: intensity of its back column, percent; 0 leaves it out.
        slip: The object slips: intensity of the columns of all fingers in use, on both faces, percent; 0 leaves it
            out.
        duration_s: Duration of a pulse: a small coin motor needs about 0.18 s to reach its full vibration.
        gap_s: Minimum time after a pulse before the same event of the same finger is shown again.
        fingers: Finger that each column shows, from the wearer's left, or a list of fingers.
    """

    contact: _Percent = 70.0
    release: _Percent = 70.0
    slip: _Percent = 100.0
    duration_s: Annotated[float, msgspec.Meta(ge=0.05, le=1)] = 0.2
    gap_s: Annotated[float, msgspec.Meta(ge=0.1, le=5)] = 0.3
    fingers: FingerColumns = FINGERS


class _Pulse(NamedTuple):
    end_ns: int
    front: dict[str, float]
    back: dict[str, float]


class PulsesMapping(Mapping):
    """Pulses of the events of touch that are certain; ``n_told`` counts those begun, by kind of event.

    A rig without the hand's joints and the arm's height cannot observe slips: it has no pulses for them. A
    finger without a fresh frame shows nothing: its pulses end, and its state on return is no event.
    """

    summary: ClassVar[str] = "pulses at contact, slip and release, rest in between"
    options_type: ClassVar[type[StageOptions]] = PulsesOptions
    wants_events = True

    def __init__(self, setup: VestSetup, options: PulsesOptions) -> None:
        self._options = options
        self._columns = finger_columns(setup, options.fingers)
        self._motors = [
            (index, motor.face, finger)
            for index, motor in enumerate(setup.layout.motors)
            for finger, column in self._columns.items()
            if column == motor.column
        ]
        self._n_motors = len(setup.layout.motors)
        self._displayed: list[_Pulse] = []
        self._free_ns: dict[tuple[str, str], int] = {}
        self.n_told = dict.fromkeys(("contact", "slip", "release"), 0)

    def levels(
        self, t_ns: int, contacts: AnyMapping[str, Contact], events: Sequence[Event]
    ) -> NDArray[np.float64]:
        """Return every motor's level."""
        for event in events:
            self._notify(event)
        self._displayed = [pulse for pulse in self._displayed if t_ns < pulse.end_ns]
        levels = np.zeros(self._n_motors)
        for pulse in self._displayed:
            for index, face, finger in self._motors:
                if finger in contacts:
                    displayed = (pulse.front if face == "front" else pulse.back).get(finger, 0.0)
                    levels[index] = max(levels[index], displayed)
        return levels

    def _notify(self, event: Event) -> None:
        o = self._options
        level = {"contact": o.contact, "release": o.release, "slip": o.slip}.get(event.kind, 0.0)
        key = event.kind, event.finger
        if not (level and event.certain) or event.t_ns < self._free_ns.get(key, event.t_ns):
            return
        end_ns = event.t_ns + round(o.duration_s * 1e9)
        self._free_ns[key] = end_ns + round(o.gap_s * 1e9)
        reported = {finger: level for finger in self._columns if event.finger in {"", finger}}
        front = {} if event.kind == "release" else reported
        back = {} if event.kind == "contact" else reported
        self._displayed.append(_Pulse(end_ns, front, back))
        self.n_told[event.kind] += 1
