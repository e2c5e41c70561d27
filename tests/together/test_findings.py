"""What replay and verify find: said in words, and drawn as a picture."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from reference.command import call
from reference.recordings import write_folder
from tega.records import Contact, Intent, VestFrame
from tega.records.bus import Bus
from tega.ui.view.course import RunCourse


@pytest.fixture
def course() -> RunCourse:
    """Two presses of the thumb, none of the ring finger, a grip that tightens, and one motor that is on."""
    bus = Bus()
    course = RunCourse(bus)
    for k in range(100):
        pressed = 20 <= k < 40 or 60 <= k < 70
        share = 0.8 if k == 30 else 0.4 if pressed else 0.0
        bus.publish(
            Contact(finger="thumb", t_ns=k * 10**7, in_contact=pressed, cci_norm=share, eda_norm=share / 2)
        )
        bus.publish(Contact(finger="ring", t_ns=k * 10**7, in_contact=False))
        motors = [0] * 16
        motors[5] = 70 if k == 50 else 30 if k >= 50 else 0
        bus.publish(VestFrame(t_ns=k * 10**7, layout="x16", intensities=tuple(motors)))
    for k, level in enumerate((1, 1, 3, 4, 4, 2)):
        bus.publish(Intent(t_ns=k * 10**8, level=level))
    return course


def test_words_say_what_each_part_did(course: RunCourse) -> None:
    assert course.words() == [
        "thumb: 2 contacts, 0.3 s in all, the first at 0.2 s; most at 0.3 s (CCI 80 %, EDA 40 % of the maximum)",
        "ring: never touched",
        "level: 3 changes, from 1 to 2; tightest 4, first at 0.3 s",
        "vest: on in 50 % of its frames; strongest 70 % at 0.5 s (front column 2)",
    ]
    assert course.words(pose_base=0)[2] == "level: 3 changes, from 0 to 1; tightest 3, first at 0.3 s"


def test_a_vest_that_says_nothing_and_a_run_without_anything() -> None:
    bus = Bus()
    course = RunCourse(bus)
    assert course.words() == []
    bus.publish(VestFrame(t_ns=0, layout="x16", intensities=(0,) * 16))
    assert course.words() == ["vest: silent throughout"]


def test_motors_are_in_the_order_in_which_they_are_worn(course: RunCourse) -> None:
    vest = course.vest
    assert vest is not None
    (row,) = np.flatnonzero(vest.intensities.any(axis=0))
    # Motor 5 of the layout is the lower one of the front's second column.
    assert vest.motors[row] == vest.motors[row - 1] == "front column 2"
    assert vest.motors[row + 1] == "front column 3"
    assert vest.motors[8] == "back column 1"


def test_a_brief_pulse_is_in_the_picture_of_a_long_run() -> None:
    pytest.importorskip("matplotlib", reason="needs the extra pictures")
    from tega.ui.view.figures import draw_vest, new_figure
    from tega.ui.view.state import VestCourse

    intensities = np.zeros((10_000, 1), np.uint8)
    intensities[7777] = 90
    ax = new_figure(figsize=(4, 2)).subplots()
    draw_vest(ax, VestCourse(np.arange(10_000) / 100, intensities, ("motor 0",)))
    (mesh,) = ax.collections
    displayed = np.asarray(mesh.get_array())
    assert displayed.size < 1000
    assert displayed.max() == 90


@pytest.fixture
def presses(tmp_path: Path) -> Path:
    write_folder(tmp_path / "presses", 30)
    return tmp_path / "presses"


def test_loose_files_leave_a_picture_and_words(
    presses: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("matplotlib", reason="needs the extra pictures")
    out = tmp_path / "out"
    text, _ = call(capsys, "replay", "--tactile", f"thumb={presses}", "--out", out)
    assert "  thumb: 3 contacts, " in text
    assert "  vest: on in " in text
    assert (out / "picture.png").read_bytes().startswith(b"\x89PNG")


def test_without_matplotlib_there_are_words_and_the_line_that_installs_it(
    presses: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in [name for name in sys.modules if name.split(".")[0] == "matplotlib"] + ["matplotlib"]:
        monkeypatch.setitem(sys.modules, name, None)
    words = ("replay", "--tactile", f"thumb={presses}", "--out", tmp_path / "out")
    text, noted = call(capsys, *words)
    assert "thumb: " in text
    assert "no picture: matplotlib is not installed; pip install '" in noted
    assert not (tmp_path / "out/picture.png").exists()
    # Who asks for the picture gets it or no run at all.
    _, noted = call(capsys, *words, "--picture", tmp_path / "mine.png", code=3)
    assert "[pictures]'" in noted


def test_a_session_is_told_and_drawn(
    lossless: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("matplotlib", reason="needs the extra pictures")
    text, _ = call(capsys, "verify", lossless, "--picture", tmp_path / "verify.png")
    assert "  thumb: " in text
    assert f"  picture: {tmp_path / 'verify.png'}" in text
    assert (tmp_path / "verify.png").read_bytes().startswith(b"\x89PNG")
    assert sorted(path.name for path in lossless.parent.iterdir()) == sorted({lossless.name, "session.json"})
