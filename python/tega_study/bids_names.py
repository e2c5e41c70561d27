"""Name a study's files as BIDS names files: ``sub-p01/ses-01/beh/sub-p01_ses-01_task-bag_acq-a1_run-07_touch.csv``.

Only the names follow BIDS. The files have TEGA's own formats, so the result is not a BIDS data set.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import PurePosixPath

from tega_study.plan import StudyPlan
from tega_study.privacy import own_name

_SESSION = "ses-01"
_TRIAL = re.compile(r"-t(\d+)(?:-a(\d+))?")


def bids_names(paths: Iterable[str], plan: StudyPlan) -> dict[str, str]:
    """Return a name for each file, no two alike where capitals do not count.

    ``paths`` are relative to the study's folder, with ``/`` as separator. The plan has the people, and the
    object of each trial.
    """
    own = {person: own_name(person) for person in plan.participants}
    things = {trial.id: trial.object for trial in plan.trials}
    found: dict[str, str] = {}
    taken: set[str] = set()
    for path in sorted(paths):
        parts = PurePosixPath(path).parts
        person = next((who for who, mine in own.items() if any(map(mine.fullmatch, parts))), None)
        stem, ending = f"sourcedata/{path}", ""
        if person is not None:
            stem, ending = _of_a_person(parts, person, things)
        name, n = f"{stem}{ending}", 2
        while name.casefold() in taken:
            name, n = f"{stem}{n}{ending}", n + 1
        taken.add(name.casefold())
        found[path] = name
    return found


def _of_a_person(parts: tuple[str, ...], person: str, things: dict[str, str]) -> tuple[str, str]:
    """Return a file's name and its ending: entities in the order of BIDS, then what kind of file it is."""
    *folders, last = parts
    stem, dot, ending = last.rpartition(".") if "." in last[1:] else (last, "", "")
    entities = [f"sub-{label(person)}", _SESSION]
    trial = next((t for part in (*folders, stem) if (t := _TRIAL.match(part, len(person)))), None)
    if trial is not None and (thing := things.get(f"{person}-t{trial[1]}")) is not None:
        entities.append(f"task-{label(thing)}")
        if trial[2] is not None:
            entities.append(f"acq-a{int(trial[2])}")
        entities.append(f"run-{int(trial[1]):02d}")
    # What says neither whose nor which trial says what it is.
    more = [part.removeprefix(person) for part in (*folders, stem) if part != person]
    kinds = [name for part in more if (name := label(_TRIAL.sub("", part, count=1)))]
    *where, kind = kinds or ["file"]
    if len(where) > 1:  # the first is the folder of all files of a kind, such as sessions
        entities.append(f"desc-{''.join(where[1:])}")
    elif where and kind.isdigit():
        kind = where[0] + kind
    folder = f"{entities[0]}/{_SESSION}/beh"
    return f"{folder}/{'_'.join([*entities, kind])}", f".{label(ending)}" if dot and label(ending) else ""


def label(text: str) -> str:
    """Return a text as BIDS wants labels: letters and digits alone."""
    return re.sub(r"[^A-Za-z0-9]", "", text)
