# mypy: allow-untyped-defs, allow-incomplete-defs, allow-untyped-calls, allow-untyped-decorators
"""A person before a filmed bench: led by keys in a terminal, scored by rule, coded in BORIS, reported, sent on."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import pytest
from click.testing import CliRunner

cv2 = pytest.importorskip("cv2")
pytest.importorskip("av")
pytest.importorskip("foxglove")
pytest.importorskip("mujoco")
pytest.importorskip("tega_figures")

from reference.command import call  # noqa: E402
from reference.processes import in_terminal  # noqa: E402
from reference.scene import LIFT_S, SLIP_M, SLIP_S, SMALL, SPEED_M_S, known_lift, rendered  # noqa: E402
from reference.study_bench import events_of, quick_study  # noqa: E402
from reference.written import boris_project  # noqa: E402
from tega.recording.mcap_reader import McapReader  # noqa: E402
from tega.ui.cli.main import cli  # noqa: E402
from tega_scene.layout import save_layout  # noqa: E402
from tega_scene.lens import save_lens  # noqa: E402
from tega_study.journal import JournalEvent  # noqa: E402
from tega_study.lead.tell import board_path, read_board  # noqa: E402
from tega_study.observers import CAMERA, measured_path  # noqa: E402
from tega_study.plan import read_plan  # noqa: E402
from tega_study.score.clips import read_key  # noqa: E402

FATE: Final = {1: "drop", 2: "lift"}
"""What happens to the object in each trial."""
REST_S: Final = 8.0
"""The object stands before it is lifted: preparing a trial may take as long on a busy machine."""
RATE_HZ: Final = 15.0
"""Slower than a lab's camera: nothing may hang on how busy the machine is that runs this."""
FALL_S: Final = 1.6


class Filmed(NamedTuple):
    """The study, what its lab is, and what the camera measured of its trials."""

    folder: Path
    lab: Path
    trials: list[dict[str, Any]]


@pytest.fixture(scope="module")
def filmed(tmp_path_factory: pytest.TempPathFactory) -> Filmed:
    root = tmp_path_factory.mktemp("filmed")
    folder, lab = root / "study", root / "lab"
    lab.mkdir()
    quick_study(folder, seed=5, objects=["container"], window_s=25.0)
    lifts = {"lift": known_lift(), "drop": known_lift(dropped=True, slip_s=FALL_S, end_s=2.0)}
    length_s = {}
    for name, trial in lifts.items():
        scene = rendered(trial, rate_hz=RATE_HZ)
        images = [image for _, image in scene.pictures()]
        images = [images[0]] * round(REST_S * RATE_HZ) + images
        writer = cv2.VideoWriter(
            str(lab / f"{name}.avi"), cv2.VideoWriter.fourcc(*"MJPG"), RATE_HZ, (SMALL.width, SMALL.height)
        )
        for image in images:
            writer.write(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR))
        writer.release()
        length_s[name] = len(images) / RATE_HZ
        save_layout(lab / "tags.toml", scene.layout)
    save_lens(lab / "front.json", SMALL)
    led_by_keys(folder, lab, length_s)
    measured = CliRunner().invoke(cli, ["scene", "measure", str(folder), "p01", "--json"])
    assert measured.exit_code == 0, measured.output
    return Filmed(folder, lab, json.loads(measured.stdout)["trials"])


def led_by_keys(folder: Path, lab: Path, length_s: dict[str, float]) -> None:
    """Lead a session in a terminal, as somebody who looks at the screen and presses keys."""
    now = lab / "now.avi"
    camera = {
        "name": "front", "source": str(now), "width": SMALL.width, "height": SMALL.height, "rate_hz": RATE_HZ,
        "lens": str(lab / "front.json"), "layout": str(lab / "tags.toml"),
    }  # fmt: skip
    message = ", ".join(f"{key} = {json.dumps(value)}" for key, value in camera.items())
    words = ["--emulated", "--time-scale", "0.1", "--set", f"scene=[{{ {message} }}]"]
    with in_terminal("study", "run", folder, "p01", *words) as (process, ours, drawn):
        marked, end_s = set[tuple[int, int]](), time.monotonic() + 300
        while process.poll() is None:
            assert time.monotonic() < end_s, drawn()[-4000:].decode(errors="replace")
            drawn()
            board = read_board(board_path(folder, "p01"))
            if board is None:
                continue
            if board.phase == "questions":
                os.write(ours, b"\rk")  # whoever answers first says that they are there
            elif board.phase in {"ready", "waiting"} and board.trial == 0:
                os.write(ours, b"q")
            elif board.phase in {"ready", "waiting"}:
                now.unlink(missing_ok=True)
                now.symlink_to(lab / f"{FATE[board.trial]}.avi")
                os.write(ours, b"\r")
            elif (
                board.phase == "trial"
                and board.started_ns is not None
                and (board.trial, board.attempt) not in marked
            ):
                kind = FATE[board.trial]
                if time.monotonic_ns() > board.started_ns + round(1e9 * (length_s[kind] + 0.5)):
                    os.write(ours, b"  " if kind == "lift" else b"x")
                    marked.add((board.trial, board.attempt))
            time.sleep(0.2)
        assert process.returncode == 0, drawn()[-4000:].decode(errors="replace")
        assert b"scores the trials by rule" in drawn()


@pytest.fixture
def tega(capsys: pytest.CaptureFixture[str]) -> Callable[..., Any]:
    """Return what calls a command and returns what it printed as JSON."""
    return lambda *words: json.loads(call(capsys, *words, "--json")[0])


def own(folder: Path, trial: int) -> Path:
    """Return the recording of a trial."""
    planned, attempt = read_plan(folder).of("p01")[trial - 1], ended(folder)[trial].attempt
    (found,) = (folder / "recordings/p01" / f"{planned.id}-a{attempt}").glob("*.mcap")
    return found


def shown_s(recording: Path) -> list[float]:
    """Return the machine's clock at each picture of the film."""
    reader = McapReader(recording)
    shown_ns = [one.log_ns for one in reader.messages() if one.topic == "/scene/front/video"]
    reported = reader.metadata["tega"]
    return [(t_ns - int(reported["epoch_ns"]) + int(reported["start_ns"])) / 1e9 for t_ns in shown_ns]


def true_events(folder: Path, trial: int) -> list[tuple[str, float]]:
    """Return what the film shows, seconds of the machine's clock: the stamps of the pictures that show it."""
    events = {"lift_off": LIFT_S, "lifted": LIFT_S + 0.2 / SPEED_M_S + 1.0, "slip": SLIP_S}
    if FATE[trial] == "drop":
        events = {"lift_off": LIFT_S, "slip": FALL_S, "drop": FALL_S + 0.1}
    pictures_s = shown_s(own(folder, trial))
    at = (REST_S - 0.05 + np.array(list(events.values()))) * RATE_HZ
    return list(zip(events, np.interp(at, range(len(pictures_s)), pictures_s).tolist(), strict=True))


def ended(folder: Path) -> dict[int, JournalEvent]:
    """Return how each trial ended; on a busy machine an emulated device may have broken its first attempt off."""
    return {event.trial: event for event in events_of(folder) if event.kind == "trial_end"}


def started_ns(folder: Path) -> dict[int, int]:
    """Return when each trial that counts began."""
    return {event.trial: event.t_ns for event in events_of(folder) if event.kind == "trial_start"}


pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(1500),
    pytest.mark.skipif(os.name == "nt", reason="a pseudo terminal"),
]


def test_every_trial_is_filmed_into_its_own_recording(filmed: Filmed) -> None:
    starts = started_ns(filmed.folder)
    assert {n: end.success for n, end in ended(filmed.folder).items()} == {1: False, 2: True}
    for trial in FATE:
        reader = McapReader(own(filmed.folder, trial))
        n = sum(one.topic == "/scene/front/video" for one in reader.messages())
        summary = json.loads(reader.files["summary.json"])["scene"]["front"]
        assert n == summary["pictures"] == summary["seen"] - summary["dropped"]
        assert n > 30
        assert shown_s(own(filmed.folder, trial))[0] < starts[trial] / 1e9


def test_the_camera_scores_them_by_rule_and_a_rater_codes_them_in_boris(filmed, tega, tmp_path):
    folder = filmed.folder
    starts = started_ns(folder)
    for one in filmed.trials:
        assert one["problem"] == ""
        outcome, truth = one["outcome"], true_events(folder, one["trial"])
        assert outcome["success"] == (FATE[one["trial"]] == "lift")
        seen = [(e["kind"], e["t_s"] + starts[one["trial"]] / 1e9) for e in outcome["events"]]
        named = [(kind, t_s) for kind, t_s in seen if kind in dict(truth)]
        assert [kind for kind, _ in named] == [kind for kind, _ in truth]
        # How exact it is the page says.
        assert max(abs(a - b) for (_, a), (_, b) in zip(named, truth, strict=True)) < 2 / RATE_HZ
        if outcome["success"]:
            (slip,) = (e for e in outcome["events"] if e["kind"] == "slip")
            assert abs(slip["size_m"] - SLIP_M) < 0.002

    # The rater sees the object, codes what the film shows a tenth of a second late, and has not seen the measurement.
    out = tmp_path / "clips"
    made = tega("study", "clips", folder, out, "--rater", "r1")
    assert (made["clips"], made["left_out"]) == (2, [])
    capture = cv2.VideoCapture(str(out / "clip-001.avi"))
    _, image = capture.read()
    capture.release()
    assert image.shape[:2] == (240 + 28 + 480 + 28, 640)
    assert np.std(image[-400:]) > 20
    project = out / "r1.boris"
    tree = json.loads(project.read_text(encoding="utf-8"))
    for clip in read_key(folder, "r1").clips:
        start_s = starts[clip.trial] / 1e9
        tree["observations"][clip.name]["events"] = [
            [round(t_s - start_s + 0.1, 3), "container", kind, "None", ""]
            for kind, t_s in true_events(folder, clip.trial)
            if kind in {"lift_off", "slip", "drop"}
        ]
    project.write_text(json.dumps(tree), encoding="utf-8")
    opened = boris_project(project, media=True)  # by BORIS' own code, where that is installed
    assert opened is None or len(opened["observations"]) == 2
    taken = tega("study", "clips", folder, "--rater", "r1", "--take", project)
    assert taken["trials"] == {"p01": 2}
    pairs = tega("study", "score", folder, "--tolerance-s", "1")["agreements"]
    both = {(one["kind"], one["f1"]) for one in pairs if {one["a"], one["b"]} == {CAMERA, "r1"}}
    assert {("slip", 1.0), ("drop", 1.0)} <= both
    assert "camera" in Path(tega("study", "report", folder)["page"]).read_text(encoding="utf-8")


def test_the_bundle_is_the_same_session_elsewhere_and_is_measured_from_itself_alone(filmed, tega, tmp_path):
    folder = filmed.folder
    bundle = tmp_path / "p01.zip"
    tega("study", "bundle", folder, "p01", bundle)
    there = tmp_path / "elsewhere"
    there.mkdir()
    moved = there / "received.zip"
    bundle.rename(moved)
    hidden = filmed.lab.rename(filmed.lab.with_name("gone"))  # lens, tags and films stay where they were made
    try:
        opened = tega("study", "open", moved, "--out", there / "session")
        assert (opened["same"], opened["trials"]) == (True, 2)
        kept = measured_path(there / "session", "p01")
        assert kept.read_bytes() == measured_path(folder, "p01").read_bytes()
        kept.unlink()
        assert tega("scene", "measure", there / "session", "p01")["trials"] == filmed.trials
        assert kept.read_bytes() == measured_path(folder, "p01").read_bytes()
    finally:
        hidden.rename(filmed.lab)
