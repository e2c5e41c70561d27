"""Touch told by its events: the vest pulses when a finger touches, lets go, or the object slips, and rests in between.

The policy is that of event-driven feedback (Cipriani and others 2014, "Humans can integrate feedback of discrete
events in their sensorimotor control of a robotic hand"): what divides the phases of a task is told, nothing else.
Which event it was is told by place: contact in front, release at the back, slip on both. Levels and durations are
settings (``vest.pulses``); a pulse goes through the wearer's thresholds, the dose and the watchdog as any frame does.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

from tega.detect import Detector, Found, Touch
from tega.haptics import vest_frame
from tega.teleop.touch import STALE_NS, Felt, TouchLoop

if TYPE_CHECKING:
    from tega.calibration import TouchMaxima
    from tega.config import PulsesConfig
    from tega.haptics import FeltMap, Layout, Mirror, VestFrame
    from tega.tactile import ContactMetrics

__all__ = ["PulseLoop"]

_COLUMNS = ("thumb", "index", "middle", "ring")


class _Pulse(NamedTuple):
    end_ns: int
    front: tuple[float, ...]
    back: tuple[float, ...]


class PulseLoop(TouchLoop):
    """Turns the events of touch into vest frames.

    A finger whose newest frame is older than 100 ms tells nothing: its pulses end, and what it shows when it is back is
    taken for what it was, not for an event.

    Args:
        maxima: As of :class:`tega.teleop.touch.TouchLoop`, like the others.
        pulses: Levels and durations.
        layout: Which motors the vest has.
        mirror: Which faces have their columns reversed.
        felt: Evens out what the wearer feels.

    Attributes:
        n_told: How many pulses were begun, by what they tell.
    """

    def __init__(
        self,
        maxima: Mapping[str, TouchMaxima],
        *,
        pulses: PulsesConfig,
        layout: Layout,
        mirror: Mirror = "none",
        felt: FeltMap | None = None,
    ) -> None:
        super().__init__(maxima, layout=layout, mirror=mirror, felt=felt)
        self._pulses = pulses
        self._detector = Detector()
        self._shown: list[_Pulse] = []
        self._free_ns: dict[tuple[str, str], int] = {}
        self._seen_ns: dict[str, int] = {}
        self.n_told = dict.fromkeys(("contact", "slip", "release"), 0)

    def update(self, finger: str, t_ns: int, metrics: ContactMetrics) -> Felt:
        """Take one measured frame, and begin the pulses of what it tells."""
        felt = super().update(finger, t_ns, metrics)
        self._seen_ns[finger] = t_ns
        touch = Touch(metrics.in_contact, metrics.eda, metrics.mass, metrics.peak, *metrics.centroid_xy)
        for found in self._detector.touch(t_ns / 1e9, finger, touch):
            self._tell(t_ns, found)
        return felt._replace(front=0.0, back=0.0)

    def frame(self, t_ns: int) -> VestFrame:
        """Return the vest frame for a time."""
        self._shown = [pulse for pulse in self._shown if t_ns < pulse.end_ns]
        live = [t_ns - self._seen_ns.get(finger, t_ns - 2 * STALE_NS) <= STALE_NS for finger in _COLUMNS]
        front, back = [0.0] * len(_COLUMNS), [0.0] * len(_COLUMNS)
        for pulse in self._shown:
            for column, (ahead, behind) in enumerate(zip(pulse.front, pulse.back, strict=True)):
                if live[column]:
                    front[column] = max(front[column], ahead)
                    back[column] = max(back[column], behind)
        frame = vest_frame(front, back, layout=self._layout, mirror=self._mirror)
        return frame if self._map is None else self._map.apply(frame)

    def _tell(self, t_ns: int, found: Found) -> None:
        """Begin an event's pulse, unless the same has just been told."""
        pulses = self._pulses
        level = {"contact": pulses.contact, "release": pulses.release, "slip": pulses.slip}.get(
            found.kind, 0.0
        )
        key = found.kind, found.finger
        if not level or t_ns < self._free_ns.get(key, t_ns):
            return
        end_ns = t_ns + round(pulses.duration_s * 1e9)
        self._free_ns[key] = end_ns + round(pulses.gap_s * 1e9)
        front, back = [0.0] * len(_COLUMNS), [0.0] * len(_COLUMNS)
        for column, finger in enumerate(_COLUMNS):
            if found.finger in {"", finger}:
                front[column] = level if found.kind != "release" else 0.0
                back[column] = level if found.kind != "contact" else 0.0
        self._shown.append(_Pulse(end_ns, tuple(front), tuple(back)))
        self.n_told[found.kind] += 1
