"""Define a part of a run: it joins by the bus and by a few hooks, and the loop does not know which parts there are.

Another package's part is wrapped: its errors name the feature, and none costs the end of the run.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from copy import deepcopy
from functools import partial
from types import NoneType
from typing import Any, Final, NamedTuple, cast

from tega.config import Pace, SessionConfig
from tega.devices.base import Tracker
from tega.haptics import Layout
from tega.loop.inbox.inputs import Inputs, Prepared
from tega.loop.latency import LatencyTrace
from tega.loop.pacing import LoopReport
from tega.loop.sinks import Sinks
from tega.loop.snapshot import LoopView
from tega.records.bus import Bus
from tega.records.types import record_types
from tega.runtime.device_items import DeviceInfo
from tega.runtime.features import Feature, call_feature, call_member, having
from tega.runtime.threads import Bell
from tega.safety.guard import Guard

__all__ = ["Part", "PartContext", "RunStart", "open_parts"]


class PartContext(NamedTuple):
    """Context in which a feature opens its part, which ``stack`` closes after the run.

    ``config.guests`` holds the feature's own tables; ``stop`` returns whether to give up; preparation is reported by
    ``progress(activity, done, total)``.
    """

    config: SessionConfig
    bus: Bus
    stack: ExitStack
    stop: Callable[[], bool]
    progress: Callable[[str, int, int], None]


class RunStart(NamedTuple):
    """Facts of a run that is about to begin.

    Attributes:
        arm_infos: Descriptions of tracker and arm by name; empty without an arm.
        trial: Name of the trial; ``"start"`` where no part names one.
        observed: Whether a display follows the run.
        real: Whether the session's clock is the machine's monotonic clock.
        start_ns: Zero of the session's times on its clock; 0 before the clock starts.
        now_ns: Time of the session's clock.
        bell: Wakes the loop between two ticks; ``None`` where only ticks do.
        trace: Latency trace; ``None`` where nothing is live.
    """

    config: SessionConfig
    prepared: Prepared
    sinks: Sinks
    guard: Guard
    arm_infos: Mapping[str, DeviceInfo]
    trial: str
    layout: Layout
    pace: Pace
    observed: bool
    real: bool
    start_ns: int = 0
    now_ns: int = 0
    bell: Bell | None = None
    trace: LatencyTrace | None = None


class Part:
    """Part of a run. Every hook does nothing here; a part overrides the ones it needs.

    Attributes:
        trial: Name of the trial, for markers.
        origin: Words for the origin of maxima that this part makes unnecessary here; ``""``: none.
        endless: Whether the run goes on although every source has ended.
        brings_input: Whether this part brings input, so that the settings need not.
    """

    trial: str = ""
    origin: str = ""
    endless: bool = False
    brings_input: bool = False

    @property
    def tracker(self) -> Tracker | None:
        """Tracker that leads the arm in place of the settings' own; ``None`` for none."""
        return None

    def prepared(self, prepared: Prepared) -> Prepared:
        """Return the inputs of the run, with those that this part adds or follows."""
        return prepared

    def sinks(self, sinks: Sinks) -> Sinks:
        """Return the outputs of the run, with those that this part adds."""
        return sinks

    def inputs(self, stack: ExitStack, inputs: Inputs) -> Inputs:  # noqa: ARG002  # for parts that open one
        """Return the operator's inputs, with those that this part adds."""
        return inputs

    def alerts(self) -> Mapping[str, Callable[[], str]]:
        """Return alerts by name: each returns its text, ``""`` for nothing."""
        return {}

    def needs(self) -> Mapping[str, Callable[[], str]]:
        """Return conditions of the run by name: each returns why the run cannot go on, ``""`` if it can."""
        return {}

    def head(self, run: RunStart) -> None:
        """Prepare, before the clock starts."""

    def begin(self, run: RunStart) -> None:
        """Begin with the run."""

    def displayed(self, view: LoopView) -> LoopView:
        """Complete a moment for displays."""
        return view

    def end(self) -> None:
        """End with the loop, before devices are closed."""

    def ended(self, report: LoopReport, n_waits: int) -> None:
        """Take the loop's report, when devices are closed."""

    def notes(self) -> list[str]:
        """Return sentences for the summary's notes."""
        return []

    def summary(self) -> dict[str, Any]:
        """Return entries of the run's summary by key."""
        return {}

    def finish(self, summary: dict[str, Any]) -> None:
        """Finish, when the summary is complete but for entries that are added here."""


def open_parts(context: PartContext) -> list[Part]:
    """Open the parts of all features that take part in a run; ``TegaError``, which says why, where one cannot be."""
    record_types()  # leaves out features whose records cannot be recorded
    found: list[Part] = []
    for feature in having("part"):
        part = call_member(feature, "part", context, kind=(Part, NoneType))
        if part is not None:
            found.append(part if feature.own else cast("Part", FeaturePart(feature, part)))
    return found


# Hooks, with what they return: a run must not go on without the first, and must not end by the others.
_NEEDED: Final = {"prepared": Prepared, "sinks": Sinks, "inputs": Inputs, "head": object, "begin": object}
_SPARED: Final = {"displayed": LoopView, "end": object, "ended": object, "notes": list, "summary": dict}


class FeaturePart:
    """Has every member of a part; a hook that fails is named, in the summary's notes where the run goes on."""

    def __init__(self, feature: Feature, part: Any) -> None:
        self._feature, self._part = feature, part
        self._problems: dict[str, str] = {}

    def __getattr__(self, name: str) -> Any:
        """Return a member of the part."""
        member = getattr(self._part, name)
        if name in _NEEDED:
            return partial(call_feature, self._feature, f"{name}()", member, kind=_NEEDED[name])
        return partial(self._spare, name, member, _SPARED[name]) if name in _SPARED else member

    def alerts(self, hook: str = "alerts") -> Mapping[str, Callable[[], str]]:
        """Return the part's alerts; one that fails stops the run, since nothing watches any more."""
        reports = call_feature(self._feature, f"{hook}()", getattr(self._part, hook), kind=Mapping)
        called = partial(partial, call_feature, self._feature)
        return {name: called(f"{hook}: {name!r}", report, kind=str) for name, report in reports.items()}

    def needs(self) -> Mapping[str, Callable[[], str]]:
        """Return the part's conditions of the run; one that fails stops it."""
        return self.alerts("needs")

    def finish(self, summary: dict[str, Any]) -> None:
        """Finish a copy of the summary, and note everything that went wrong."""
        finished = deepcopy(summary)
        self._spare("finish", lambda: (self._part.finish(finished), finished), tuple)
        if "finish" not in self._problems:
            summary |= finished
        summary["notes"] = [*summary["notes"], *self._problems.values()]

    def _spare(self, hook: str, function: Callable[..., Any], kind: type, *arguments: Any) -> Any:
        """Call a hook, until it fails once: then return its argument, or nothing of its kind."""
        try:
            if hook not in self._problems:
                result = call_feature(self._feature, f"{hook}()", function, *arguments, kind=kind)
                if kind not in {LoopView, object}:
                    call_feature(self._feature, f"what {hook}() returned", _check, result)
                return result
        except Exception as error:
            self._problems[hook] = getattr(error, "message", str(error))
        return arguments[0] if arguments else kind()


def _check(result: Any) -> None:
    """Refuse what no file can hold, and notes that are no text."""
    json.dumps(result)
    if isinstance(result, list) and not all(isinstance(note, str) for note in result):
        raise TypeError(f"{result!r} is not text only")
