# mypy: allow-untyped-defs, allow-incomplete-defs, allow-untyped-calls, allow-untyped-decorators
"""What a scene camera measured of a study's trials stands beside the raters' accounts, and a person corrects it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from tega.errors import InvalidValueError, RecordingError
from tega.ui.cli.main import cli
from tega_scene.courses import SceneRest
from tega_scene.layout import example_layout
from tega_scene.lens import Lens
from tega_scene.outcomes import SceneEvent, SceneOutcome
from tega_study.journal import Journal, events_path, read_events
from tega_study.measuring import MeasuredTrial, between, confirm_trial, measure_session, write_measured
from tega_study.observers import CAMERA, measured_path, read_measured, read_observers, saw_whole
from tega_study.plan import make_plan, read_plan, write_plan
from tega_study.privacy import export
from tega_study.score.accounts import agreements
from tega_study.trials import study_trials

BEGIN_NS = 5_000_000_000


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a study with one trial that was run and measured: lift-off, two slips."""
    folder = tmp_path / "study"
    plan = make_plan(participants=1, seed=1, objects=["bag"], trials=1, rest_s=0.1, simulated=True)
    write_plan(plan, folder)
    signed = read_plan(folder).settings.plan_sha256
    with Journal(events_path(folder, "p01")) as journal:
        journal.add("session_start", t_ns=0, source="auto", text=signed)
        start = journal.add("trial_start", t_ns=BEGIN_NS, trial=1, source="auto")
        journal.add("slip", t_ns=BEGIN_NS + 3_100_000_000, trial=1, source="experimenter")
        end = journal.add("trial_end", t_ns=BEGIN_NS + 8_000_000_000, trial=1, status="done", success=True)
    outcome = SceneOutcome(
        events=(
            SceneEvent("lift_off", 2.0, 0.01),
            SceneEvent("slip", 3.0, 0.012, 0.0052, 0.0001),
            SceneEvent("slip", 4.0, 0.012, 0.0031, 0.0001),
            SceneEvent("lifted", 5.0, 0.01),
            SceneEvent("placed", 7.5, 0.01, 0.0123, 0.0005),
        ),
        success=True,
        slid_m=0.0083,
        slid_error_m=0.0001,
        narrowing_m=None,
        narrowing_error_m=None,
        height_m=0.21,
        along_mm=0.3,
        across_mm=0.03,
        seen=1.0,
        placed=1.0,
        hand_seen=1.0,
        longest_gap_s=0.03,
        notes=("the object was out of sight for 0.30 s",),
        rest=SceneRest(
            at_mm=(-62.0, -86.6),
            error_mm=(0.5, 0.4),
            lean_deg=0.2,
            since_s=6.5,
            error_s=0.01,
            stood_s=1.5,
            let_go=True,
        ),
        off_mark_m=0.0123,
        off_mark_error_m=0.0005,
        on_mark=True,
    )
    write_measured(
        measured_path(folder, "p01"), signed, [(start, end, MeasuredTrial("p01", 1, 1, "bag", outcome))]
    )
    return folder


def test_the_camera_is_an_account_of_its_own(folder: Path) -> None:
    slips = [event for event in read_measured(folder, "p01") if event.kind == "slip"]
    assert [event.value for event in slips] == [5.2, 3.1]
    assert slips[0].text == "slip: 5.20 ± 0.10 mm, ± 12 ms"
    found = {(one.a, one.b): one for one in agreements(folder) if one.kind == "slip"}
    one = found["experimenter", CAMERA]
    assert (one.n_a, one.n_b) == (1, 2)
    assert one.f1 == pytest.approx(2 / 3)


def test_a_place_that_was_measured_is_compared_with_who_corrected_it_alone(folder: Path) -> None:
    measured = read_measured(folder, "p01")
    (there,) = (event for event in measured if event.kind == "placed")
    assert (there.t_ns, there.value) == (BEGIN_NS + 7_500_000_000, 12.3)
    assert there.text == "placed: 12.30 ± 0.50 mm, ± 10 ms"
    assert "stands at -62.00 ± 0.50 mm, -86.60 ± 0.40 mm, 0.2° from upright, still for 1.50 s, let go of" in [
        event.text for event in measured if event.kind == "note"
    ]
    confirm_trial(folder, "p01", 1, "r1", struck=(there.n,))
    confirm_trial(folder, "p01", 1, "r2", struck=(there.n,), added=(("placed", 7.0),))
    found = {(one.a, one.b): one for one in agreements(folder) if one.kind == "placed"}
    assert {pair: (one.n_a, one.n_b, one.f1) for pair, one in found.items() if CAMERA in pair} == {
        ("camera+r1", CAMERA): (0, 1, 0.0),
        ("camera+r2", CAMERA): (1, 1, 1.0),
    }
    assert not any("experimenter" in pair for pair in found)


def test_a_person_corrects_and_both_are_kept(folder: Path) -> None:
    before = measured_path(folder, "p01").read_bytes()
    struck = [event.n for event in read_measured(folder, "p01") if event.kind == "slip"][1]
    words = ["--rater", "r1", "--strike", str(struck), "--add", "drop=6.5"]
    message = CliRunner().invoke(cli, ["scene", "confirm", str(folder), "p01", "1", *words])
    assert message.exit_code == 0, message.output
    assert message.output == "p01 trial 1, as r1 has it: lift_off, slip, drop, placed\n"
    assert measured_path(folder, "p01").read_bytes() == before
    mine = read_observers(folder, "p01")["camera+r1"]
    assert saw_whole(mine, 1, 1)
    events = [(e.kind, (e.t_ns - BEGIN_NS) / 1e9) for e in mine if e.kind in {"slip", "drop"}]
    assert events == [("slip", 3.0), ("drop", 6.5)]
    with pytest.raises(InvalidValueError, match="confirmed trial 1 before"):
        confirm_trial(folder, "p01", 1, "r1")
    kinds = [event.kind for event in confirm_trial(folder, "p01", 1, "r2")]
    assert kinds == ["lift_off", "slip", "slip", "placed"]


def test_who_watched_comes_before_who_confirmed_the_camera(folder: Path) -> None:
    confirm_trial(folder, "p01", 1, "a")
    watched = events_path(folder, "p01").parent / "observers" / "rater.jsonl"
    watched.write_bytes(watched.with_name("camera+a.jsonl").read_bytes())
    assert list(read_observers(folder, "p01")) == ["rater", "camera+a"]


@pytest.mark.parametrize(
    ("trial", "options", "message"),
    [
        (2, {}, "not measured"),
        (1, {"struck": (999,)}, "event 999 is none of trial 1"),
        (1, {"added": (("lifted", 1.0),)}, "cannot be added"),
        (1, {"added": (("slip", 9.0),)}, "the trial lasts 8.00 s"),
    ],
)
def test_a_correction_of_what_is_not_there_is_refused(
    folder: Path, trial: int, options, message: str
) -> None:
    with pytest.raises(InvalidValueError, match=message):
        confirm_trial(folder, "p01", trial, "r1", **options)
    assert read_observers(folder, "p01") == {}


def test_a_video_without_a_time_code_says_nothing_of_a_session(folder: Path) -> None:
    video = folder / "cam.mp4"
    video.write_bytes(b"")
    with pytest.raises(RecordingError, match="no time code"):
        measure_session(folder, "p01", video, Lens(640, 480, 500.0, 500.0, 320.0, 240.0), example_layout())
    assert len(read_events(measured_path(folder, "p01"))) == 10


def test_each_trial_takes_its_pictures_from_one_pass_over_the_film() -> None:
    film = iter([(0.1 * k, np.full((2, 2), k, np.uint8)) for k in range(100)])
    first = [(t_s, int(image[0, 0])) for t_s, image in between(film, 1.05, 1.35)]
    assert [number for _, number in first] == [11, 12, 13]
    assert [t_s for t_s, _ in first] == pytest.approx([0.05, 0.15, 0.25])
    cut = between(film, 2.0, 3.0)
    next(cut)  # a trial that cannot be measured leaves the film in its middle
    second = [int(image[0, 0]) for _, image in between(film, 5.0, 5.25)]
    assert second == [50, 51, 52]
    assert list(between(film, 4.0, 4.5)) == []


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("front",), "a video needs --lens"),
        (("cam.mp4",), "a video needs --lens"),
        (("cam.mp4", "--camera", "front"), "a video is of one camera"),
    ],
)
def test_what_stands_alone_is_a_video_and_a_camera_is_named_as_one(
    folder: Path, words: tuple[str, ...], message: str
) -> None:
    done = CliRunner().invoke(cli, ["scene", "measure", str(folder), "p01", *words])
    assert done.exit_code == 2
    assert message in done.output


@pytest.mark.parametrize("dropped", [False, True])
def test_the_measured_outcome_counts_if_the_plan_says_so(folder: Path, *, dropped: bool) -> None:
    """The session says two things that the camera does not: one slip, and that the trial failed."""
    with Journal(events_path(folder, "p01")) as journal:
        journal.add("override", t_ns=BEGIN_NS + 9 * 10**9, trial=1, success=False, source="experimenter")
    (by_session,) = study_trials(folder)[1]
    assert (by_session.success, by_session.slips + by_session.slips_before) == (False, 1)
    assert by_session.counted_by == "the simulation and the experimenter"
    toml = folder / "study.toml"
    toml.write_text(f'scored_by = "camera"\n{toml.read_text(encoding="utf-8")}', encoding="utf-8")
    (by_camera,) = study_trials(folder)[1]
    assert (by_camera.success, by_camera.slips, by_camera.lift_off_s) == (True, 2, 2.0)
    assert (by_camera.rater, by_camera.counted_by) == (CAMERA, CAMERA)
    second = [event.n for event in read_measured(folder, "p01") if event.kind == "slip"][1]
    confirm_trial(folder, "p01", 1, "r1", struck=(second,), added=(("drop" if dropped else "slip", 6.0),))
    export(folder, folder.with_name("open"), key="secret")
    (corrected,), (copied,) = study_trials(folder)[1], study_trials(folder.with_name("open"))[1]
    assert corrected.counted_by == "camera+r1"
    for one in (corrected, copied):
        assert (one.slips, one.drops, one.success) == ((1, 1, False) if dropped else (2, 0, True))
