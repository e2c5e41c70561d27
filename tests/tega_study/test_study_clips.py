# mypy: allow-untyped-defs, allow-incomplete-defs, allow-untyped-calls, allow-untyped-decorators
"""Blind clips of recorded trials, coded in BORIS: what a rater is given, what comes back, what is compared."""

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

from reference.command import call
from reference.filmed import EPOCH_NS, number_of, packets, write_scene
from reference.sessions import read_recorded, record, rewritten
from reference.written import boris_project
from tega.errors import DeviceUnavailableError, InvalidValueError, RecordingError
from tega.recording.mcap_reader import McapReader
from tega.records import Picture
from tega.runtime.files.boris import read_boris
from tega_study.detecting import DETECTOR, detected_path
from tega_study.journal import Journal, events_path, read_events
from tega_study.observe import Observing
from tega_study.observers import observer_path, read_observers, saw_whole
from tega_study.plan import StudyPlan, make_plan, read_plan, write_plan
from tega_study.privacy import withdraw
from tega_study.score.accounts import agreements
from tega_study.score.clips import ClipKey, key_path, make_clips, read_key
from tega_study.score.clips_coded import take_clips
from tega_study.score.recorded import RecordedTrial, recorded_trials
from tega_study.score.trial_pictures import read_reel
from tega_study.state import resume

S, MS = 1_000_000_000, 1_000_000
FIRST_NS, LEAD_NS, LENGTH_NS = 1000 * S, 100 * MS, 1300 * MS
PEOPLE = ("p01", "p02")


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record a second and a half of made-up input: two fingertips, muscles, hand and vest."""
    return record(tmp_path_factory.mktemp("recorded"), lossless=False)


def planned() -> StudyPlan:
    return make_plan(participants=2, seed=5, objects=["bag"], trials=1, layout="pairs")


@pytest.fixture
def folder(tmp_path: Path, recording: Path) -> Path:
    return study(tmp_path / "study", planned(), recording)


def study(where: Path, plan: StudyPlan, recording: Path, **changes: Any) -> Path:
    """Make a study of two people whose trials are over: a rule's slip at 0.5 s, the detector's at 0.5 and at 0.9 s."""
    write_plan(plan, where)
    plan = read_plan(where)
    for person in PEOPLE:
        with (
            resume(where, plan, person, t_ns=FIRST_NS)[0] as main,
            Journal(detected_path(where, person)) as found,
        ):
            found.add("session_start", t_ns=FIRST_NS, source=DETECTOR, text=plan.settings.plan_sha256)
            for trial in plan.of(person):
                start_ns = FIRST_NS + trial.trial * 100 * S
                n = trial.trial
                begun = main.add("trial_start", t_ns=start_ns, trial=n, source="auto")
                main.add("slip", t_ns=start_ns + 500 * MS, trial=n, source="auto")
                ended = main.add(
                    "trial_end",
                    t_ns=start_ns + LENGTH_NS,
                    trial=n,
                    status="done",
                    success=True,
                    source="auto",
                )
                times_ns = (start_ns + at_ms * MS for at_ms in (500, 900))
                rows = [{"kind": "slip", "t_ns": t_ns, "value": 0.8} for t_ns in times_ns]
                found.add_attempt((begun, ended), DETECTOR, rows)
                kept = where / "recordings" / person / f"{trial.id}-a1"
                kept.mkdir(parents=True)
                facts = {
                    "trial": trial.id,
                    "attempt": 1,
                    "zero_ns": start_ns - LEAD_NS,
                    "started_ns": start_ns,
                }
                (kept / "trial.json").write_text(json.dumps(facts))
                began = {"tega": {"start_ns": str(start_ns - LEAD_NS)}}
                rewritten(recording, kept / "trial-001.mcap", tables=began, **changes)
    return where


def coded(path: Path, change: Any) -> None:
    """Change a project's events as a rater would, and save it."""
    tree = json.loads(path.read_text(encoding="utf-8"))
    for name, observation in tree["observations"].items():
        observation["events"] = change(name, observation["events"])
    path.write_text(json.dumps(tree), encoding="utf-8")


def test_clips_are_blind_and_in_an_order_of_their_own(folder: Path, tmp_path: Path) -> None:
    orders = []
    for rater in ("r1", "r2", "r3"):
        out = tmp_path / rater
        key = make_clips(folder, out, rater)
        orders.append([(clip.participant, clip.trial) for clip in key.clips])
        assert read_key(folder, rater) == key
        names = [f"clip-{n:03d}" for n in range(1, len(key.clips) + 1)]
        assert sorted(p.name for p in out.iterdir()) == sorted(
            [f"{n}.avi" for n in names] + [f"{rater}.boris"]
        )
        text = (out / f"{rater}.boris").read_text(encoding="utf-8")
        project = json.loads(text)
        assert list(project["observations"]) == names
        conditions = {trial.condition for trial in read_plan(folder).trials}
        assert not [word for word in (*PEOPLE, *conditions, "t0", "condition") if word in text]
        assert all(o["independent_variables"].keys() == {"object"} for o in project["observations"].values())
        assert all(not events for events in read_boris(out / f"{rater}.boris").values())
    assert sorted(orders[0]) == sorted(orders[1]) == sorted(orders[2])
    assert len({tuple(order) for order in orders}) == 3
    with pytest.raises(InvalidValueError, match="r1 has clips already"):
        make_clips(folder, tmp_path / "again", "r1")
    with pytest.raises(InvalidValueError, match="is not empty"):
        make_clips(folder, tmp_path / "r1", "r9")


def test_a_clip_is_the_trial_picture_by_picture(folder: Path, tmp_path: Path) -> None:
    key = make_clips(folder, tmp_path / "out", "r1")
    video = cv2.VideoCapture(str(tmp_path / "out" / "clip-001.avi"))
    assert video.get(cv2.CAP_PROP_FPS) == pytest.approx(30.0)
    pictures = []
    while (got := video.read())[0]:
        pictures.append(got[1])
    assert len(pictures) == round(key.clips[0].length_s * 30) == 39
    assert pictures[0].shape == (268, 640, 3)
    # Both fingertips are there, and something goes on in them.
    first, last = (np.asarray(pictures[k], float)[40:] for k in (2, -3))
    for half in (slice(0, 320), slice(320, 640)):
        assert first[:, half].mean() > 20
        assert np.abs(first[:, half] - last[:, half]).mean() > 0.05


@pytest.mark.slow
def test_two_studies_that_differ_in_the_condition_alone_give_the_same_clips(
    folder: Path, tmp_path: Path, recording: Path
) -> None:
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
    other = study(
        tmp_path / "other" / "study",
        StudyPlan(one.settings, flipped),
        recording,
        change=silent,
        files=settings,
    )
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


def _at_time_of_day(path: Path, epoch_ns: int) -> None:
    """Have a recording begin at another time of day."""
    reader = McapReader(path)
    assert all(one.log_ns for one in reader.messages(lambda _topic: False))
    later_ns = epoch_ns - int(reader.metadata["tega"]["epoch_ns"])
    new = rewritten(
        path,
        path.with_suffix(".new"),
        tables={"tega": {"epoch_ns": str(epoch_ns)}},
        times=lambda _topic, log_ns: log_ns + later_ns,
    )
    new.replace(path)


@pytest.mark.slow
@pytest.mark.parametrize("restarted", [False, True])
def test_a_clip_shows_the_scene_of_its_moment_and_none_of_another_start_of_the_machine(
    *, restarted: bool, tmp_path: Path, recording: Path
) -> None:
    folder = tmp_path / "study"
    study(folder, planned(), recording)
    begun = {}
    for trial in (one for person in PEOPLE for one in recorded_trials(folder, person)[0]):
        # The film's first picture is 0.2 s after the trial's start, and another comes each 0.1 s.
        begun[trial.start_ns] = packets([trial.start_ns + (200 + 100 * k) * MS for k in range(8)])
        at_ns = EPOCH_NS + restarted * 3600 * S + trial.start_ns - trial.zero_ns
        _at_time_of_day(trial.folder / "trial-001.mcap", at_ns)
    films = [
        write_scene(tmp_path / f"scene-{k}.mcap", {"front": film}) for k, film in enumerate(begun.values())
    ]
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
    with pytest.raises(DeviceUnavailableError) as reported:
        make_clips(folder, tmp_path / "none", "r2")
    for words in (f"{first.id}: no recording", f"{fourth.id}: trial-001.mcap is of another trial"):
        assert words in str(reported.value)


def test_an_account_is_live_or_of_clips(folder: Path, tmp_path: Path) -> None:
    make_clips(folder, tmp_path / "out", "r1")
    take_clips(folder, tmp_path / "out" / "r1.boris", "r1")
    with pytest.raises(InvalidValueError, match="another code"):
        Observing(folder, "p01", "r1", t_ns=0)
    Observing(folder, "p01", "r2", t_ns=0).close()
    with pytest.raises(InvalidValueError, match="r2 has scored p01 already"):
        make_clips(folder, tmp_path / "live", "r2")


def test_the_player_of_before_names_the_clips(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for words in (("--recorded",), ("--recorded", "--no-view")):
        _, message = call(capsys, "study", "observe", folder, "p01", "--rater", "r3", *words, code=1)
        assert "recordings are coded in BORIS" in message
        assert f"hint: tega-teleop study clips {folder} OUT --rater r3" in message
    assert not observer_path(folder, "p01", "r3").exists()


def test_boris_opens_the_project_and_finds_its_media(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    make_clips(folder, out, "r1", proposals=True)
    opened = boris_project(out / "r1.boris", media=True)
    if opened is None:
        pytest.skip(
            "BORIS is not installed: pip install boris-behav-obs, or TEGA_BORIS names a Python that has it"
        )
    assert len(opened["observations"]) == 4
    assert {one["code"] for one in opened["behaviors_conf"].values()} == {
        "slip",
        "deformation",
        "drop",
        "lift_off",
    }


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


def test_proposals_are_confirmed_rejected_moved_and_added_to(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    make_clips(folder, out, "r1", proposals=True)
    project = out / "r1.boris"
    before = read_boris(project)
    assert [(e.t_s, e.code, e.modifiers, e.comment) for e in before["clip-001"]] == [
        (0.5, "slip", ("None", "proposed"), "#0 rule 1.00"),
        (0.5, "slip", ("None", "proposed"), "#1 detector 0.80"),
        (0.9, "slip", ("None", "proposed"), "#2 detector 0.80"),
    ]
    coded(project, decide({"rule 0.5": "confirmed", "detector 0.5": "rejected", "detector 0.9": 1.0}))
    taken = take_clips(folder, project, "r1")
    assert taken.trials == {"p01": 2, "p02": 2}
    assert (taken.added, taken.unfinished) == (4, [])
    assert taken.proposals == {
        "detector": {"confirmed": 0, "moved": 4, "rejected": 4, "proposed": 0},
        "rule": {"confirmed": 4, "moved": 0, "rejected": 0, "proposed": 0},
    }
    for person in PEOPLE:
        events = read_observers(folder, person)["r1"]
        starts = {e.trial: e.t_ns for e in events if e.kind == "trial_start"}
        assert all(saw_whole(events, trial, 1) for trial in starts)
        message = [(e.kind, (e.t_ns - starts[e.trial]) / S) for e in events if e.kind in {"slip", "drop"}]
        assert message == [("slip", 0.5), ("slip", 1.0), ("drop", 1.2)] * 2
    with pytest.raises(InvalidValueError, match="r1 has scored p01 already"):
        take_clips(folder, project, "r1")
    # Whoever was shown what the detector says is not compared with it.
    second = tmp_path / "second"
    make_clips(folder, second, "r2")
    coded(second / "r2.boris", lambda _name, _events: [[0.52, "", "slip", "index", ""]])
    take_clips(folder, second / "r2.boris", "r2")
    pairs = {(one.a, one.b) for one in agreements(folder)}
    assert ("r1", "r2") in pairs
    assert (DETECTOR, "r2") in pairs or ("r2", DETECTOR) in pairs
    assert not [pair for pair in pairs if "r1" in pair and DETECTOR in pair]
    slips = next(
        one for one in agreements(folder, tolerance_s=0.1) if (one.a, one.b, one.kind) == ("r1", "r2", "slip")
    )
    assert (slips.n_a, slips.n_b, slips.matched) == (8, 4, 4)
    assert slips.f1 == pytest.approx(2 * 4 / 12)
    assert slips.delay_s == pytest.approx(0.02)


def test_a_clip_with_an_open_proposal_counts_in_no_comparison(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    key = make_clips(folder, out, "r1", proposals=True)
    verdicts = {"rule 0.5": "confirmed", "detector 0.5": "delete", "detector 0.9": "proposed"}
    coded(out / "r1.boris", decide(verdicts))
    taken = take_clips(folder, out / "r1.boris", "r1")
    assert taken.unfinished == [clip.name for clip in key.clips]
    assert taken.proposals["detector"] == {"confirmed": 0, "moved": 0, "rejected": 4, "proposed": 4}
    events = read_events(observer_path(folder, "p01", "r1"))
    assert not any(saw_whole(events, trial, 1) for trial in (1, 2))


BAD = [
    (lambda t: t["observations"].update({"clip-009": {"events": []}}), "'clip-009' is no clip of r1"),
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


def test_a_project_that_was_spoilt_is_refused_and_nothing_is_taken(folder: Path, tmp_path: Path) -> None:
    make_clips(folder, tmp_path / "out", "r1")
    path = tmp_path / "out" / "r1.boris"
    whole = path.read_text(encoding="utf-8")
    for change, message in BAD:
        tree = json.loads(whole)
        change(tree)
        path.write_text(json.dumps(tree), encoding="utf-8")
        with pytest.raises(RecordingError, match=message):
            take_clips(folder, path, "r1")
        assert not observer_path(folder, "p01", "r1").exists()


def test_numbers_that_name_no_proposal_are_a_rater_s_own_words(folder: Path, tmp_path: Path) -> None:
    make_clips(folder, tmp_path / "out", "r1", proposals=True)
    path = tmp_path / "out" / "r1.boris"
    words = ("#", "#x", "#²", "#99999", "# 0", "")
    coded(path, lambda _name, _events: [[0.1 * k, "", "slip", "", word] for k, word in enumerate(words)])
    taken = take_clips(folder, path, "r1")
    assert taken.added == 4 * len(words)
    assert taken.proposals["rule"]["rejected"] == 4  # all were deleted


def test_keys_are_of_the_study_and_of_no_other_file(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(InvalidValueError, match="r1 has no clips"):
        take_clips(folder, tmp_path / "no.boris", "r1")
    with pytest.raises(InvalidValueError, match="rater"):
        make_clips(folder, tmp_path / "out", "../r1")
    make_clips(folder, tmp_path / "out", "r1")
    for text in ("", "[]", '{"format": "other"}', "[" * 4000):
        key_path(folder, "r1").write_text(text)
        with pytest.raises(RecordingError, match="is damaged"):
            read_key(folder, "r1")
    make_clips(folder, tmp_path / "second", "r2")
    stranger = key_path(folder, "r2").read_text().replace('"p01"', '"../../p01"')
    key_path(folder, "r2").write_text(stranger)
    with pytest.raises(RecordingError, match="belongs to another plan"):
        read_key(folder, "r2")


def test_whoever_withdrew_is_in_no_clip_and_is_not_taken_in(folder: Path, tmp_path: Path) -> None:
    early = make_clips(folder, tmp_path / "early", "r1")
    result = withdraw(folder, "p02")
    assert any("clip-" in str(path) for path in result.left)
    late = make_clips(folder, tmp_path / "late", "r2")
    assert {clip.participant for clip in early.clips} == {"p01", "p02"}
    assert {clip.participant for clip in late.clips} == {"p01"}
    assert take_clips(folder, tmp_path / "early" / "r1.boris", "r1").trials == {"p01": 2}


def test_without_recordings_there_are_no_clips(folder: Path, tmp_path: Path) -> None:
    for path in (folder / "recordings").rglob("*.mcap"):
        path.unlink()
    with pytest.raises(DeviceUnavailableError, match="no recording"):
        make_clips(folder, tmp_path / "out", "r1")


def test_the_verb(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    message = json.loads(call(capsys, "study", "clips", folder, out, "--rater", "r1", "--json", code=0)[0])
    assert message == {"project": str(out / "r1.boris"), "clips": 4, "left_out": []}
    words, _ = call(capsys, "study", "clips", folder, "--rater", "r1", "--take", out / "r1.boris", code=0)
    assert "p01: 2 trials of rater r1 taken in" in words
    call(capsys, "study", "clips", folder, "--rater", "r1", code=2)
    assert isinstance(read_key(folder, "r1"), ClipKey)
    assert events_path(folder, "p01").exists()
