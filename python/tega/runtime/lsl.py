"""Load the library of the Lab Streaming Layer as TEGA uses it, and convert its clock."""

from __future__ import annotations

import os
import time
from importlib.resources import files
from pathlib import Path
from typing import Any

from tega.runtime.lifecycle import require

_POLLS = 5
# A second stream of one name answers about as soon as the first.
_ALONE_S = 0.5

EXTRA = "lsl"


def load_lsl(who: str) -> Any:
    """Import pylsl; unless its library is configured, only its errors are printed."""
    own = (Path("lsl_api.cfg"), Path.home() / "lsl_api" / "lsl_api.cfg", Path("/etc/lsl_api/lsl_api.cfg"))
    if not any(file.exists() for file in own):
        quiet = files("tega.runtime").joinpath("lsl_api.cfg")
        # Read once, when the library is loaded.
        os.environ.setdefault("LSLAPICFG", str(quiet))
    return require("pylsl", driver=who, extra=EXTRA)


def find_streams(lsl: Any, by: str, value: str, timeout_s: float) -> list[Any]:
    """Return all streams whose ``name``, ``type`` or ``source_id`` (``by``) is ``value``.

    The first may take ``timeout_s``; after it, half a second is waited for others.
    """
    found = lsl.resolve_byprop(by, value, minimum=1, timeout=timeout_s)
    if len(found) == 1:
        found = lsl.resolve_byprop(by, value, minimum=2, timeout=_ALONE_S) or found
    return list({stream.uid(): stream for stream in found}.values())


def hosts_of(streams: list[Any]) -> str:
    """Return the names of the machines that streams come from, for a message."""
    return ", ".join(sorted(stream.hostname() for stream in streams))


def to_monotonic_s(lsl: Any) -> float:
    """Return the offset from the library's clock to ours: 0 on Linux, where they are one; a constant elsewhere."""
    looks: list[tuple[float, float]] = []
    for _ in range(_POLLS):
        before_s, theirs_s, after_s = time.monotonic(), float(lsl.local_clock()), time.monotonic()
        if before_s <= theirs_s <= after_s:  # one clock, for however long this thread was put aside
            return 0.0
        looks.append((after_s - before_s, (before_s + after_s) / 2 - theirs_s))
    return min(looks)[1]  # of the shortest look
