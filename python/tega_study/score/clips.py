"""Make blind clips of recorded trials for raters who code in BORIS, and read their coding.

A clip is one person's trial with its frames and the scene's. Its number reveals neither person nor trial nor
condition; the assignment is in the study's folder, in ``clips/RATER.json``. With proposals the project holds the events
of the session's rule and of the detector, each to be confirmed, rejected or moved.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final, Literal

import msgspec

from tega.config import FINGERS
from tega.errors import DeviceUnavailableError, InvalidValueError, RecordingError
from tega.recording.mcap_reader import McapReader
from tega.runtime.files.annotations import CodedEvent
from tega.runtime.files.boris import BorisBehaviour, boris_observation, boris_project, read_boris
from tega.runtime.files.foreign_file import parse_json, plain_name, read_foreign
from tega.runtime.files.whole_file import write_whole
from tega_scene.record import filmed_cameras, own_recording
from tega_study.detecting import DETECTOR, read_detected
from tega_study.journal import CODES, counting, events_path, read_events
from tega_study.observers import PROPOSED, RECORDED, check_new
from tega_study.order import shuffled
from tega_study.plan import read_plan
from tega_study.privacy import note_elsewhere
from tega_study.score.boris import CodedTrial, ended_attempts, write_coded
from tega_study.score.clip_video import RATE_HZ, SceneReel, write_clip
from tega_study.score.recorded import RecordedTrial, recorded_trials
from tega_study.study_notes import staying, withdrawn_ids

RULE: Final = "rule"
"""Name under which the events of the session's own rule are proposed."""

OPEN: Final = "proposed"
"""State of a proposal until a rater has decided."""

VERDICTS: Final = (OPEN, "confirmed", "rejected", "moved")
"""Values of the modifier by which a rater decides."""

_NO_FINGER: Final = "several"


class Proposal(msgspec.Struct, frozen=True):
    """Event that the rule or the detector proposes, ``t_s`` from the trial's start, with a confidence of 0 to 1."""

    source: str
    kind: str
    t_s: float
    confidence: float


class RaterClip(msgspec.Struct, frozen=True):
    """Clip, such as ``clip-001``, and the attempt that it shows; a proposal's number is in its comment."""

    name: str
    participant: str
    trial: int
    attempt: int
    length_s: float
    proposals: list[Proposal] = []


class ClipKey(msgspec.Struct, frozen=True, kw_only=True):
    """Key of a rater's clips: ``plan`` is the SHA-256 of the study's, ``left_out`` what cannot be shown, and why."""

    format: Literal["tega-clips"] = "tega-clips"
    version: Literal[1] = 1
    plan: str
    rater: str
    proposed: bool
    clips: list[RaterClip]
    left_out: list[str] = []


def key_path(folder: Path, rater: str) -> Path:
    """Return where the key of a rater's clips is."""
    plain_name(rater, subject="rater", source=folder.name)
    return folder / "clips" / f"{rater}.json"


def make_clips(
    folder: Path,
    out: Path,
    rater: str,
    *,
    proposals: bool = False,
    scenes: Sequence[Path] = (),
    reported: Callable[[int, int], None] = lambda _done, _total: None,
) -> ClipKey:
    """Write clips and a project for a new rater; return their key, which is kept in the study's folder.

    ``out`` must not exist, or be empty. ``scenes`` are scene recordings of the sessions, made on their machine;
    none to use the films in the trials' recordings. ``reported`` gets the number of finished clips and the
    total. If no trial can be shown there is a ``DeviceUnavailableError``.
    """
    plan, key = read_plan(folder), key_path(folder, rater)
    if key.exists():
        raise InvalidValueError(f"{rater} has clips already: {key}", "give another --rater")
    if out.exists() and any(out.iterdir()):
        raise InvalidValueError(f"{out}: is not empty", "name a new folder")
    filmed = SceneReel(scenes) if scenes else None
    displayed, left_out = _displayed(folder, rater)
    out.mkdir(parents=True, exist_ok=True)
    clips, observations = [], {}
    for n, (person, trial) in enumerate(displayed, start=1):
        reported(n - 1, len(displayed))
        name = f"clip-{n:03d}"
        video = out / f"{name}.avi"
        try:
            scene = filmed
            # Not of the simulated bench, and with scene cameras of the settings.
            if filmed is None and any(trial.folder.glob("*.mcap")):
                recording = own_recording(trial.folder)
                scene = SceneReel([recording]) if filmed_cameras(McapReader(recording)) else None
            length_s = write_clip(trial, video, scene)
        except RecordingError as error:
            left_out.append(f"{trial.id}: {error.message}")
            continue
        left_out += [] if scene is None or filmed else [f"{trial.id}: {text}" for text in scene.problems]
        note_elsewhere(folder, person, video)
        events = _proposals(folder, person, trial) if proposals else []
        clips.append(RaterClip(name, person, trial.trial, trial.attempt, length_s, events))
        observations[name] = boris_observation(
            [
                CodedEvent(
                    one.t_s, trial.object, one.kind, ("None", OPEN), f"#{k} {one.source} {one.confidence:.2f}"
                )
                for k, one in enumerate(events)
            ],
            length_s=length_s,
            variables={"object": trial.object},
            media=video.name,
            rate_hz=RATE_HZ,
        )
    reported(len(displayed), len(displayed))
    left_out += [] if filmed is None else filmed.problems
    if not clips:
        raise DeviceUnavailableError(f"no recording can be shown: {'; '.join(left_out)}")
    modifiers = {"finger": (*FINGERS, _NO_FINGER)} | ({"proposal": VERDICTS} if proposals else {})
    project = boris_project(
        name=f"{folder.name}, {rater}",
        description="blind clips in an order of their own; times count from each clip's start",
        behaviours=[BorisBehaviour(code, key, modifiers) for code, key in CODES.items()],
        subjects=sorted({trial.object for _person, trial in displayed}),
        variables=("object",),
        observations=observations,
    )
    made = ClipKey(
        plan=plan.settings.plan_sha256, rater=rater, proposed=proposals, clips=clips, left_out=left_out
    )
    write_whole(key, msgspec.json.format(msgspec.json.encode(made)) + b"\n")
    write_whole(out / f"{rater}.boris", project)
    return made


def _displayed(folder: Path, rater: str) -> tuple[list[tuple[str, RecordedTrial]], list[str]]:
    """Return everybody's recorded trials that count, in the rater's order, and what cannot be shown."""
    plan = read_plan(folder)
    found: list[tuple[str, RecordedTrial]] = []
    left_out: list[str] = []
    for person in staying(folder, plan):
        if not events_path(folder, person).exists():
            continue
        check_new(folder, person, rater)
        trials, unseen = recorded_trials(folder, person)
        found += [(person, trial) for trial in trials]
        left_out += unseen
    if not found:
        raise DeviceUnavailableError(
            f"no recording to make clips of: {'; '.join(left_out) or 'no trial that counts has ended'}",
            "record trials with tega-teleop study run",
        )
    return shuffled(found, seed=plan.settings.seed or 0, purpose=f"clips|{rater}"), left_out


def _proposals(folder: Path, person: str, trial: RecordedTrial) -> list[Proposal]:
    """Return what rule and detector say of a trial, in the order of time."""
    found = []
    accounts = {
        RULE: [e for e in read_events(events_path(folder, person)) if e.source == "auto"],
        DETECTOR: read_detected(folder, person),
    }
    for source, events in accounts.items():
        for event in counting(events, trial.trial, trial.attempt):
            t_s = (event.t_ns - trial.start_ns) / 1e9
            if event.kind in CODES and 0 <= t_s <= trial.length_ns / 1e9:
                confidence = 1.0 if event.value is None or source == RULE else event.value
                found.append(Proposal(source, event.kind, round(t_s, 3), confidence))
    return sorted(found, key=lambda one: one.t_s)


def decode_key(path: Path) -> ClipKey:
    """Read a key's file; ``RecordingError`` if it is damaged."""
    try:
        return parse_json(read_foreign(path, most_mib=64), ClipKey)
    except (OSError, msgspec.DecodeError) as error:
        raise RecordingError(f"{path}: is damaged: {error}") from error


def read_key(folder: Path, rater: str) -> ClipKey:
    """Read a rater's key; ``InvalidValueError`` without one, ``RecordingError`` if it is of another plan."""
    path = key_path(folder, rater)
    if not path.exists():
        raise InvalidValueError(f"{rater} has no clips in {folder}", "make them with tega-teleop study clips")
    key, plan = decode_key(path), read_plan(folder)
    # A person's id becomes a folder's name: only those of the plan do.
    strangers = {clip.participant for clip in key.clips} - set(plan.participants)
    if key.plan != plan.settings.plan_sha256 or strangers:
        raise RecordingError(f"{path}: belongs to another plan")
    return key


_SAME_S: Final = 0.05
"""Moved by less than that, an event was not moved: a picture and a half."""


class TakenClips(msgspec.Struct, frozen=True, kw_only=True):
    """Summary of a rater's project that was taken in: clips by person, and events without a proposal.

    Clips with an undecided proposal count in no comparison. ``proposals`` has, by who proposed, how many were
    confirmed, moved, rejected and left open.
    """

    trials: dict[str, int]
    unfinished: list[str]
    added: int
    proposals: dict[str, dict[str, int]]


def take_clips(folder: Path, path: Path, rater: str) -> TakenClips:
    """Import a rater's coding of their clips, as that rater's file of each session.

    A rejected proposal is no event, a confirmed or moved one is, where the rater left it; a deleted one is
    rejected. A clip with a proposal that is still open was not coded whole. Raises ``InvalidValueError`` if
    the rater was taken in already, ``RecordingError`` if the project lacks a clip or holds an unknown one.
    """
    key, observed = read_key(folder, rater), read_boris(path)
    gone = withdrawn_ids(folder)
    known = {clip.name: clip for clip in key.clips}
    if strange := sorted(observed.keys() - known.keys()):
        raise RecordingError(f"{path.name}: {strange[0]!r} is no clip of {rater}")
    if lacking := sorted(known.keys() - observed.keys()):
        raise RecordingError(f"{path.name}: lacks {', '.join(lacking[:3])}", "name the whole project")
    ready: dict[str, list[CodedTrial]] = {}
    decided: dict[str, Counter[str]] = {}
    unfinished: list[str] = []
    added = 0
    for clip in key.clips:
        if clip.participant in gone:
            continue
        check_new(folder, clip.participant, rater)
        ran = ended_attempts(folder, clip.participant)
        if (clip.trial, clip.attempt) not in ran:
            raise RecordingError(f"{key_path(folder, rater)}: {clip.name} is of no trial that was run")
        start, end = ran[clip.trial, clip.attempt]
        events, verdicts = _coded(path, clip, observed[clip.name])
        for n, verdict in verdicts.items():
            decided.setdefault(clip.proposals[n].source, Counter())[verdict] += 1
        is_open = OPEN in verdicts.values()
        unfinished += [clip.name] * is_open
        added += sum(n is None for n, _event in events)
        coded = [CodedEvent(e.t_s, "", e.code, duration_s=e.duration_s) for _n, e in events]
        ready.setdefault(clip.participant, []).append(CodedTrial(start, end, coded, whole=not is_open))
    item = PROPOSED if key.proposed else RECORDED
    for person, trials in ready.items():
        in_order = sorted(trials, key=lambda one: one.start.t_ns)
        write_coded(folder, person, rater, in_order, key.plan, item=item)
    return TakenClips(
        trials={person: len(trials) for person, trials in ready.items()},
        unfinished=unfinished,
        added=added,
        proposals={
            source: {verdict: counts[verdict] for verdict in ("confirmed", "moved", "rejected", OPEN)}
            for source, counts in sorted(decided.items())
        },
    )


def _coded(
    path: Path, clip: RaterClip, events: list[CodedEvent]
) -> tuple[list[tuple[int | None, CodedEvent]], dict[int, str]]:
    """Return the events that count, with the number of their proposal, and what became of each proposal."""
    found: list[tuple[int | None, CodedEvent]] = []
    verdicts = dict.fromkeys(range(len(clip.proposals)), "rejected")  # one that was deleted
    for event in events:
        if event.code not in CODES:
            raise RecordingError(
                f"{path.name}: {clip.name}: behaviour {event.code!r} is not known", f"use {', '.join(CODES)}"
            )
        if not -_SAME_S <= event.t_s <= clip.length_s + _SAME_S:
            raise RecordingError(f"{path.name}: {clip.name} has an event at {event.t_s:g} s, outside of it")
        n = _number(event.comment, clip)
        if n is None:
            found.append((None, event))
            continue
        verdict = next((m for m in event.modifiers if m in VERDICTS), OPEN)
        if verdict != "rejected" and abs(event.t_s - clip.proposals[n].t_s) > _SAME_S:
            verdict = "moved"
        elif verdict == "moved":
            verdict = "confirmed"
        verdicts[n] = verdict
        if verdict in {"confirmed", "moved"}:
            found.append((n, event))
    return sorted(found, key=lambda one: one[1].t_s), verdicts


def _number(comment: str, clip: RaterClip) -> int | None:
    """Return the number of the proposal that an event is; ``None`` for one that the rater added."""
    first = comment.partition(" ")[0]
    if not first.startswith("#") or not first[1:].isascii() or not first[1:].isdecimal():
        return None
    n = int(first[1:6])
    return n if n < len(clip.proposals) else None
