"""Start `tega-teleop run` on emulated devices, each in a process of its own: how long until its first tick, and why."""

from __future__ import annotations

import json
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Literal

import msgspec

from tega.errors import DeviceUnavailableError
from tega.runtime.child_process import python_command, python_environment
from tega_figures.bench.machine import Machine, describe_machine

__all__ = ["StartBench", "bench_start"]

_SECONDS = 0.5
# A Chords board of 2026 is deaf for a second after a stop.
_REST_S = 1.5
_FIRST = "first tick"


class StartBench(msgspec.Struct, frozen=True, kw_only=True):
    """When the stages of a start were reached.

    Attributes:
        machine: Where; the emulators ran on the same one.
        emg_hz: Rate of the emulated amplifier: 1000 for a Chords board, which blinks for 0.4 s when it is started and
            whose rate is proven, or measured for 1 s; 250 for a Cyton, whose rate is measured for 0.25 s.
        stages_s: Seconds from the start of the process until each stage, one list a run, in the order of the last run.
        first_tick_s: Those of the first tick.
    """

    machine: Machine
    emg_hz: float
    stages_s: dict[str, list[float]]
    first_tick_s: list[float]


def bench_start(*, repeats: int, record: bool, emg_hz: Literal[250, 1000]) -> StartBench:
    """Start a run with four DIGITs, EMG, an Allegro Hand and a vest again and again.

    Args:
        repeats: How often.
        record: Whether the runs are recorded.
        emg_hz: The amplifier's rate.

    Raises:
        MissingExtraError: A package of the extra ``lab`` is not installed.
        DeviceUnavailableError: A run did not come to its first tick.
    """
    from tega.config import FINGERS
    from tega.runtime.files.toml_text import tree_text
    from tega_emulators.lab import PRESSED, emulated_lab

    found: list[dict[str, float]] = []
    with tempfile.TemporaryDirectory(prefix="tega-bench-") as name:
        folder = Path(name)
        with emulated_lab(
            folder, emg_hz=float(emg_hz), hand="network", vest=True, fingers=FINGERS, touch=PRESSED
        ) as lab:
            lab.tree["session"] = {"duration_s": _SECONDS}
            lab.go_ahead()
            settings = folder / "session.toml"
            settings.write_text(tree_text(lab.tree), encoding="utf-8")
            for k in range(repeats):
                time.sleep(_REST_S)
                more = ("--record", str(folder / f"recorded-{k}")) if record else ()
                found.append(_start("run", str(settings), "--json", *more))
    return StartBench(
        machine=describe_machine(),
        emg_hz=emg_hz,
        stages_s={stage: [run[stage] for run in found] for stage in found[-1]},
        first_tick_s=[run[_FIRST] for run in found],
    )


def _start(*words: str) -> dict[str, float]:
    """Run the command to its end, and return when each stage was reached."""
    began_s = time.monotonic()
    done = subprocess.run(
        python_command("tega_figures.timed_program", repr(began_s), *words),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        env=python_environment(),
        check=False,
    )
    *text, last = done.stderr.decode(errors="replace").splitlines() or [""]
    stages: dict[str, float] = json.loads(last) if last.startswith("{") else {}
    if _FIRST not in stages:
        raise DeviceUnavailableError("a run came to no first tick", "\n".join(text))
    return stages
