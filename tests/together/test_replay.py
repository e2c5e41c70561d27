"""Replay from one end to the other, through the command line."""

from __future__ import annotations

import csv
import json
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

from reference.processes import until
from reference.recordings import baseline, squeezes, write_emg_csv, write_folder, write_video
from tega.config.calibration import Calibration, TouchMaxima, save_calibration
from tega.config.calibration.store import parse_calibration
from tega.config.choose import preset_metric
from tega.errors import CalibrationError
from tega.haptics import intensity
from tega.recording.run_tables import prepare_folder
from tega.ui.cli.main import main
from tega.ui.view import course as view_session

OUTPUTS = [
    "calibration.toml", "can.csv", "contacts.csv", "events.csv", "levels.csv", "summary.json", "vest.csv",
]  # fmt: skip

Replay = Callable[..., dict[str, Any]]


@pytest.fixture(autouse=True)
def _no_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out the drawing, which takes longer than all else; `test_findings.py` looks at it."""
    monkeypatch.setattr(
        view_session, "SessionPicture", lambda *_: SimpleNamespace(write=lambda *_, **__: None)
    )


@pytest.fixture
def replay(capsys: pytest.CaptureFixture[str]) -> Replay:
    """Run the verb and return its summary; fail with what it said if it fails."""

    def run(*words: object, code: int = 0) -> dict[str, Any]:
        with pytest.raises(SystemExit) as ended:
            main(["replay", "--json", *map(str, words)])
        out, err = capsys.readouterr()
        assert ended.value.code == code, err
        summary: dict[str, Any] = json.loads(out) if code == 0 else {"stderr": err}
        return summary

    return run


@pytest.fixture
def press(tmp_path: Path) -> list[object]:
    """Two fingers, one as pictures with the baseline among them, one as video, and three EMG channels."""
    folder = write_folder(tmp_path / "thumb", 60)
    cv2.imwrite(str(folder / "gel.png"), baseline())
    write_video(tmp_path / "ring.avi", 30, rate_hz=25, seed=3)
    np.save(tmp_path / "ring_gel.npy", baseline(3))
    samples = squeezes(600, 200.0, channels=5)
    write_emg_csv(tmp_path / "emg.csv", samples, header=[f"m{k}" for k in range(5)])
    return [
        "--tactile", f"thumb={folder}", "--baseline", f"thumb={folder / 'gel.png'}",
        "--tactile", f"ring={tmp_path / 'ring.avi'}", "--baseline", f"ring={tmp_path / 'ring_gel.npy'}",
        "--emg", tmp_path / "emg.csv", "--emg-rate-hz", 200, "--emg-kind", "raw", "--emg-channels", "2,5,3",
    ]  # fmt: skip


def table(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize("preset", ["paper", "live"])
def test_the_tables_say_what_the_functions_say(
    replay: Replay, press: list[object], tmp_path: Path, preset: Any
) -> None:
    out = tmp_path / "out"
    # Equal steps, the mapping of `live`, have a reference of their own.
    summary = replay(*press, "--preset", preset, "--set", "stages.mapping.name=columns", "--out", out)
    assert sorted(p.name for p in out.iterdir()) == OUTPUTS
    contacts = table(out / "contacts.csv")
    thumb = [row for row in contacts if row["finger"] == "thumb"]
    assert [row["t_s"] for row in thumb] == [f"{k / 60:.6f}" for k in range(60)]
    assert [row["t_s"] for row in contacts if row["finger"] == "ring"] == [f"{k / 25:.6f}" for k in range(30)]
    times = [float(row["t_s"]) for row in contacts]
    assert times == sorted(times)
    maxima = summary["tactile"]["thumb"]
    measured = []
    metric = preset_metric(preset, baseline())
    for k, row in enumerate(thumb):
        image = cv2.imread(str(tmp_path / "thumb" / f"frame_{k}.png"))
        assert image is not None
        m = metric.update(np.asarray(image, np.uint8), round(k * 1e9 / 60))
        measured.append(m)
        assert (float(row["cci"]), int(row["eda"]), float(row["peak"])) == (m.cci, m.eda, m.peak)
        assert row["in_contact"] == str(int(m.in_contact))
        front = intensity(m.cci, maxima["cci_max"]) if m.in_contact else 0.0
        back = intensity(m.eda, maxima["eda_max"]) if m.in_contact else 0.0
        assert (float(row["front"]), float(row["back"])) == (front, back)
        share = min(m.eda / maxima["eda_max"], 1.0) if m.in_contact else 0.0
        assert float(row["eda_norm"]) == share
    edas = [m.eda for m in measured if m.in_contact]
    assert maxima["eda_max"] == np.percentile(edas, 99.5)
    assert maxima["cci_max"] == np.percentile([m.cci for m in measured if m.in_contact and m.eda >= 30], 99.5)


def test_the_vest_shows_the_newest_frame_and_ends_silent(
    replay: Replay, press: list[object], tmp_path: Path
) -> None:
    replay(*press, "--preset", "paper", "--out", tmp_path / "out")
    rows = table(tmp_path / "out" / "vest.csv")
    contacts = [row for row in table(tmp_path / "out" / "contacts.csv") if row["finger"] == "thumb"]
    assert list(rows[0]) == ["t_s", *(f"m{m}" for m in (*range(16), *range(20, 36)))]
    assert [row["t_s"] for row in rows] == [*(f"{k / 30:.6f}" for k in range(90)), "3.000000"]
    for row in rows[:30]:
        newest = [c for c in contacts if float(c["t_s"]) <= float(row["t_s"])][-1]
        assert row["m0"] == row["m12"] == str(round(float(newest["front"])))
        assert row["m20"] == str(round(float(newest["back"])))
    # The thumb's last frame is at 59/60 s; from 100 ms later on nothing is left of it.
    assert all(row["m0"] == row["m20"] == "0" for row in rows if float(row["t_s"]) > 59 / 60 + 0.1)
    assert set(list(rows[-1].values())[1:]) == {"0"}


def test_levels_and_can_frames(replay: Replay, press: list[object], tmp_path: Path) -> None:
    summary = replay(*press, "--out", tmp_path / "out")
    levels = table(tmp_path / "out" / "levels.csv")
    assert list(levels[0]) == ["t_s", "ch2", "ch5", "ch3", "fused", "closure", "confidence"]
    assert [row["t_s"] for row in levels] == [f"{k / 10:.6f}" for k in range(1, 31)]
    assert {int(row["fused"]) for row in levels} <= {1, 2, 3, 4, 5}
    assert len({row["fused"] for row in levels}) > 2
    frames = table(tmp_path / "out" / "can.csv")
    assert [f["id"] for f in frames[:4]] == ["180", "184", "188", "18C"]
    assert all(len(f["data"]) == 16 for f in frames[:-1])
    assert [(f["t_s"], f["id"], f["data"]) for f in frames[-5:]] == [
        ("3.000000", i, "0" * 16) for i in ("180", "184", "188", "18C")
    ] + [("3.000000", "104", "")]
    ticks = len(range(0, 3000, 3))
    assert len(frames) == 4 * ticks + 5
    assert summary["hand"]["ticks"] == ticks
    assert summary["hand"]["model"].startswith("modelled")
    assert frames[4]["t_s"] == "0.003000"
    assert any(f["data"].strip("0") for f in frames)


def test_a_calibration_from_a_run_gives_the_same_tables(
    replay: Replay, press: list[object], tmp_path: Path
) -> None:
    first = replay(*press, "--out", tmp_path / "one")
    assert first["calibration"]["self_calibrated"] is True
    assert "cannot be reproduced live" in first["notes"][0]
    again = replay(*press, "--calibration", tmp_path / "one" / "calibration.toml", "--out", tmp_path / "two")
    assert again["calibration"] == {
        **first["calibration"],
        "file": "calibration.toml",
        "self_calibrated": False,
    }
    for name in OUTPUTS:
        if name != "summary.json":
            assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()
    assert first["notes"][1:] == again["notes"]


def test_a_calibration_that_does_not_fit_is_refused(
    replay: Replay, press: list[object], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    replay(*press, "--out", tmp_path / "one")
    calibration = tmp_path / "one" / "calibration.toml"
    for change, message in (
        (["--preset", "paper"], "made with preset 'live', the run uses 'paper'"),
        (["--emg-kind", "envelope"], "made for emg kind = 'raw', the run has 'envelope'"),
        (["--emg-rate-hz", "250"], "made for emg rate_hz = 200.0, the run has 250.0"),
        (["--emg-channels", "2,3,5"], "made for emg channels = ('ch2', 'ch5', 'ch3')"),
        (["--tactile", "index=thumb"], "has no maxima for finger 'index'"),
    ):
        failed = replay(*press, *change, "--calibration", calibration, "--out", tmp_path / "two", code=1)
        assert f"error: calibration.toml: {message}" in failed["stderr"]
        assert "hint: " in failed["stderr"]


def test_a_calibration_file_with_mistakes_is_refused() -> None:
    for text, message in (
        ("preset = 3", "preset = 3: "),
        ('preset = "live"\norigin = "x"\nspeed = 1', "speed: unknown key"),
        ('preset = "live"\norigin = "x"\n[tactile.thumb]\neda_max = -3', "tactile.thumb.eda_max = -3: "),
        ('preset = "live"\norigin = "x"\n[tactile.thumb]\neda_max = nan', "tactile.thumb.eda_max = nan: "),
        ("[", "not valid TOML"),
    ):
        with pytest.raises(CalibrationError, match=re.escape(f"c.toml: {message}")):
            parse_calibration(text, "c.toml")


def test_touch_alone_and_muscles_alone(replay: Replay, press: list[object], tmp_path: Path) -> None:
    touch = replay(*press[:4], "--out", tmp_path / "touch")
    assert (touch["emg"], touch["hand"]["ticks"], touch["vest"]["frames"]) == (None, 0, 30)
    assert (tmp_path / "touch" / "levels.csv").read_text() == "t_s,fused,closure,confidence\n"
    assert len(table(tmp_path / "touch" / "can.csv")) == 5  # only the way out
    muscles = replay(*press[8:], "--out", tmp_path / "muscles")
    assert (muscles["tactile"], muscles["hand"]["ticks"], muscles["vest"]["frames"]) == ({}, 1000, 0)
    assert table(tmp_path / "muscles" / "contacts.csv") == []


def test_without_a_baseline_it_is_estimated_and_said(replay: Replay, tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "thumb", 60)
    summary = replay("--tactile", f"thumb={folder}", "--out", tmp_path / "out")
    assert (
        summary["tactile"]["thumb"]["baseline"] == "estimated from the quietest of the recording's 60 frames"
    )
    contact = [row["in_contact"] for row in table(tmp_path / "out" / "contacts.csv")]
    assert contact[5] == "1"
    assert contact[15] == "0"


def test_a_finger_that_never_touches_stays_silent(replay: Replay, tmp_path: Path) -> None:
    for k in range(20):
        path = tmp_path / "thumb" / f"{k}.png"
        path.parent.mkdir(exist_ok=True)
        cv2.imwrite(str(path), baseline())
    np.save(tmp_path / "gel.npy", baseline())
    words = ["--tactile", f"thumb={tmp_path / 'thumb'}", "--baseline", f"thumb={tmp_path / 'gel.npy'}"]
    summary = replay(*words, "--out", tmp_path / "out")
    assert (summary["tactile"]["thumb"]["cci_max"], summary["tactile"]["thumb"]["eda_max"]) == (None, None)
    assert any("no press was seen" in note for note in summary["notes"])
    assert {row["m0"] for row in table(tmp_path / "out" / "vest.csv")} == {"0"}
    replay(*words, "--calibration", tmp_path / "out" / "calibration.toml", "--out", tmp_path / "two")


@pytest.mark.slow
def test_a_source_that_ends_early_is_said(replay: Replay, press: list[object], tmp_path: Path) -> None:
    notes = replay(*press, "--out", tmp_path / "out")["notes"]
    assert "thumb: ended at 1.000 s, silent 100 ms later" in notes
    longer = write_folder(tmp_path / "index", 240)
    notes = replay(*press, "--tactile", f"index={longer}", "--out", tmp_path / "out")["notes"]
    assert "emg: ended at 3.000 s, its last level held to the end" in notes


def test_emg_samples_that_are_no_numbers_are_held_and_counted(replay: Replay, tmp_path: Path) -> None:
    samples = squeezes(600, 200.0, channels=3)
    samples[0, 1] = samples[300:304, 0] = np.nan
    np.save(tmp_path / "e.npy", samples)
    how = "--emg-rate-hz", 200, "--emg-kind", "raw", "--out", tmp_path / "out"
    summary = replay("--emg", tmp_path / "e.npy", *how)
    assert summary["emg"]["held_samples"] == [4, 1, 0]
    assert "emg: ch1: 4 samples were missing or no numbers; the one before was held" in summary["notes"]


def test_a_folder_that_is_not_ours_is_left_alone(replay: Replay, press: list[object], tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "thesis.txt").write_text("years of work")
    failed = replay(*press[8:], "--out", out, code=1)
    assert "output folder 'out' is not empty and holds no earlier run" in failed["stderr"]
    (out / "summary.json").write_text('{"format": "other"}')
    replay(*press[8:], "--out", out, code=1)
    assert sorted(p.name for p in out.iterdir()) == ["summary.json", "thesis.txt"]
    failed = replay(*press[8:], "--out", out / "thesis.txt", code=1)
    assert "output folder 'thesis.txt' is a file" in failed["stderr"]


def test_a_run_that_was_killed_leaves_a_folder_that_the_next_one_takes(tmp_path: Path) -> None:
    settings = tmp_path / "s.toml"
    settings.write_text(
        '[session]\npace = "real"\nout_dir = "out"\n'
        '[tactile.thumb]\ndriver = "synthetic-touch"\noptions = {duration_s = 600.0}\n'
        '[calibration]\nfile = "calibration.toml"\n'
    )
    save_calibration(
        Calibration(
            preset="live",
            origin="made up",
            tactile={"thumb": TouchMaxima(cci_max=1.0, eda_max=100.0)},
        ),
        tmp_path / "calibration.toml",
    )
    words = [sys.executable, "-m", "tega.ui.cli", "run", str(settings)]
    with subprocess.Popen(words, stdout=subprocess.DEVNULL) as running:
        until(lambda: (tmp_path / "out" / "vest.csv").exists() or running.poll() is not None)
        running.kill()
    begun = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert begun["ended"] == "not yet, or it was killed"
    again = [*words, "--set", "session.duration_s=0.2"]
    subprocess.run(again, stdout=subprocess.DEVNULL, check=True, timeout=120)
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["ended"] == "duration"


def test_the_results_of_an_earlier_run_are_kept_and_told(
    press: list[object], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    kept, reported = [], []
    for number in range(3):
        with pytest.raises(SystemExit, match="0"):
            main(["replay", "--json", *map(str, press), "--out", str(out)])
        reported.append(capsys.readouterr().err)
        (out / "vest.csv").write_text(f"of run {number}\n")
        kept.append({name: (out / name).read_bytes() for name in OUTPUTS})
    for number in (1, 2):
        below = out / f"earlier-{number}"
        assert {path.name: path.read_bytes() for path in below.iterdir()} == kept[number - 1]
        assert reported[number] == f"the earlier results in {out} are kept in {below}\n"
    assert sorted(path.name for path in out.iterdir()) == sorted([*OUTPUTS, "earlier-1", "earlier-2"])


def test_a_run_that_left_nothing_leaves_no_folder(tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert [prepare_folder(out) for _ in range(3)] == [None] * 3
    (out / "vest.csv").write_text("t_s\n")
    assert prepare_folder(out) == out / "earlier-1"
    assert sorted(path.name for path in (out / "earlier-1").iterdir()) == ["summary.json", "vest.csv"]


def test_a_bad_frame_met_while_running_fails_the_run_and_still_leaves_silence(
    replay: Replay, press: list[object], tmp_path: Path
) -> None:
    replay(*press, "--out", tmp_path / "one")
    torn = tmp_path / "thumb" / "frame_40.png"
    torn.write_bytes(torn.read_bytes()[:-40])
    words = ["--calibration", tmp_path / "one" / "calibration.toml", "--out", tmp_path / "two"]
    assert "error: frame_40.png: PNG cut short" in replay(*press, *words, code=1)["stderr"]
    rows, frames = table(tmp_path / "two" / "vest.csv"), table(tmp_path / "two" / "can.csv")
    assert 0.6 < float(rows[-1]["t_s"]) < 0.7
    assert set(list(rows[-1].values())[1:]) == {"0"}
    assert [f["id"] for f in frames[-5:]] == ["180", "184", "188", "18C", "104"]
    summary = json.loads((tmp_path / "two" / "summary.json").read_text())
    assert summary["ended"] == "failed"
    assert summary["error"].startswith("frame_40.png: PNG cut short")
    replay(*press[8:], "--out", tmp_path / "two")  # a failed run may be replaced


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "nothing to replay"),
        (["--tactile", "thumb"], "'thumb' is not FINGER=PATH"),
        (["--tactile", "=x"], "'=x' is not FINGER=PATH"),
        (["--tactile", "thumb=a", "--tactile", "thumb=b"], "--tactile thumb is given twice"),
        (["--tactile", "thumb=a", "--baseline", "ring=b"], "--baseline ring: there is no --tactile ring"),
        (["--emg", "e.csv"], "--emg needs --emg-kind"),
        (["--emg", "e.csv", "--emg-rate-hz", "0"], "--emg-rate-hz"),
        (["--emg", "e.csv", "--emg-channels", "0,1"], "'0,1' is not a list of channel numbers from 1"),
        (["--emg", "e.csv", "--emg-kind", "noisy"], "--emg-kind"),
    ],
)
def test_wrong_use_is_told_with_code_2(
    replay: Replay, tmp_path: Path, words: list[str], message: str
) -> None:
    stderr = replay(*words, "--out", tmp_path / "out", code=2)["stderr"]
    assert stderr.startswith("error: ")
    assert message in stderr
    assert "hint: tega-teleop replay --help" in stderr


def test_a_rate_too_low_for_a_block_says_so(replay: Replay, tmp_path: Path) -> None:
    np.save(tmp_path / "e.npy", squeezes(60, 4.0))
    words = ["--emg", tmp_path / "e.npy", "--emg-rate-hz", 4, "--emg-kind", "raw", "--out", tmp_path / "out"]
    assert "EMG rate_hz = 4: a block of 100 ms holds no sample" in replay(*words, code=1)["stderr"]


def test_a_channel_that_never_moves_is_named_by_its_number(replay: Replay, tmp_path: Path) -> None:
    samples = squeezes(600, 200.0, channels=6)
    samples[:, 5] = 0.0
    np.save(tmp_path / "e.npy", samples)
    how = "--emg-rate-hz", 200, "--emg-kind", "envelope", "--emg-channels", "3,6"
    message = replay("--emg", tmp_path / "e.npy", *how, "--out", tmp_path / "out", code=1)["stderr"]
    assert "error: EMG e.npy, channels ch3, ch6: maximum of channel 2" in message
