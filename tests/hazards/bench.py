"""A run on a lab of emulated devices that a test can disturb."""

from __future__ import annotations

import os
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import Any

import numpy as np

from reference.parts import observed
from tega.config import check_tree
from tega.hand import CLOSURE_POSES_RAD
from tega.loop.controls import Controls
from tega.loop.session import run_session
from tega.loop.snapshot import LoopView
from tega.records import RunState
from tega.runtime.files.toml_text import tree_text
from tega.safety.stop import Stop
from tega_emulators.lab import EmulatedLab, emulated_lab
from tega_emulators.vest_bench import seen_by

# A busy machine may need this long; who takes a guard out knows that there is nothing to wait for.
LONGEST_S = float(os.environ.get("TEGA_PATIENCE_S", "60"))


class Lab:
    """A lab and the runs on it: what the newest one's state did, its newest moment and its summary.

    Programs in ``running`` are ended with the lab.
    """

    def __init__(self, folder: Path, devices: EmulatedLab) -> None:
        self.folder, self.devices = folder, devices
        self.changes: list[RunState] = []
        self.views: list[LoopView] = []
        self.summary: dict[str, Any] = {}
        self.stop = Stop()
        self.may_go = True
        self.running: list[subprocess.Popen[bytes]] = []

    def __getattr__(self, name: str) -> Any:
        """Return what the emulated lab has, such as ``tree``, ``sensors``, ``emg``, ``limp`` and ``at_rest``."""
        return getattr(self.devices, name)

    @property
    def state(self) -> str:
        return self.changes[-1].state if self.changes else "idle"

    def until(self, subject: Callable[[], object]) -> None:
        """Wait until something is so; fail after a while."""
        end_s = time.monotonic() + LONGEST_S
        while not subject():
            assert time.monotonic() < end_s, (
                f"not within {LONGEST_S} s; states: {self.changes}, {self.said()}"
            )
            time.sleep(0.002)

    def said(self) -> str:
        """What the page says of state and alerts now."""
        if not self.views:
            return ""
        view = self.views[0]
        return f"{view.state}: {view.reason} {' '.join(view.alerts)}"

    @contextmanager
    def session(
        self,
        *,
        observe: Callable[[LoopView], None] | None = None,
        ends: AbstractContextManager[object] | None = None,
    ) -> Iterator[None]:
        """Run a session beside what a test does to it; its error is raised after that, within ``ends``."""
        self.changes, self.views, self.stop = [], [], Stop()
        begun = threading.Event()

        def check(view: LoopView) -> None:
            self.views[:] = [view]
            if observe is not None:
                observe(view)

        with ThreadPoolExecutor(1) as beside:
            run = beside.submit(
                run_session,
                check_tree(self.tree, {}, base=self.folder).config,
                progress=lambda subject, _done, _total: begun.set() if subject == "running" else None,
                controls=Controls(stop=self.stop, go=lambda: self.may_go),
                bus=observed(check, on_state=self.changes.append),
            )
            run.add_done_callback(lambda _run: begun.set())
            begun.wait()
            if run.done():
                run.result()
            try:
                yield
            finally:
                self.stop.ask("the script is over")
            with ends or nullcontext():
                self.summary = run.result()

    def write_settings(self) -> Path:
        path = self.folder / "lab.toml"
        path.write_text(tree_text(self.tree))
        return path


@contextmanager
def lab(
    folder: Path,
    *,
    emg: bool = False,
    hand: bool = False,
    vest: bool = False,
    fingers: tuple[str, ...] = (),
    camera_hz: float = 60.0,
    **tables: dict[str, Any],
) -> Iterator[Lab]:
    """Start emulators; ``tables`` are further settings."""
    emg_hz = 250.0 if emg else None
    with emulated_lab(
        folder, emg_hz=emg_hz, hand=hand, vest=vest, fingers=fingers, camera_hz=camera_hz
    ) as devices:
        made = Lab(folder, devices)
        # A busy machine must not matter, except where that is what is tried: emulated devices that wait for a core
        # are late and slow, and would be taken for lost ones.
        made.tree["safety"] = {"late_ms": 2000.0, "lowest_rate_share": 0.1, "emg_lost_ms": 600.0}
        if hand:
            made.tree["hand"]["options"] |= {"silent_after_ms": 5000.0, "lowest_rate_hz": 0.0}
        for name, table in tables.items():
            made.tree.setdefault(name, {}).update(table)
        try:
            yield made
        finally:
            for process in made.running:
                process.kill()
                process.wait()
                for pipe in (process.stdout, process.stderr):
                    if pipe is not None:
                        pipe.close()


OPEN, TIGHT = CLOSURE_POSES_RAD[0], CLOSURE_POSES_RAD[4]


def closed(made: Lab) -> bool:
    """Whether the emulated fingers really are in the tight pose."""
    return bool(np.abs(np.array(made.hand.say("look")["angles_rad"]) - TIGHT).max() < 0.15)


def states(made: Lab) -> list[str]:
    return [change.state for change in made.changes]


def column(made: Lab, finger: int) -> int:
    """What a finger's column of the emulated vest does."""
    return int(seen_by(made.vest).motors[finger])
