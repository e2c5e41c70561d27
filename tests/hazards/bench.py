"""A whole lab of emulated devices, each in a process of its own, and a run on it that a test can disturb."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from tega.calibration import Calibration, EmgMaxima, FingerMaxima, TouchMaxima, save_calibration
from tega.config import check_tree
from tega.devices.digit import Digit, DigitOptions
from tega.safety.states import Transition
from tega.safety.stop import Stop
from tega.teleop.loop import LoopView
from tega.teleop.session import run_session
from tega.testing.emulators.allegro_process import AllegroProcess
from tega.testing.emulators.digit import DigitProcess
from tega.testing.emulators.process import Emulator
from tega.testing.emulators.vests import EmulatedVest

LONGEST_S = 20.0


class Lab:
    """Emulated devices and the settings that reach them.

    Attributes:
        tree: The settings.
        changes: What the newest run's state did.
        views: The newest moment of it.
        summary: Of the newest run.
    """

    emg: Emulator
    hand: AllegroProcess
    vest: EmulatedVest

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.sensors: dict[str, DigitProcess] = {}
        self.tree: dict[str, Any] = {"session": {}, "calibration": {"file": str(folder / "c.toml")}}
        self.changes: list[Transition] = []
        self.views: list[LoopView] = []
        self.summary: dict[str, Any] = {}
        self.stop = Stop()

    @property
    def state(self) -> str:
        """The run's state now."""
        return self.changes[-1].state if self.changes else "idle"

    def until(self, what: Callable[[], object], *, seconds: float = LONGEST_S) -> float:
        """Wait until something is so and return how long that took; fail after a while."""
        began = time.monotonic()
        while not what():
            if time.monotonic() - began > seconds:
                raise AssertionError(f"not within {seconds} s; states: {self.changes}, {self.said()}")
            time.sleep(0.002)
        return time.monotonic() - began

    def said(self) -> str:
        """What the page says of state and alerts now."""
        if not self.views:
            return ""
        view = self.views[0]
        return f"{view.state}: {view.reason} {' '.join(view.alerts)}"

    def run(self, script: Callable[[], None], *, observe: Callable[[LoopView], None] | None = None) -> None:
        """Run a session, and a script beside it that disturbs it; the run ends with the script."""
        self.changes, self.views, self.stop = [], [], Stop()
        problems: list[BaseException] = []

        def disturb() -> None:
            try:
                script()
            except BaseException as error:
                problems.append(error)
            finally:
                self.stop.ask("the script is over")

        def look(view: LoopView) -> None:
            self.views[:] = [view]
            if observe is not None:
                observe(view)

        beside = threading.Thread(target=disturb, daemon=True)
        began: list[bool] = []

        def progress(what: str, _done: int, _total: int) -> None:
            if what == "running" and not began:
                began.append(True)
                beside.start()

        try:
            self.summary = run_session(
                check_tree(self.tree, {}, base=self.folder).config,
                observer=look,
                progress=progress,
                stop=self.stop,
                on_state=self.changes.append,
            )
        finally:
            if began:
                self.stop.ask("the run is over")
                beside.join(LONGEST_S)
            if problems:
                raise problems[0]

    def write_settings(self) -> Path:
        """Write the settings as a file for the command line."""

        def table(name: str, tree: dict[str, Any]) -> list[str]:
            plain = {k: v for k, v in tree.items() if not isinstance(v, dict)}
            lines = [f"[{name}]"] if plain else []
            lines += [f"{key} = {json.dumps(value)}" for key, value in plain.items()]
            for key, value in tree.items():
                if isinstance(value, dict):
                    lines += table(f"{name}.{key}", value)
            return lines

        path = self.folder / "lab.toml"
        lines = [line for name, tree in self.tree.items() for line in table(name, tree)]
        path.write_text("\n".join(lines) + "\n")
        return path

    def limp(self) -> bool:
        """Whether no motor of the hand pushes."""
        state = self.hand.command()
        return not state["servo_on"] and not any(state["duties"])

    def at_rest(self) -> bool:
        """Whether no motor of the vest turns."""
        return not any(self.vest.report().motors)


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
    """Start emulators.

    Args:
        folder: For settings and calibration.
        emg: A Cyton whose muscles are tensed.
        hand: An Allegro Hand.
        vest: A vest behind the vendor's Player.
        fingers: DIGITs, each with something pressed into it.
        camera_hz: Pictures a second that they really give.
        tables: Further settings.

    Yields:
        The lab.
    """
    with ExitStack() as stack:
        made = Lab(folder)
        tree = made.tree
        # A busy machine must not matter, except where that is what is tried.
        tree["safety"] = {"late_ms": 2000.0}
        maxima = None
        if emg:
            made.emg = stack.enter_context(Emulator("cyton", "--signal", "emg"))
            options: dict[str, Any] = {"port": made.emg.port, "measure_s": 0.25, "silence_s": 0.5}
            tree["emg"] = {"driver": "cyton", "kind": "raw", "options": options}
            maxima = EmgMaxima(
                kind="raw", rate_hz=250.0, tau=25, channels=("ch1", "ch2", "ch3"), maxima=(1.0, 1.0, 1.0)
            )
        if hand:
            made.hand = stack.enter_context(AllegroProcess())
            patient = {"silent_after_ms": 500.0, "lowest_rate_hz": 50.0, "reconnects": 0}
            tree["hand"] = {"driver": "allegro", "options": {**made.hand.options, **patient}}
        if vest:
            made.vest = stack.enter_context(EmulatedVest("bhaptics_player"))
            tree["vest"] = {
                "driver": "bhaptics-player",
                "layout": "x40",
                "options": {"port": made.vest.address["port"]},
            }
        for finger in fingers:
            sensor = DigitProcess("--rate-hz", str(camera_hz))
            made.sensors[finger] = stack.enter_context(sensor)
            settings = {"source": sensor.source, "warm_up_s": 0.1}
            with Digit(DigitOptions(source=sensor.source, warm_up_s=0.1)) as camera:
                frame = camera.read(5.0)
            assert frame is not None
            np.save(folder / f"{finger}.npy", frame.image)
            sensor.command("press")
            tree.setdefault("tactile", {})[finger] = {
                "driver": "digit",
                "baseline": str(folder / f"{finger}.npy"),
                "options": settings,
            }
        for name, table in tables.items():
            tree.setdefault(name, {}).update(table)
        touch = FingerMaxima(**{finger: TouchMaxima(cci_max=0.01, eda_max=500.0) for finger in fingers})
        calibration = Calibration(preset="live", origin="a test", tactile=touch, emg=maxima)
        save_calibration(calibration, folder / "c.toml")
        yield made
