"""What a played recording told a bus, and jumps in it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("foxglove", reason="needs the extra record")
pytest.importorskip("av", reason="needs the extra lerobot")

from reference.parts import checked
from tega.config import SessionConfig
from tega.loop.snapshot import LoopView
from tega.recording.replay.playhead import Playhead
from tega.records.bus import Bus

MS = 1_000_000


def nowhere(folder: Path) -> SessionConfig:
    return checked({"session": {"out_dir": str(folder / "out")}})


class Heard:
    """What a bus was told."""

    def __init__(self, *kinds: type[Any]) -> None:
        self.bus, self.reported = Bus(), list[Any]()
        for kind in kinds:
            self.bus.subscribe(kind, self.reported.append, vital=True)

    def of(self, kind: type[Any]) -> list[Any]:
        return [one for one in self.reported if isinstance(one, kind)]


def jumping(playhead: Playhead, jumps: dict[float, float]) -> Callable[[LoopView], None]:
    """Return an observer that wishes for a moment of the recording at times of the run."""
    left = dict(jumps)

    def check(view: LoopView) -> None:
        for at_s in [at_s for at_s in left if view.t_ns >= at_s * 1e9]:
            playhead.go_to(left.pop(at_s))

    return check
