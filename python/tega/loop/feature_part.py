"""Join another package's part to a run: its errors name the feature, and none costs the end of the run."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from copy import deepcopy
from functools import partial
from typing import Any, Final

from tega.loop.inbox.inputs import Inputs
from tega.loop.inbox.prepared import Prepared
from tega.loop.sinks import Sinks
from tega.loop.snapshot import LoopView
from tega.runtime.features import Feature, call_feature

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
