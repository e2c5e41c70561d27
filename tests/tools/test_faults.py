"""The table of faults: complete, and a few of its cells run again with what they have to come to."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tega.devices import driver_class
from tega_campaigns.faults import FAULTS, DriverOutcome, all_trials
from tega_campaigns.faults.page import glance
from tega_emulators.benches import BENCHES

PROJECT = Path(__file__).resolve().parents[2]
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the emulators need Linux")


def test_every_driver_with_an_emulator_meets_every_fault_or_says_why_it_cannot() -> None:
    trials, cannot = all_trials()
    cells = [(t.driver, t.fault) for t in trials]
    assert len(set(cells)) == len(cells)
    drivers = {driver for driver, _ in cells}
    # What trackers and arms meet stands on their own pages, with their own tests.
    others = {"tracker", "arm"}
    emulated = {
        name
        for name, bench in BENCHES.items()
        if "another process" in bench.summary and driver_class(name).kind not in others
    }
    assert {d.split(" ")[0] for d in drivers} == emulated
    for driver in drivers:
        assert driver_class(driver.split(" ")[0])
        for fault in FAULTS:
            assert ((driver, fault) in cells) != ((driver, fault) in cannot), (driver, fault)


def run(*words: str) -> dict[str, object]:
    words = (sys.executable, "-m", "tega_campaigns.faults", "--json", *words)
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    (line,) = done.stdout.splitlines()
    outcome: dict[str, object] = json.loads(line)
    return outcome


CELLS = [
    ("serial-emg", "unplug", "ends", "was lost"),
    ("hid-vest", "wrong version", "refused", "format version is 0x2"),
    ("spacemouse", "freeze", "falls silent", "watchdog"),
    ("spacemouse", "duplicate", "goes on", "changes nothing"),
    ("digit", "half packet", "falls silent", "torn"),
    ("allegro", "wrong version", "refused", "not 4"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("driver", "fault", "effect", "message"), CELLS)
def test_a_cell_is_made_by_running_into_the_fault(driver: str, fault: str, effect: str, message: str) -> None:
    outcome = run("--only", driver, "--fault", fault)
    assert outcome["effect"] == effect
    assert message in str(outcome["said"])


def test_the_page_has_a_cell_for_every_trial() -> None:
    trials, _ = all_trials()
    made = glance([(t, DriverOutcome(effect="goes on", said="")) for t in trials]).splitlines()
    page = (PROJECT / "docs" / "evidence" / "faults.md").read_text(encoding="utf-8")
    published = page.split("<!-- drivers: begin -->\n\n")[1].split("\n\n<!--")[0].splitlines()
    assert published[:2] == made[:2]
    tried = [[cell == "–" for cell in row.split(" | ")] for row in (*published, *made)]
    assert tried[: len(published)] == tried[len(published) :]
