"""Replay from one end to the other, through the command line."""

from __future__ import annotations

import csv
import functools
import io
import json
import shutil
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

from reference.recordings import baseline, squeezes, write_emg_csv, write_folder, write_video
from tega.config.choose import preset_metric
from tega.haptics import intensity
from tega.recording.run_tables import prepare_folder
from tega.ui.cli.main import main
from tega.ui.view import course as view_session

OUTPUTS = [
    "calibration.toml", "can.csv", "contacts.csv", "events.csv", "levels.csv", "summary.json", "vest.csv",
]  # fmt: skip

# Equal steps, the mapping of `live`, have a reference of their own.
COLUMNS = ("--set", "stages.mapping.name=columns")

Ran = Callable[[str], tuple[dict[str, Any], Path]]


@pytest.fixture(scope="module", autouse=True)
def _no_picture() -> Iterator[None]:
    """Leave out the drawing, which takes longer than all else; `test_cli.py` looks at it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(view_session, "SessionPicture", lambda *_: SimpleNamespace(write=lambda *_, **__: None))
        yield


def replay(*words: object, code: int = 0) -> dict[str, Any]:
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err), pytest.raises(SystemExit) as ended:
        main(["replay", "--json", *map(str, words)])
    assert ended.value.code == code, err.getvalue()
    summary: dict[str, Any] = json.loads(out.getvalue()) if code == 0 else {}
    return summary | {"stderr": err.getvalue()}


@pytest.fixture(scope="module")
def press(tmp_path_factory: pytest.TempPathFactory) -> list[object]:
    """Two fingers, one as pictures with the baseline among them, one as video, and three EMG channels."""
    inputs = tmp_path_factory.mktemp("inputs")
    folder = write_folder(inputs / "thumb", 60)
    cv2.imwrite(str(folder / "gel.png"), baseline())
    write_video(inputs / "ring.avi", 30, rate_hz=25, seed=3)
    np.save(inputs / "ring_gel.npy", baseline(3))
    samples = squeezes(600, 200.0, channels=5)
    write_emg_csv(inputs / "emg.csv", samples, header=[f"m{k}" for k in range(5)])
    return [
        "--tactile", f"thumb={folder}", "--baseline", f"thumb={folder / 'gel.png'}",
        "--tactile", f"ring={inputs / 'ring.avi'}", "--baseline", f"ring={inputs / 'ring_gel.npy'}",
        "--emg", inputs / "emg.csv", "--emg-rate-hz", 200, "--emg-kind", "raw", "--emg-channels", "2,5,3",
    ]  # fmt: skip


@pytest.fixture(scope="module")
def ran(press: list[object], tmp_path_factory: pytest.TempPathFactory) -> Ran:
    """A function that returns summary and folder of a run with one of the presets, or with a part of the inputs."""
    words = {
        "live": (*press, "--preset", "live", *COLUMNS),
        "paper": (*press, "--preset", "paper"),
        "touch": press[:4],
        "muscles": press[8:],
    }

    @functools.cache
    def run(name: str) -> tuple[dict[str, Any], Path]:
        out = tmp_path_factory.mktemp(name) / "out"
        return replay(*words[name], "--out", out), out

    return run


def table(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize("preset", ["paper", "live"])
def test_the_tables_say_what_the_functions_say(ran: Ran, press: list[object], preset: Any) -> None:
    summary, out = ran(preset)
    assert sorted(p.name for p in out.iterdir()) == OUTPUTS
    contacts = table(out / "contacts.csv")
    thumb = [row for row in contacts if row["finger"] == "thumb"]
    assert [row["t_s"] for row in thumb] == [f"{k / 60:.6f}" for k in range(60)]
    assert [row["t_s"] for row in contacts if row["finger"] == "ring"] == [f"{k / 25:.6f}" for k in range(30)]
    times = [float(row["t_s"]) for row in contacts]
    assert times == sorted(times)
    maxima, folder = summary["tactile"]["thumb"], Path(str(press[1]).partition("=")[2])
    measured = []
    metric = preset_metric(preset, baseline())
    for k, row in enumerate(thumb):
        image = cv2.imread(str(folder / f"frame_{k}.png"))
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


def test_levels_and_can_frames(ran: Ran) -> None:
    summary, out = ran("live")
    levels = table(out / "levels.csv")
    assert list(levels[0]) == ["t_s", "ch2", "ch5", "ch3", "fused", "closure", "confidence"]
    assert [row["t_s"] for row in levels] == [f"{k / 10:.6f}" for k in range(1, 31)]
    assert {int(row["fused"]) for row in levels} <= {1, 2, 3, 4, 5}
    assert len({row["fused"] for row in levels}) > 2
    frames = table(out / "can.csv")
    assert [f["id"] for f in frames[:4]] == ["180", "184", "188", "18C"]
    assert all(len(f["data"]) == 16 for f in frames[:-1])
    limp = [("3.000000", i, "0" * 16) for i in ("180", "184", "188", "18C")]
    assert [(f["t_s"], f["id"], f["data"]) for f in frames[-5:]] == [*limp, ("3.000000", "104", "")]
    ticks = len(range(0, 3000, 3))
    assert len(frames) == 4 * ticks + 5
    assert summary["hand"]["ticks"] == ticks
    assert summary["hand"]["model"].startswith("modelled")
    assert frames[4]["t_s"] == "0.003000"
    assert any(f["data"].strip("0") for f in frames)


def test_a_calibration_from_a_run_gives_the_same_tables(ran, press, tmp_path):
    first, one = ran("live")
    assert first["calibration"]["self_calibrated"] is True
    assert "cannot be reproduced live" in first["notes"][0]
    again = replay(*press, *COLUMNS, "--calibration", one / "calibration.toml", "--out", tmp_path)
    by_file = {"file": "calibration.toml", "self_calibrated": False}
    assert again["calibration"] == first["calibration"] | by_file
    for name in OUTPUTS:
        if name != "summary.json":
            assert (one / name).read_bytes() == (tmp_path / name).read_bytes()
    assert first["notes"][1:] == again["notes"]


def test_a_calibration_that_does_not_fit_is_refused(ran: Ran, press: list[object], tmp_path: Path) -> None:
    calibration = ran("live")[1] / "calibration.toml"
    for change, message in (
        (["--preset", "paper"], "made with preset 'live', the run uses 'paper'"),
        (["--emg-kind", "envelope"], "made for emg kind = 'raw', the run has 'envelope'"),
        (["--emg-rate-hz", "250"], "made for emg rate_hz = 200.0, the run has 250.0"),
        (["--emg-channels", "2,3,5"], "made for emg channels = ('ch2', 'ch5', 'ch3')"),
        (["--tactile", str(press[1]).replace("thumb=", "index=")], "has no maxima for finger 'index'"),
    ):
        failed = replay(*press, *change, "--calibration", calibration, "--out", tmp_path, code=1)
        assert f"error: calibration.toml: {message}" in failed["stderr"]
        assert "hint: " in failed["stderr"]


def test_touch_alone_and_muscles_alone(ran: Ran) -> None:
    touch, out = ran("touch")
    assert (touch["emg"], touch["hand"]["ticks"], touch["vest"]["frames"]) == (None, 0, 30)
    assert (out / "levels.csv").read_text() == "t_s,fused,closure,confidence\n"
    assert len(table(out / "can.csv")) == 5  # only the way out
    muscles, out = ran("muscles")
    assert (muscles["tactile"], muscles["hand"]["ticks"], muscles["vest"]["frames"]) == ({}, 1000, 0)
    assert table(out / "contacts.csv") == []


def test_without_a_baseline_it_is_estimated_and_said(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "thumb", 60)
    summary = replay("--tactile", f"thumb={folder}", "--out", tmp_path / "out")
    why = "estimated from the quietest of the recording's 60 frames"
    assert summary["tactile"]["thumb"]["baseline"] == why
    contact = [row["in_contact"] for row in table(tmp_path / "out" / "contacts.csv")]
    assert contact[5] == "1"
    assert contact[15] == "0"


def test_a_finger_that_never_touches_stays_silent(tmp_path: Path) -> None:
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


def test_a_source_that_ends_early_is_said(ran: Ran, press: list[object], tmp_path: Path) -> None:
    assert "thumb: ended at 1.000 s, silent 100 ms later" in ran("live")[0]["notes"]
    write_video(tmp_path / "index.avi", 20, rate_hz=5, seed=3)
    words = (*press[8:], "--tactile", f"index={tmp_path / 'index.avi'}", "--out", tmp_path / "out")
    assert "emg: ended at 3.000 s, its last level held to the end" in replay(*words)["notes"]


def test_emg_samples_that_are_no_numbers_are_held_and_counted(tmp_path: Path) -> None:
    samples = squeezes(600, 200.0, channels=3)
    samples[0, 1] = samples[300:304, 0] = np.nan
    np.save(tmp_path / "e.npy", samples)
    how = "--emg-rate-hz", 200, "--emg-kind", "raw", "--out", tmp_path / "out"
    summary = replay("--emg", tmp_path / "e.npy", *how)
    assert summary["emg"]["held_samples"] == [4, 1, 0]
    assert "emg: ch1: 4 samples were missing or no numbers; the one before was held" in summary["notes"]


def test_a_folder_that_is_not_ours_is_left_alone(press: list[object], tmp_path: Path) -> None:
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


def test_the_results_of_an_earlier_run_are_kept_and_told(ran, press, tmp_path):
    out = tmp_path / "out"
    shutil.copytree(ran("muscles")[1], out)
    for number in (1, 2):
        (out / "vest.csv").write_text(f"before run {number}\n")
        kept = {name: (out / name).read_bytes() for name in OUTPUTS}
        below = out / f"earlier-{number}"
        assert (
            replay(*press[8:], "--out", out)["stderr"]
            == f"the earlier results in {out} are kept in {below}\n"
        )
        assert {path.name: path.read_bytes() for path in below.iterdir()} == kept
    assert sorted(path.name for path in out.iterdir()) == sorted([*OUTPUTS, "earlier-1", "earlier-2"])


def test_a_run_that_was_killed_leaves_a_folder_that_the_next_one_takes(press, tmp_path):
    assert [prepare_folder(tmp_path) for _ in range(3)] == [None] * 3
    assert json.loads((tmp_path / "summary.json").read_text())["ended"] == "not yet, or it was killed"
    (tmp_path / "vest.csv").write_text("t_s\n")
    assert replay(*press[8:], "--out", tmp_path)["ended"] == "complete"
    assert sorted(path.name for path in (tmp_path / "earlier-1").iterdir()) == ["summary.json", "vest.csv"]


def test_a_bad_frame_met_while_running_fails_the_run_and_still_leaves_silence(ran, press, tmp_path):
    shutil.copytree(str(press[1]).partition("=")[2], tmp_path / "thumb")
    torn = tmp_path / "thumb" / "frame_40.png"
    torn.write_bytes(torn.read_bytes()[:-40])
    words = ["--calibration", ran("live")[1] / "calibration.toml", "--out", tmp_path / "two"]
    failed = replay("--tactile", f"thumb={torn.parent}", *press[2:], *words, code=1)
    assert "error: frame_40.png: PNG cut short" in failed["stderr"]
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
def test_wrong_use_is_told_with_code_2(tmp_path: Path, words: list[str], message: str) -> None:
    stderr = replay(*words, "--out", tmp_path / "out", code=2)["stderr"]
    assert stderr.startswith("error: ")
    assert message in stderr
    assert "hint: tega-teleop replay --help" in stderr


def test_a_rate_too_low_for_a_block_says_so(tmp_path: Path) -> None:
    np.save(tmp_path / "e.npy", squeezes(60, 4.0))
    words = ["--emg", tmp_path / "e.npy", "--emg-rate-hz", 4, "--emg-kind", "raw", "--out", tmp_path / "out"]
    assert "EMG rate_hz = 4: a block of 100 ms holds no sample" in replay(*words, code=1)["stderr"]


def test_a_channel_that_never_moves_is_named_by_its_number(tmp_path: Path) -> None:
    samples = squeezes(600, 200.0, channels=6)
    samples[:, 5] = 0.0
    np.save(tmp_path / "e.npy", samples)
    how = "--emg-rate-hz", 200, "--emg-kind", "envelope", "--emg-channels", "3,6"
    message = replay("--emg", tmp_path / "e.npy", *how, "--out", tmp_path / "out", code=1)["stderr"]
    assert "error: EMG e.npy, channels ch3, ch6: maximum of channel 2" in message
