"""Replay of real recordings; skipped where they are absent."""

from __future__ import annotations

import csv
import json
from typing import Any

import pytest

from reference.command import call


def replay(capsys: pytest.CaptureFixture[str], *words: object) -> dict[str, Any]:
    summary: dict[str, Any] = json.loads(call(capsys, "replay", "--json", *words)[0])
    return summary


EMG = {
    "raw": ("my_thesis/recording_force_v1.mat", 200, "raw", "3,6,8"),
    "envelope": ("unibo_inail/user_1_day_1_posture_1.mat", 500, "envelope", "1,3,4"),
    "offset": ("biosppy/emg_1.txt", 1000, "raw", "1"),
}


@pytest.mark.slow
@pytest.mark.parametrize("preset", ["paper", "live"])
@pytest.mark.parametrize("emg", sorted(EMG))
def test_ball_presses_with_each_kind_of_emg(recordings, tmp_path, capsys, preset, emg):
    ball = recordings / "digit" / "digit_ball_D20641"
    file, rate_hz, kind, channels = EMG[emg]
    summary = replay(
        capsys, "--tactile", f"thumb={ball}", "--baseline", f"thumb={ball / 'background.png'}",
        "--emg", recordings / "emg" / file, "--emg-rate-hz", rate_hz, "--emg-kind", kind,
        "--emg-channels", channels, "--preset", preset, "--out", tmp_path,
    )  # fmt: skip
    # 31 presses; the baseline is no frame, nor is the picture of a calliper beside them.
    assert summary["tactile"]["thumb"]["frames"] == 31
    assert any("caliper.png: not named as the 31 other pictures" in note for note in summary["notes"])
    with (tmp_path / "contacts.csv").open(encoding="utf-8", newline="") as table:
        assert all(row["in_contact"] == "1" for row in csv.DictReader(table))
    seconds_at = {int(k): v for k, v in summary["hand"]["level_s"].items()}
    assert seconds_at[1] > 0
    assert sum(seconds_at[k] for k in (3, 4, 5)) > 0


@pytest.mark.slow
def test_two_fingers_of_one_grip(recordings, tmp_path, capsys):
    grips = recordings / "digit" / "gsmini_seq"
    words = []
    for finger, camera in (("thumb", 0), ("index", 2)):
        words += ["--tactile", f"{finger}={grips / f'wooden_statue_1_camera_{camera}.avi'}"]
    summary = replay(capsys, *words, "--out", tmp_path / "one")
    assert summary["duration_s"] == pytest.approx(141 / 25)
    assert all(f["baseline"].startswith("estimated") for f in summary["tactile"].values())
    contact: dict[str, list[str]] = {"thumb": [], "index": []}
    with (tmp_path / "one" / "contacts.csv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            contact[row["finger"]].append(row["in_contact"])
    for course in contact.values():
        assert course[40:90].count("1") == 50  # held
        assert course[125:].count("0") > 10  # released
    replay(capsys, *words, "--out", tmp_path / "two")
    for path in (tmp_path / "one").iterdir():
        assert path.read_bytes() == (tmp_path / "two" / path.name).read_bytes()
