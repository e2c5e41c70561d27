"""Alerts that no test of a hazard raises: the cause is made, and the run's recording has the alert."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from itertools import cycle
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hazards.bench import Lab, lab
from reference.kept import muscle_file
from reference.processes import begun_by
from tega.config import check_tree
from tega.errors import RecordingError
from tega.loop import rig, run_session
from tega.recording.mcap_reader import McapReader
from tega.ui.cli.report import echo_summary

pytestmark = pytest.mark.slow


def recorded(summary: dict[str, Any], folder: Path) -> list[str]:
    """Return what the alerts in a run's recording say."""
    file = folder / str(summary["recording"]["file"])
    return [one.value.said for one in McapReader(file).messages() if one.schema == "tega.Alert"]


def disturbed(made: Lab, folder: Path, disturb: Callable[[], None], words: str) -> None:
    """Disturb an active run until its display has an alert; the recording has it, too."""
    with made.session():
        made.until(lambda: made.state == "active")
        disturb()
        made.until(lambda: words in made.said())
    assert any(words in text for text in recorded(made.summary, folder))


@pytest.mark.raises("clock")
def test_a_clock_that_is_set_is_an_alert(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ahead_ns = [0]
    clock = SimpleNamespace(monotonic_ns=time.monotonic_ns, time_ns=lambda: time.time_ns() + ahead_ns[0])
    monkeypatch.setattr(rig, "time", clock)
    with lab(tmp_path, emg=True, recording={"dir": str(tmp_path / "recorded")}) as made:

        def set_it() -> None:
            ahead_ns[0] = 90 * 10**9

        disturbed(made, tmp_path / "recorded", set_it, "the time of day jumped by +90.0 s")


@pytest.mark.raises("latency")
def test_a_latency_over_its_budget_is_an_alert(tmp_path: Path) -> None:
    recording = {"dir": str(tmp_path / "recorded")}
    with lab(tmp_path, emg=True, vest=True, fingers=("thumb",), recording=recording) as made:
        made.tree["safety"] |= {"latency_budget_ms": 0.001}
        presses = cycle(["press 0", "press 0.7"])
        with made.session():
            made.until(lambda: made.state == "active")

            def reported() -> bool:
                made.sensors["thumb"].say(next(presses))
                time.sleep(0.4)
                return "ms are allowed" in made.said()

            made.until(reported)
        assert any("ms are allowed" in text for text in recorded(made.summary, tmp_path / "recorded"))


@pytest.mark.raises("recording")
def test_a_recorder_that_is_killed_is_an_alert(tmp_path: Path) -> None:
    with lab(tmp_path, emg=True, recording={"dir": str(tmp_path / "recorded")}) as made, made.session():
        made.until(lambda: made.state == "active")
        (pid,) = begun_by(os.getpid(), "tega.recording.recorder_program")
        os.kill(pid, signal.SIGKILL)
        made.until(lambda: "recorder's process ended" in made.said())
    # The file ended before it; the summary has it.
    assert any("recorder's process ended" in text for text in made.summary["safety"]["alerts"])
    # A script that started the run sees it by the exit code.
    with pytest.raises(RecordingError, match=r"recording stopped after .* s: "):
        echo_summary(made.summary, wall_s=1.0, as_json=False)


@pytest.mark.raises("muscles")
def test_an_electrode_that_moved_is_an_alert(tmp_path: Path) -> None:
    rng, rate_hz = np.random.default_rng(1), 1000
    shares = np.repeat([[1.0, 0.3], [0.3, 1.0]], 20 * rate_hz, axis=0)
    np.save(tmp_path / "emg.npy", 100 * shares * rng.standard_normal(shares.shape))
    options = {"file": "emg.npy", "rate_hz": float(rate_hz)}
    tree = {
        "session": {"pace": "fast"},
        "calibration": {"file": str(muscle_file(tmp_path, 100.0, 100.0, rate_hz=float(rate_hz)))},
        "emg": {"driver": "emg-file", "kind": "raw", "options": options},
        "recording": {"dir": "recorded", "stop_free_mib": 0.0},
    }
    summary = run_session(check_tree(tree, {}, base=tmp_path).config)
    assert any("moved" in text for text in recorded(summary, tmp_path / "recorded"))
