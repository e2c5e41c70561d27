"""Follow a run in a test: by its bus, and by parts of a test's own."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any, Self

from tega.config import SessionConfig, check_tree
from tega.loop import run_session
from tega.loop.controls import Controls
from tega.loop.inbox.inputs import Prepared
from tega.loop.parts import Part
from tega.loop.snapshot import LoopView, Snapshot
from tega.records import RunState
from tega.records.bus import Bus
from tega.records.display import Notice


def checked(tree: dict[str, Any]) -> SessionConfig:
    return check_tree(tree, {}, base=Path.cwd()).config


def observed(
    observer: Callable[[LoopView], object] | None = None,
    bus: Bus | None = None,
    *,
    on_state: Callable[[RunState], object] | None = None,
    notices: Callable[[str], object] | None = None,
) -> Bus:
    """Return a bus, with subscribers to moments, states and notices."""
    bus = Bus() if bus is None else bus
    if observer is not None:
        bus.subscribe(Snapshot, lambda snapshot: observer(snapshot.view), name="display", vital=True)
    if on_state is not None:
        bus.subscribe(RunState, on_state, name="states", vital=True)
    if notices is not None:
        bus.subscribe(Notice, lambda notice: notices(notice.text), name="notices")
    return bus


class Given(Part):
    """Part that changes the inputs of a run."""

    def __init__(self, change: Callable[[Prepared], Prepared]) -> None:
        self._change = change

    def prepared(self, prepared: Prepared) -> Prepared:
        """Return the changed inputs."""
        return self._change(prepared)


class Running:
    """A run in a thread until the block is left, with its moments and notices; ``how`` is as of ``run_session``."""

    def __init__(self, config: SessionConfig, bus: Bus | None = None, **how: Any) -> None:
        self.views, self.notices, self.summary = list[LoopView](), list[str](), dict[str, Any]()
        self.bus = observed(self.views.append, bus, notices=self.notices.append)
        self._config, self._how, self._over = config, how, threading.Event()
        self.thread = threading.Thread(target=self._run, daemon=True)

    def _run(self) -> None:
        controls = Controls(stop=self._over.is_set)
        self.summary = run_session(self._config, bus=self.bus, controls=controls, **self._how)

    def __enter__(self) -> Self:
        self.thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def end(self) -> dict[str, Any]:
        """End the run and return its summary."""
        self._over.set()
        self.thread.join(60)
        assert not self.thread.is_alive()
        return self.summary

    @property
    def view(self) -> LoopView:
        """The newest moment; an empty one before the first."""
        return self.views[-1] if self.views else LoopView(0, {}, None, None, None, {})
