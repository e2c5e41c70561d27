"""A study of two people is rehearsed from calibration to report on one emulated bench, as a user would."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from subprocess import CompletedProcess

import pytest

from reference.installed import program
from reference.processes import until

pytest.importorskip("tega_emulators", reason="needs ./tools/emulators")

pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(900),
    pytest.mark.skipif(os.name != "posix", reason="emulated serial devices need pseudo-terminals"),
]


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    folder = tmp_path_factory.mktemp("lab")
    words = [sys.executable, "-m", "tega.ui.cli", "init", "--emulated", "--out", "lab.toml"]
    bench = subprocess.Popen(words, cwd=folder, stdin=subprocess.DEVNULL)
    until(lambda: (folder / "lab/calibration.toml").is_file() or bench.poll() is not None)
    assert bench.poll() is None
    yield folder
    bench.send_signal(signal.SIGINT)
    assert bench.wait(60) == 0


def rehearse(folder: Path, seed: int, *words: str) -> CompletedProcess[str]:
    return teleop(folder, "--seed", str(seed), *words, module="tega_emulators.participant")


def teleop(folder: Path, *words: str, code: int = 0, module: str = "tega.ui.cli") -> CompletedProcess[str]:
    done = program(sys.executable, "-m", module, *words, folder=folder, code=code)
    assert "Traceback" not in done.stderr
    return done


def test_a_study_of_two_people_goes_from_calibration_to_report(lab: Path) -> None:
    assert "Ready" in teleop(lab, "doctor", "lab.toml").stdout
    for seed, person in enumerate(("p01", "p02")):
        quick = ("--person", person, "--time-scale", "0.2", "--pause-s", "0")
        assert "Finished" in rehearse(lab, seed, "calibrate", "lab.toml", *quick).stderr
        kept = lab / "calibrations/people" / person
        touch = [tomllib.loads(f.read_text()) for f in sorted(kept.glob("touch-*.toml"))]
        # Three presses with a ball and three with a plate on each fingertip.
        assert [(t["finger"], t["n_presses"], t.get("notes", [])) for t in touch] == [
            ("thumb", 6, []),
            ("index", 6, []),
        ]
        (muscles,) = kept.glob("emg-*.toml")
        assert min(tomllib.loads(muscles.read_text())["live_max"]) > 10
        (vest,) = kept.glob("vest-1*.toml")
        assert all(10 <= p <= 24 for p in tomllib.loads(vest.read_text())["threshold_percent"])
    done = rehearse(lab, 0, "practice", "lab.toml", "--person", "p01", "--seconds", "10", "--yes", "--json")
    assert json.loads(done.stdout)["person"] == "p01"
    words = ("lab.toml", "--person", "p01", "--set", "session.duration_s=3", "--record", "monday", "--json")
    summary = json.loads(teleop(lab, "run", *words).stdout)
    # The person's maxima, not those that were made up for the bench.
    assert summary["calibration"]["file"] == "calibration of p01"
    planned = ("--participants", "2", "--trials", "1", "--objects", "bottle")
    teleop(lab, "study", "plan", *planned, "--anyway", "--out", "people")
    refused = teleop(lab, "study", "run", "people", "p01", "--lab", "lab.toml", "--yes", code=1)
    assert "emulated sessions do not belong into a plan of people" in refused.stderr
    teleop(lab, "study", "plan", *planned, "--simulated", "--out", "rehearsal")
    for seed, person in enumerate(("p01", "p02")):
        led = ("--lab", "lab.toml", "--time-scale", "0.02", "--json")
        done = rehearse(lab, seed, "study", "run", "rehearsal", person, *led)
        assert json.loads(done.stdout) == {"participant": person, "over": 2, "trials": 2, "next": None}
        felt = []
        for file in sorted((lab / "rehearsal").glob(f"**/{person}/**/touch.csv")):
            with file.open() as table:
                felt.append(max(float(row["eda"]) for row in csv.DictReader(table)))
        assert len(felt) == 2
        assert min(felt) > 1000
    teleop(lab, "study", "detect", "rehearsal")
    teleop(lab, "study", "score", "rehearsal")
    teleop(lab, "study", "report", "rehearsal")
    page = (lab / "rehearsal/report.html").read_text()
    assert page.index("Everything here is simulated") < page.index("<table")
