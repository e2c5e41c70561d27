"""A run streamed to Rerun: what a file that its own program reads holds, and what is said where no viewer is open."""

from __future__ import annotations

import re
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rerun", reason="needs the extra rerun")

from tega.errors import DeviceUnavailableError
from tega.haptics import FINGERS
from tega.records import Contact, Intent, Joints, Picture, RunState, Skip, VestFrame
from tega.records.bus import Bus
from tega_viewers.rerun_stream import RerunStream, save_layout

NAMES = (*FINGERS, "vest, percent", "closure level", "joint angles, rad", "states, alerts, events")


def printed(file: Path) -> str:
    """Return what Rerun's own program reads in a file."""
    command = [sys.executable, "-m", "rerun", "rrd", "print", "-vvv", str(file)]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def displayed(layout: Path) -> set[str]:
    """Return what the views of a layout are named, and what they show."""
    text = printed(layout)
    assert "Blueprint," in text
    parts = {part for cell in re.findall(r"\[([^\[\]]*)\]", text) for part in cell.split(", ")}
    return {part for part in parts if part.startswith("/")} | {name for name in NAMES if f"[{name}]" in text}


def test_the_saved_layout_is_the_one_that_is_sent_and_shows_what_a_stream_sends(tmp_path: Path) -> None:
    saved = Path(__file__).parents[2] / "docs/rerun-layout.rbl"
    save_layout(tmp_path / "layout.rbl")
    there = displayed(saved)
    assert there == displayed(tmp_path / "layout.rbl")
    assert set(NAMES) <= there
    bus, file = Bus(), tmp_path / "run.rrd"
    image = np.zeros((32, 24, 3), np.uint8)
    with RerunStream(bus, file=file) as stream:
        assert stream.url == str(file)
        bus.publish(RunState(t_ns=0, state="active", reason="all devices ready"))
        bus.publish(Skip(t_ns=8))
        for finger in FINGERS:
            bus.publish(Picture(finger=finger, image=image, t_ns=7, received_ns=7, seq=0, name="a picture"))
            bus.publish(Contact(finger=finger, t_ns=5, in_contact=True, cci_norm=0.25))
            bus.publish(Contact(finger="left_palm", t_ns=5, in_contact=True, cci_norm=0.25))
        bus.publish(Intent(t_ns=5, level=3))
        bus.publish(VestFrame(t_ns=6, layout="x16", intensities=(7,) * 16))
        bus.publish(Joints(t_ns=6, angles_rad=(0.1,) * 16))
    bus.publish(Intent(t_ns=9, level=3))  # nobody hears it any more
    assert bus.problem() == ""
    text = printed(file)
    sent = set(re.findall(r"entity_path: (/[a-z/]+)", text))
    assert "/run/state" in sent
    assert "/run/skipped" not in text
    lines = set(re.findall(r"[a-z]+ (?:CCI|EDA)", text))
    assert {f"{finger} {subject}" for finger in FINGERS for subject in ("CCI", "EDA")} <= lines
    assert "left_palm CCI" in text  # of another name: it has its lines and its view
    assert "[left_palm]" in text
    topics = {name for name in there if re.fullmatch(r"/[a-z]+(/[a-z]+)+", name)}
    assert len(topics) >= 7
    assert topics <= sent


def test_no_viewer_says_how_to_start_one() -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with pytest.raises(DeviceUnavailableError, match=r"no viewer listens.*start it first: rerun"):
        RerunStream(Bus(), port=port).__enter__()
