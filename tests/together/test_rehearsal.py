"""A made-up participant of the emulated bench: what it presses, squeezes, answers and lifts is kept of it."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from reference.installed import program
from reference.processes import until
from reference.study_bench import quick_study

pytest.importorskip("tega_emulators", reason="needs ./tools/emulators")


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.skipif(os.name != "posix", reason="emulated serial devices need pseudo-terminals")
def test_a_participant_is_calibrated_and_led_as_a_person_is(tmp_path: Path) -> None:
    """The whole way to a report is a tutorial, whose commands are run as they stand on its page."""
    words = [sys.executable, "-m", "tega.ui.cli", "init", "--emulated", "--out", "lab.toml"]
    bench = subprocess.Popen(words, cwd=tmp_path, stdin=subprocess.DEVNULL)

    def rehearse(*words: str) -> subprocess.CompletedProcess[str]:
        return program(sys.executable, "-m", "tega_emulators.participant", *words, folder=tmp_path)

    try:
        until(lambda: (tmp_path / "lab/calibration.toml").is_file() or bench.poll() is not None)
        quick = ("--person", "p01", "--time-scale", "0.2", "--pause-s", "0")
        assert "Finished" in rehearse("calibrate", "lab.toml", *quick).stderr
        kept = tmp_path / "calibrations/people/p01"
        touch = [tomllib.loads(f.read_text()) for f in sorted(kept.glob("touch-*.toml"))]
        # Three presses with a ball and three with a plate on each fingertip.
        found = [(t["finger"], t["n_presses"], t.get("notes", [])) for t in touch]
        assert found == [("thumb", 6, []), ("index", 6, [])]
        (muscles,) = kept.glob("emg-*.toml")
        assert min(tomllib.loads(muscles.read_text())["live_max"]) > 10
        (vest,) = kept.glob("vest-1*.toml")
        assert all(10 <= p <= 24 for p in tomllib.loads(vest.read_text())["threshold_percent"])
        quick_study(tmp_path / "study")
        led = ("--lab", "lab.toml", "--time-scale", "0.02", "--json")
        done = rehearse("study", "run", "study", "p01", *led)
        assert json.loads(done.stdout) == {"participant": "p01", "over": 2, "trials": 2, "next": None}
        felt = []
        for file in sorted((tmp_path / "study").glob("**/p01/**/touch.csv")):
            with file.open() as table:
                felt.append(max(float(row["eda"]) for row in csv.DictReader(table)))
        assert len(felt) == 2
        assert min(felt) > 1000
    finally:
        bench.send_signal(signal.SIGINT)
        bench.wait(60)
    assert bench.returncode == 0
