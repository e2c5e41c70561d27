"""Read a rater's coding of blind clips: events that were added, and proposals confirmed, moved or rejected."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Final

import msgspec

from tega.errors import RecordingError
from tega.runtime.files.annotations import CodedEvent
from tega.runtime.files.boris import read_boris
from tega_study.journal import attempts, events_path, read_events
from tega_study.observers import PROPOSED, RECORDED, check_new
from tega_study.score.boris import CODES, CodedTrial, write_coded
from tega_study.score.clips import OPEN, VERDICTS, RaterClip, key_path, read_key
from tega_study.study_notes import withdrawn_ids

_SAME_S: Final = 0.05
"""Moved by less than that, an event was not moved: a picture and a half."""


class TakenClips(msgspec.Struct, frozen=True, kw_only=True):
    """Summary of a rater's project that was taken in.

    Attributes:
        trials: Clips taken in, by person.
        unfinished: Clips with an undecided proposal; they count in no comparison.
        added: Events without a proposal.
        proposals: By who proposed, how many were confirmed, moved, rejected and left open.
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
        ran = {
            (start.trial, start.attempt): (start, end)
            for start, end in attempts(read_events(events_path(folder, clip.participant)))
        }
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
        apart = abs(event.t_s - clip.proposals[n].t_s) > _SAME_S
        if verdict != "rejected" and apart:
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
