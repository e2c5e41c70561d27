# mypy: allow-untyped-defs, allow-incomplete-defs, allow-untyped-calls, allow-untyped-decorators
"""Blind clips of recorded trials: what a rater is given, what comes back from BORIS, what is refused and compared."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("foxglove")

import cv2
import msgspec
import numpy as np

from reference.clipped import LEAD_NS, LENGTH_NS, MS, PEOPLE, S, clipped_study, coded, planned
from reference.command import call
from reference.filmed import EPOCH_NS, number_of, packets, write_scene
from reference.sessions import read_recorded, record, reported
from reference.written import boris_project
from tega.errors import DeviceUnavailableError, InvalidValueError, RecordingError
from tega.records import Picture
from tega.runtime.files.boris import read_boris
from tega_study.detecting import DETECTOR
from tega_study.journal import read_events
from tega_study.observe.observing import Observing
from tega_study.observers import observer_path, read_observers, saw_whole
from tega_study.plan import StudyPlan, read_plan
from tega_study.privacy import withdraw
from tega_study.score.accounts import agreements
from tega_study.score.clips import key_path, make_clips, read_key, take_clips
from tega_study.score.recorded import RecordedTrial, read_reel, recorded_trials


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory, clipped: Path) -> Path:
    """Make clips for ``r1``, with proposals, and for ``r2``, beside a study."""
    where = tmp_path_factory.mktemp("clips")
    shutil.copytree(clipped, where / "study")
    for rater, proposals in (("r1", True), ("r2", False)):
        make_clips(where / "study", where / rater, rater, proposals=proposals)
    return where


@pytest.fixture
def made(tmp_path: Path, whole: Path) -> Path:
    shutil.copytree(whole, tmp_path, dirs_exist_ok=True)
    return tmp_path / "study"


@pytest.fixture
def folder(tmp_path: Path, clipped: Path) -> Path:
    return Path(shutil.copytree(clipped, tmp_path / "study"))


def test_clips_are_blind_and_in_an_order_of_their_own(made: Path, tmp_path: Path) -> None:
    orders = []
    for rater in ("r1", "r2"):
        out, key = tmp_path / rater, read_key(made, rater)
        orders.append([(clip.participant, clip.trial) for clip in key.clips])
        names = [f"clip-{n:03d}" for n in range(1, len(key.clips) + 1)]
        assert sorted(p.name for p in out.iterdir()) == sorted(
            [f"{n}.avi" for n in names] + [f"{rater}.boris"]
        )
        text = (out / f"{rater}.boris").read_text(encoding="utf-8")
        project = json.loads(text)
        assert list(project["observations"]) == names
        conditions = {trial.condition for trial in read_plan(made).trials}
        assert not [word for word in (*PEOPLE, *conditions, "t0", "condition") if word in text]
        assert all(o["independent_variables"].keys() == {"object"} for o in project["observations"].values())
    assert all(not events for events in read_boris(tmp_path / "r2" / "r2.boris").values())
    assert sorted(orders[0]) == sorted(orders[1])
    assert orders[0] != orders[1]
    with pytest.raises(InvalidValueError, match="r1 has clips already"):
        make_clips(made, tmp_path / "again", "r1")
    with pytest.raises(InvalidValueError, match="is not empty"):
        make_clips(made, tmp_path / "r1", "r9")


def test_a_clip_is_the_trial_picture_by_picture(whole: Path) -> None:
    key = read_key(whole / "study", "r1")
    video = cv2.VideoCapture(str(whole / "r1" / "clip-001.avi"))
    assert video.get(cv2.CAP_PROP_FPS) == pytest.approx(30.0)
    pictures = [image for _, image in iter(video.read, (False, None))]
    assert len(pictures) == round(key.clips[0].length_s * 30) == 39
    assert pictures[0].shape == (268, 640, 3)
    # Both fingertips are there, and something goes on in them.
    first, last = (np.asarray(pictures[k], float)[40:] for k in (2, -3))
    for half in (slice(0, 320), slice(320, 640)):
        assert first[:, half].mean() > 20
        assert np.abs(first[:, half] - last[:, half]).mean() > 0.05


@pytest.mark.slow
def test_two_studies_that_differ_in_the_condition_alone_give_the_same_clips(folder, tmp_path, recording):
    """What the vest changes in a recording differs as well: its frames, the settings, the muscles, the measures."""
    one, other_of = planned(), {"haptic": "non-haptic", "non-haptic": "haptic"}
    flipped = tuple(msgspec.structs.replace(t, condition=other_of[t.condition]) for t in one.trials)

    def silent(topic: str, value: Any) -> Any:
        if topic == "/vest/frame":
            value.intensities[:] = [0] * len(value.intensities)
        elif topic == "/emg/samples":
            value.samples[:] = [2 * sample for sample in value.samples]
        elif topic.endswith("/contact"):
            value.front = value.back = value.cci_norm = value.eda_norm = 0.0
        return value

    settings = {"session.toml": b"[stages.mapping]\nname = 'pulses'\n"}
    # A study's name stands in the project, and nothing else of where it lies.
    other, plan = tmp_path / "other" / "study", StudyPlan(one.settings, flipped)
    clipped_study(other, plan, recording, change=silent, files=settings)
    assert read_plan(folder).trials != read_plan(other).trials
    made = []
    for where in (folder, other):
        out = where.parent / "out"
        make_clips(where, out, "r1")
        made.append({path.name: path.read_bytes() for path in out.iterdir()})
    assert len(made[0]) == 5
    assert len(set(made[0].values())) == 2, "one recording for all, and the project"
    assert made[0] == made[1]


@pytest.mark.slow
def test_a_lossless_recording_is_shown_as_good_as_it_is(tmp_path: Path) -> None:
    path = record(tmp_path)
    displayed = read_reel(RecordedTrial("p01-t01", 1, 1, "bag", LEAD_NS, LENGTH_NS, LEAD_NS, tmp_path))
    pictures = read_recorded(path, Picture).of(Picture)
    raw = [(one.t_ns, one.image) for one in pictures if one.finger == "thumb"]
    assert displayed.fingers == ["thumb", "ring"]
    for at_ns in (0, 400 * MS, 1200 * MS):
        assert (displayed.picture("ring", at_ns) is not None) == (at_ns < S), (
            "that sensor ends after a second"
        )
        thumb = displayed.picture("thumb", at_ns)
        assert thumb is not None
        newest = [image for t_ns, image in raw if t_ns - LEAD_NS <= at_ns][-2:]
        assert min(np.abs(thumb.astype(int) - image).mean() for image in newest) < 2.0
    assert max(np.abs(image.astype(int) - raw[0][1]).mean() for _, image in raw) > 3.0


@pytest.mark.slow
@pytest.mark.parametrize("restarted", [False, True])
def test_a_clip_shows_the_scene_of_its_moment_and_none_of_another_start_of_the_machine(
    *, restarted: bool, folder: Path, tmp_path: Path
) -> None:
    films = list[Path]()
    for trial in recorded_trials(folder, "p01")[0]:  # those of p02 began at the same moments
        began = reported(trial.folder / "trial-001.mcap")["tega"]
        boot_ns = int(began["epoch_ns"]) - int(began["start_ns"]) + restarted * 3600 * S
        # The film's first picture is 0.2 s after the trial's start, and another comes each 0.1 s.
        first_ns = boot_ns - EPOCH_NS + trial.start_ns + 200 * MS
        film = {"front": packets([first_ns + 100 * k * MS for k in range(8)])}
        table = {"clock": "monotonic", "epoch_ns": str(boot_ns)}
        films.append(write_scene(tmp_path / f"{trial.start_ns}.mcap", film, table=table))
    key = make_clips(folder, tmp_path / "out", "r1", scenes=films)
    assert key.left_out == []
    for clip in key.clips:
        video = cv2.VideoCapture(str(tmp_path / "out" / f"{clip.name}.avi"))
        for k in range(39):
            there, picture = video.read()
            assert there
            assert picture.shape == (240 + 28 + 480 + 28, 640, 3)
            scene = picture[240 + 28 + 28 :][: 640 * 64 // 96]
            newest = int((k / 30 - 0.2 + 1e-6) // 0.1)
            if restarted or newest < 0:
                assert scene.max() < 40
            else:
                assert number_of(np.asarray(scene, np.uint8)) == min(newest, 7), k


def test_a_recording_that_cannot_be_shown_is_named_and_left_out(folder: Path, tmp_path: Path) -> None:
    first, second, third, fourth = [*recorded_trials(folder, "p01")[0], *recorded_trials(folder, "p02")[0]]
    (first.folder / "trial-001.mcap").rename(first.folder / "trial-001.mcap.part")
    whole = (second.folder / "trial-001.mcap").read_bytes()
    (second.folder / "trial-001.mcap").write_bytes(whole[: len(whole) // 2])
    shutil.copy(second.folder / "trial.json", third.folder / "trial.json")
    key = make_clips(folder, tmp_path / "out", "r1")
    assert [(clip.participant, clip.trial) for clip in key.clips] == [("p02", fourth.trial)]
    why = dict(sorted(line.split(": ", 1) for line in key.left_out))
    assert list(why) == [first.id, second.id, third.id]
    assert "never finished" in why[first.id]
    assert "is damaged" in why[second.id]
    assert f"of another trial, {second.id}" in why[third.id]
    shutil.copy(first.folder / "trial-001.mcap.part", fourth.folder / "trial-001.mcap")
    shutil.rmtree(first.folder)
    with pytest.raises(DeviceUnavailableError) as refused:
        make_clips(folder, tmp_path / "none", "r2")
    for words in (f"{first.id}: no recording", f"{fourth.id}: trial-001.mcap is of another trial"):
        assert words in str(refused.value)


def test_an_account_is_live_or_of_clips(made: Path, tmp_path: Path) -> None:
    take_clips(made, tmp_path / "r2" / "r2.boris", "r2")
    with pytest.raises(InvalidValueError, match="another code"):
        Observing(made, "p01", "r2", t_ns=0)
    Observing(made, "p01", "r3", t_ns=0).close()
    with pytest.raises(InvalidValueError, match="r3 has scored p01 already"):
        make_clips(made, tmp_path / "live", "r3")


def test_boris_opens_the_project_and_finds_its_media_and_a_behaviour_that_is_none(whole, tmp_path):
    opened = boris_project(whole / "r1" / "r1.boris", media=True)
    if opened is None:
        pytest.skip("pip install boris-behav-obs, or TEGA_BORIS names a Python that has it")
    assert len(opened["observations"]) == 4
    keys = {one["code"]: one["key"] for one in opened["behaviors_conf"].values()}
    assert set(keys) == {"slip", "deformation", "drop", "lift_off"}
    assert keys["slip"] == "s"
    changed = Path(shutil.copy(whole / "r1" / "r1.boris", tmp_path))
    coded(changed, lambda _name, _events: [[1.0, "", "sneeze", "", ""]])
    with pytest.raises(AssertionError, match="sneeze"):
        boris_project(changed)


def test_whoever_withdrew_is_in_no_clip_and_is_not_taken_in(made: Path, tmp_path: Path) -> None:
    assert any("clip-" in str(path) for path in withdraw(made, "p02").left)
    late = make_clips(made, tmp_path / "late", "r3")
    assert {clip.participant for clip in read_key(made, "r2").clips} == {"p01", "p02"}
    assert {clip.participant for clip in late.clips} == {"p01"}
    assert take_clips(made, tmp_path / "r2" / "r2.boris", "r2").trials == {"p01": 2}


def test_the_verb(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    message = json.loads(call(capsys, "study", "clips", folder, out, "--rater", "r1", "--json", code=0)[0])
    assert message == {"project": str(out / "r1.boris"), "clips": 4, "left_out": []}
    words, _ = call(capsys, "study", "clips", folder, "--rater", "r1", "--take", out / "r1.boris", code=0)
    assert "p01: 2 trials of rater r1 taken in" in words
    call(capsys, "study", "clips", folder, "--rater", "r1", code=2)


def decide(verdicts: dict[str, Any]) -> Any:
    """Return a rater who decides by who proposed and when: a verdict, or the time to move to."""

    def change(_name: str, events: list[Any]) -> list[Any]:
        done = []
        for t_s, subject, code, _modifiers, comment in events:
            verdict = verdicts[f"{comment.split()[1]} {t_s}"]
            if isinstance(verdict, float):
                done.append([verdict, subject, code, "thumb|proposed", comment])
            elif verdict != "delete":
                done.append([t_s, subject, code, f"thumb|{verdict}", comment])
        return [*done, [1.2, "bag", "drop", "None|None", "seen by eye"]]

    return change


def test_proposals_are_confirmed_rejected_moved_and_added_to(made: Path, tmp_path: Path) -> None:
    project = tmp_path / "r1" / "r1.boris"
    before = read_boris(project)
    assert [(e.t_s, e.code, e.modifiers, e.comment) for e in before["clip-001"]] == [
        (0.5, "slip", ("None", "proposed"), "#0 rule 1.00"),
        (0.5, "slip", ("None", "proposed"), "#1 detector 0.80"),
        (0.9, "slip", ("None", "proposed"), "#2 detector 0.80"),
    ]
    coded(project, decide({"rule 0.5": "confirmed", "detector 0.5": "rejected", "detector 0.9": 1.0}))
    taken = take_clips(made, project, "r1")
    assert taken.trials == {"p01": 2, "p02": 2}
    assert (taken.added, taken.unfinished) == (4, [])
    assert taken.proposals == {
        "detector": {"confirmed": 0, "moved": 4, "rejected": 4, "proposed": 0},
        "rule": {"confirmed": 4, "moved": 0, "rejected": 0, "proposed": 0},
    }
    for person in PEOPLE:
        events = read_observers(made, person)["r1"]
        starts = {e.trial: e.t_ns for e in events if e.kind == "trial_start"}
        assert all(saw_whole(events, trial, 1) for trial in starts)
        message = [(e.kind, (e.t_ns - starts[e.trial]) / S) for e in events if e.kind in {"slip", "drop"}]
        assert message == [("slip", 0.5), ("slip", 1.0), ("drop", 1.2)] * 2
    with pytest.raises(InvalidValueError, match="r1 has scored p01 already"):
        take_clips(made, project, "r1")
    # Whoever was shown what the detector says is not compared with it.
    second = tmp_path / "r2" / "r2.boris"
    coded(second, lambda _name, _events: [[0.52, "", "slip", "index", ""]])
    take_clips(made, second, "r2")
    pairs = {(one.a, one.b) for one in agreements(made)}
    assert ("r1", "r2") in pairs
    assert (DETECTOR, "r2") in pairs or ("r2", DETECTOR) in pairs
    assert not [pair for pair in pairs if "r1" in pair and DETECTOR in pair]
    close = agreements(made, tolerance_s=0.1)
    slips = next(one for one in close if (one.a, one.b, one.kind) == ("r1", "r2", "slip"))
    assert (slips.n_a, slips.n_b, slips.matched) == (8, 4, 4)
    assert slips.f1 == pytest.approx(2 * 4 / 12)
    assert slips.delay_s == pytest.approx(0.02)


def test_a_clip_with_an_open_proposal_counts_in_no_comparison_and_comments_are_a_rater_s_own(made, tmp_path):
    project, words = tmp_path / "r1" / "r1.boris", ("#", "#x", "#²", "#99999", "# 0", "")
    verdicts = {"rule 0.5": "confirmed", "detector 0.5": "delete", "detector 0.9": "proposed"}
    coded(project, decide(verdicts))
    own = [[0.1 * k, "", "slip", "", word] for k, word in enumerate(words)]  # name no proposal
    coded(project, lambda _name, events: [*events, *own])
    taken = take_clips(made, project, "r1")
    assert taken.added == 4 * (1 + len(words))
    assert taken.unfinished == [clip.name for clip in read_key(made, "r1").clips]
    assert taken.proposals["detector"] == {"confirmed": 0, "moved": 0, "rejected": 4, "proposed": 4}
    events = read_events(observer_path(made, "p01", "r1"))
    assert not any(saw_whole(events, trial, 1) for trial in (1, 2))


BAD = [
    (lambda t: t["observations"].update({"clip-009": {"events": []}}), "'clip-009' is no clip of r2"),
    (lambda t: t["observations"].pop("clip-002"), "lacks clip-002"),
    *(
        (lambda t, event=event: t["observations"]["clip-001"]["events"].append(event), message)
        for event, message in (
            ([0.1, "", "sneeze", "", ""], "behaviour 'sneeze' is not known"),
            ([99, "", "slip", "", ""], "an event at 99 s, outside"),
            (["NaN", "", "slip", "", ""], "clip-001: 'slip' has the time 'NaN'"),
            ([0.1], "is no BORIS project"),
        )
    ),
]


def test_a_project_that_was_spoilt_is_refused_and_nothing_is_taken(made: Path, tmp_path: Path) -> None:
    path = tmp_path / "r2" / "r2.boris"
    whole = path.read_text(encoding="utf-8")
    for change, message in BAD:
        tree = json.loads(whole)
        change(tree)
        path.write_text(json.dumps(tree), encoding="utf-8")
        with pytest.raises(RecordingError, match=message):
            take_clips(made, path, "r2")
        assert not observer_path(made, "p01", "r2").exists()


def test_keys_are_of_the_study_and_of_no_other_file(made: Path, tmp_path: Path) -> None:
    with pytest.raises(InvalidValueError, match="r3 has no clips"):
        take_clips(made, tmp_path / "no.boris", "r3")
    with pytest.raises(InvalidValueError, match="rater"):
        make_clips(made, tmp_path / "out", "../r1")
    key_path(made, "r1").write_text('{"format": "other"}')
    with pytest.raises(RecordingError, match="is damaged"):
        read_key(made, "r1")
    stranger = key_path(made, "r2").read_text().replace('"p01"', '"../../p01"')
    key_path(made, "r2").write_text(stranger)
    with pytest.raises(RecordingError, match="belongs to another plan"):
        read_key(made, "r2")
