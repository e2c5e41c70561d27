# mypy: allow-untyped-defs, allow-incomplete-defs, allow-untyped-calls, allow-untyped-decorators
"""What comes back of blind clips: proposals decided, events added, projects that are refused."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("foxglove")


from reference.clipped import PEOPLE, S, coded
from tega.errors import InvalidValueError, RecordingError
from tega.runtime.files.boris import read_boris
from tega_study.detecting import DETECTOR
from tega_study.journal import read_events
from tega_study.observers import observer_path, read_observers, saw_whole
from tega_study.score.accounts import agreements
from tega_study.score.clips import key_path, make_clips, read_key
from tega_study.score.clips_coded import take_clips


@pytest.fixture
def folder(tmp_path: Path, clipped: Path) -> Path:
    return Path(shutil.copytree(clipped, tmp_path / "study"))


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
