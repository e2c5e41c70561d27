"""Measure the trials of a session with a scene camera, and let a person confirm or correct the result."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator, Sequence
from itertools import repeat
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.errors import InvalidValueError, RecordingError
from tega_scene.layout import TagLayout
from tega_scene.lens import Lens
from tega_scene.outcomes import SceneOutcome, score_scene
from tega_scene.pictures import read_pictures, times_path
from tega_scene.record import own_film, own_recording
from tega_scene.track import track_scene
from tega_study.attempt_rows import recording_folder
from tega_study.journal import (
    SEEN,
    Journal,
    JournalEvent,
    attempts,
    counting,
    events_path,
    read_events,
    replaced_journal,
)
from tega_study.observe.observing import checked_rater
from tega_study.observers import CAMERA, RECORDED, WHOLE, measured_path, observer_path, read_measured
from tega_study.plan import read_plan
from tega_study.study_notes import check_stays


class MeasuredTrial(msgspec.Struct, frozen=True):
    """One attempt by a camera, times from its start; ``problem`` is why there is no outcome."""

    participant: str
    trial: int
    attempt: int
    object: str
    outcome: SceneOutcome | None
    problem: str = ""


def measure_session(
    folder: Path,
    participant: str,
    video: Path | None = None,
    lens: Lens | None = None,
    layout: TagLayout | None = None,
    *,
    camera: str | None = None,
    harm_m: float = 0.006,
    mark_m: tuple[float, float] | None = None,
) -> list[MeasuredTrial]:
    """Measure the trials of a session by a camera, and write them beside the session's events.

    ``video`` is of the whole session, its time code on the session's clock; ``None`` for the frames that a
    ``camera`` of the settings (``None`` for the only one) recorded with each trial. ``lens`` and ``layout``
    are those in the recordings if ``None``. The object counts as deformed from a narrowing of ``harm_m``.
    ``mark_m`` is the second mark of a task of two places.

    ``RecordingError`` if the study or the video is damaged, has no time code, or shows no trial of the session.
    """
    plan = read_plan(folder)
    mine = {trial.trial: trial for trial in plan.of(participant)}
    check_stays(folder, participant)
    ended = attempts(read_events(events_path(folder, participant)), with_data=True)
    films: Iterable[_Film]
    if video is None:
        films = _own_films([recording_folder(folder, mine[s.trial], s.attempt) for s, _ in ended], camera)
    elif not times_path(video).exists():
        raise RecordingError(
            f"{video.name}: has no time code {times_path(video).name}, so nothing says where a trial is in it",
            "record with tega-teleop scene record, and export",
        )
    else:  # it is decoded once, each trial goes on where one left off
        begin_ns = min((start.t_ns for start, _ in ended), default=0)
        films = repeat(_Film(read_pictures(video, begin_s=begin_ns / 1e9)), len(ended))
    found: list[tuple[JournalEvent, JournalEvent, MeasuredTrial]] = []
    for (start, end), film in zip(ended, films, strict=True):
        outcome, problem = None, film.problem
        seen_by, laid = lens or film.lens, layout or film.layout
        if seen_by is None or laid is None:
            problem = problem or "its recording has no lens and layout: name them, or set them in [[scene]]"
        elif not problem:
            try:
                pictures = between(film.pictures, start.t_ns / 1e9, end.t_ns / 1e9)
                track = track_scene(pictures, seen_by, laid)
                outcome = score_scene(track, laid, begin_s=0.0, harm_m=harm_m, mark_m=mark_m)
            except RecordingError as error:
                problem = str(error)
        seen = MeasuredTrial(
            participant, start.trial, start.attempt, mine[start.trial].object, outcome, problem
        )
        found.append((start, end, seen))
    if not any(seen.outcome for *_, seen in found):
        why = found[0][2].problem if found else "no trial has been run"
        seen_in = "" if video is None else f"{video.name}: "
        raise RecordingError(f"{seen_in}no trial of {participant} could be measured: {why}")
    write_measured(measured_path(folder, participant), plan.settings.plan_sha256, found)
    return [seen for *_, seen in found]


class _Film(NamedTuple):
    """Frames on the machine's clock, with lens and layout of their camera; or why there are none."""

    pictures: Iterator[tuple[float, NDArray[np.uint8]]] = iter(())
    lens: Lens | None = None
    layout: TagLayout | None = None
    problem: str = ""


def _own_films(folders: Sequence[Path], camera: str | None) -> Iterator[_Film]:
    for folder in folders:
        with tempfile.TemporaryDirectory() as beside:
            try:
                film = own_film(own_recording(folder), camera, Path(beside))
            except RecordingError as error:
                yield _Film(problem=str(error))
                continue
            yield _Film(read_pictures(film.video), film.lens, film.layout)


def between(
    filmed: Iterator[tuple[float, NDArray[np.uint8]]], begin_s: float, end_s: float
) -> Iterator[tuple[float, NDArray[np.uint8]]]:
    """Return the next trial's pictures of a film, times from the trial's start; the film stands after its end then."""
    for t_s, image in filmed:
        if t_s > end_s:
            return
        if t_s >= begin_s:
            yield t_s - begin_s, image


def write_measured(
    path: Path, signed: str, found: Sequence[tuple[JournalEvent, JournalEvent, MeasuredTrial]]
) -> None:
    """Replace the camera's events of a session."""
    with replaced_journal(path) as journal:
        journal.add("session_start", t_ns=found[0][0].t_ns, source=CAMERA, text=signed)
        for start, end, seen in found:
            if (outcome := seen.outcome) is not None:
                rows: list[dict[str, Any]] = []
                for event in outcome.events:
                    size_mm, error_mm = 1000 * event.size_m, 1000 * event.size_error_m
                    size = f"{size_mm:.2f} ± {error_mm:.2f} mm, " if event.size_m else ""
                    row = {
                        "kind": "note" if event.kind == "put_down" else event.kind,
                        "t_ns": start.t_ns + round(event.t_s * 1e9),
                        "value": round(size_mm, 3) if event.size_m else None,
                        "text": f"{event.kind}: {size}± {1000 * event.t_error_s:.0f} ms",
                    }
                    rows.append(row)
                rest = () if outcome.rest is None else (outcome.rest.said(),)
                rows += [{"kind": "note", "t_ns": end.t_ns, "text": text} for text in (*rest, *outcome.notes)]
                journal.add_attempt((start, end), CAMERA, rows, success=outcome.success)


def confirm_trial(
    folder: Path,
    participant: str,
    trial: int,
    rater: str,
    *,
    attempt: int = 1,
    struck: Sequence[int] = (),
    added: Sequence[tuple[str, float]] = (),
) -> list[JournalEvent]:
    """Take the camera's events of a trial over into a person's own account, as they are or corrected.

    ``struck`` numbers, in the camera's file, the events that did not happen; ``added`` has those that the camera
    missed: kind, seconds from the trial's start. Returns the events that now count for that person.
    ``InvalidValueError`` if the trial has none of these, or the person has confirmed it before.
    """
    measured = read_measured(folder, participant)
    mine = counting(measured, trial, attempt)
    ends = {event.kind: event for event in mine if event.kind in {"trial_start", "trial_end"}}
    if len(ends) < 2:
        raise InvalidValueError(
            f"{participant} trial {trial}, attempt {attempt}: not measured by a camera",
            "tega-teleop scene measure does so",
        )
    start, end = ends["trial_start"], ends["trial_end"]
    events = {event.n: event for event in mine if event.kind in SEEN}
    for number in struck:
        if number not in events:
            raise InvalidValueError(
                f"event {number} is none of trial {trial}", f"one of {', '.join(map(str, events)) or 'none'}"
            )
    for kind, t_s in added:
        if kind not in SEEN:
            raise InvalidValueError(f"a {kind!r} cannot be added", f"one of {', '.join(SEEN)}")
        if not 0 <= t_s <= (end.t_ns - start.t_ns) / 1e9:
            raise InvalidValueError(
                f"{kind} at {t_s:g} s: the trial lasts {(end.t_ns - start.t_ns) / 1e9:.2f} s"
            )
    kept = [(event.kind, event.t_ns) for number, event in events.items() if number not in struck]
    for kind in SEEN:
        kept += [(kind, start.t_ns + round(t_s * 1e9)) for name, t_s in added if name == kind]
    name = f"{CAMERA}+{checked_rater(rater)}"
    with Journal(observer_path(folder, participant, name)) as journal:
        if any(e.kind == "trial_end" and (e.trial, e.attempt) == (trial, attempt) for e in journal.events):
            raise InvalidValueError(
                f"{rater} has confirmed trial {trial} before", "another person may, with another code"
            )
        if not journal.events:
            signed = next(event.text for event in measured if event.kind == "session_start")
            journal.add("session_start", t_ns=start.t_ns, source=name, text=signed, item=RECORDED)
        rows = [{"kind": kind, "t_ns": t_ns} for kind, t_ns in sorted(kept, key=lambda one: one[1])]
        journal.add_attempt((start, end), name, rows, text=WHOLE)
        return [e for e in counting(journal.events, trial, attempt) if e.kind in SEEN]
