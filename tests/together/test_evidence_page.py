"""The page on faults lists what every live driver compares of its stream's own evidence."""

from __future__ import annotations

from pathlib import Path

from tega.devices import driver_class, driver_names
from tega.devices.base import optional
from tega.runtime.evidence import EVIDENCE

LIVE = ("tactile", "emg", "hand", "tracker")
PAGE = Path(__file__).parents[2] / "docs" / "evidence" / "faults.md"


def test_the_page_lists_the_evidence_of_every_live_driver() -> None:
    text = PAGE.read_text(encoding="utf-8").partition("## Evidence")[2].partition("### Actions")[0]
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in text.splitlines()
        if line.startswith("| `")
    ]
    listed = {row[0].strip("`"): dict(zip(EVIDENCE, row[1:], strict=True)) for row in rows}
    compared = {
        name: {evidence: optional(driver_class(name), "compared").get(evidence, "–") for evidence in EVIDENCE}
        for name in driver_names()
        if driver_class(name).kind in LIVE and optional(driver_class(name), "compared")
    }
    assert listed == compared
    assert {"cyton", "chords", "spiker", "serial-emg", "lsl-emg", "brainflow"} <= set(compared)
    assert {"digit", "hololens", "openxr", "allegro"} <= set(compared)
