"""The markers of one run, to other programs and from them."""

from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING, Any

from tega.markers.lsl_in import Heard, LslMarkersIn
from tega.markers.lsl_out import LslMarkersOut

if TYPE_CHECKING:
    from tega.config import MarkersSection
    from tega.devices.base import InputEvent
    from tega.recording.mcap_recorder import McapRecorder
    from tega.safety.guard import Guard
    from tega.safety.states import Transition
    from tega.teleop.inputs import Inputs

__all__ = ["RunMarkers"]


class RunMarkers:
    """Tells what a run does, and records what others mark. Make it early: streams take a second to find each other.

    =====================  ==========================================================
    marker                 when
    =====================  ==========================================================
    ``session:start``      at the zero of the session's times
    ``trial:NAME``         likewise; the recording's name without ending, or ``start``
    ``state:STATE``        at every change of the run's state
    ``fault:NAME:WORDS``   when something goes wrong
    ``fault-over:NAME``    when it is well again
    ``pedal:BUTTON``       when a button of the seat ``marker`` goes down
    =====================  ==========================================================

    Args:
        settings: Which streams.

    Raises:
        MissingExtraError: pylsl is not installed.
    """

    def __init__(self, settings: MarkersSection) -> None:
        self._settings = settings
        self._lock = threading.Lock()
        self._early: list[Heard] = []
        self._recorder: McapRecorder | None = None
        self._start_ns = 0
        self._counts_real = self._begun = False
        self._out = None if settings.lsl_out is None else LslMarkersOut(settings.lsl_out)
        self._in = None if settings.lsl_in is None else LslMarkersIn(settings.lsl_in, self._heard)

    def problem(self) -> str:
        """Return why nothing is heard, ``""`` while all is well; asked again and again, it also sees who listens."""
        if self._out is not None:
            self._out.greet()
        return "" if self._in is None else self._in.problem

    def begin(self, start_ns: int | None, recorder: McapRecorder | None) -> None:
        """Begin, at the start of the session or just after.

        Args:
            start_ns: The start on the monotonic clock; ``None`` where the session's time is another.
            recorder: Takes what is heard.
        """
        with self._lock:
            self._counts_real = start_ns is not None
            self._start_ns = time.monotonic_ns() if start_ns is None else start_ns
            self._recorder, self._begun = recorder, True
            early, self._early = self._early, []
        for heard in early:
            self._heard(heard)
        self._tell("session:start", self._start_ns)
        self._tell(f"trial:{'start' if recorder is None else recorder.path.stem}", self._start_ns)

    def follow(self, guard: Guard, inputs: Inputs) -> None:
        """Tell of a run's states, faults and pedals."""
        if self._out is not None:
            guard.observers.append(self._state)
            guard.alert_observers.append(self._alert)
            inputs.observers.append(self._button)

    def summary(self) -> dict[str, Any]:
        """Return what became of them."""
        said: dict[str, Any] = {}
        if self._out is not None:
            said["out"] = {"stream": self._settings.lsl_out, "sent": self._out.n_pushed}
        if self._in is not None:
            correction_s = self._in.correction_s
            said["in"] = {
                "stream": self._settings.lsl_in,
                "heard": self._in.n_heard,
                "clock_correction_s": correction_s,
                "problem": self._in.problem,
            }
        return said

    def close(self) -> None:
        """Stop listening, and take the own stream away."""
        if self._in is not None:
            self._in.close()
        if self._out is not None:
            self._out.close()

    def _tell(self, text: str, at_ns: int) -> None:
        if self._out is not None:
            self._out.push(text, at_ns)

    def _state(self, change: Transition) -> None:
        at_ns = self._start_ns + change.t_ns if self._counts_real else time.monotonic_ns()
        self._tell(f"state:{change.state}", at_ns)

    def _alert(self, name: str, said: str) -> None:
        self._tell(f"fault:{name}:{said}" if said else f"fault-over:{name}", time.monotonic_ns())

    def _button(self, seat: str, event: InputEvent) -> None:
        if seat == "marker" and event.pressed:
            self._tell(f"pedal:{event.button}", event.t_ns)

    def _heard(self, heard: Heard) -> None:
        with self._lock:
            if not self._begun:
                self._early.append(heard)
                return
        if self._recorder is not None:
            start_ns = self._start_ns
            value = {
                "text": heard.text,
                "source": f"lsl:{self._settings.lsl_in}",
                "stamp_s": heard.stamp_s,
                "correction_s": heard.correction_s,
            }
            self._recorder.heard_marker(heard.at_ns - start_ns, heard.received_ns - start_ns, value)
