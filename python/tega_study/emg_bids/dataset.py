"""Write the muscle signals of a study as one BIDS data set: EDF+, channels, electrodes, events; or name its files so.

In a bundle only the names follow BIDS: ``sub-p01/ses-01/beh/sub-p01_ses-01_task-bag_acq-a1_run-07_touch.csv``. Those
files have TEGA's own formats, so they are no BIDS data set.
"""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Any, Final, NamedTuple

import tega
from tega.errors import RecordingError
from tega.recording.origin import NOTES, new_session, note_copy
from tega_study.emg_bids.signal import Gap, Muscles, read_muscles, write_edf
from tega_study.journal import JournalEvent, counting, events_path, read_events
from tega_study.plan import StudyPlan, read_plan
from tega_study.privacy import own_name
from tega_study.score.recorded import RecordedTrial, recorded_trials
from tega_study.state import rehearsed
from tega_study.study_notes import staying

BIDS_VERSION: Final = "1.11.1"
_UNKNOWN: Final = "unknown: TEGA does not record it"
_EVENTS: Final = {
    "onset": {"Description": "Time since the first sample of the EMG file.", "Units": "s"},
    "duration": {"Description": "Duration; 0 for an instant.", "Units": "s"},
    "trial_type": {
        "Description": "Kind of the event in the session's journal; lost, padding: samples that were not measured."
    },
    "source": {"Description": "Role or rater that reported the event; n/a for none."},
}
_README: Final = """Muscle signals of a study with TEGA, the tactile-enhanced grasping assistant.

Each run is one trial that counts: the object is the task, the number of the trial in the person's order is the run. The
conditions of the trials are in the study's own plan, not here. Samples are stored with 16 bits over the range of each
channel. Positions of electrodes were not measured. Muscle signals can identify a person: publish them only with that
person's consent.
"""


class BidsExport(NamedTuple):
    """Labels of the people with signals, their EDF files, and the trials without signals, with the reason."""

    people: tuple[str, ...]
    runs: tuple[Path, ...]
    left_out: tuple[str, ...]


def export_bids(folder: Path, out: Path) -> BidsExport:
    """Write the muscle signals of all people who have not withdrawn.

    Raises ``RecordingError`` if there are no signals at all, ``ConfigError`` if ``out`` holds something.
    """
    plan = read_plan(folder)
    new_session(out)
    rows: list[str] = []
    runs: list[Path] = []
    left_out: list[str] = []
    is_rehearsed = False
    try:
        for person in staying(folder, plan):
            if not events_path(folder, person).is_file():
                continue
            events = read_events(events_path(folder, person))
            trials, unseen = recorded_trials(folder, person)
            left_out += unseen
            made = [_run(out, person, trial, events, left_out) for trial in trials]
            if written := [path for path in made if path is not None]:
                runs += written
                in_lab = "no" if rehearsed(events) else "yes"
                is_rehearsed |= rehearsed(events)
                rows.append(f"sub-{label(person)}\t{in_lab}\t{len(written)}")
        _head(out, rows, is_rehearsed=is_rehearsed)
    except BaseException:
        shutil.rmtree(out, ignore_errors=True)
        raise
    return BidsExport(tuple(row.partition("\t")[0] for row in rows), tuple(runs), tuple(left_out))


def _run(
    out: Path, person: str, trial: RecordedTrial, events: Sequence[JournalEvent], left_out: list[str]
) -> Path | None:
    """Write one trial: signals, their description, channels, electrodes and events."""
    path = next(iter(sorted(trial.folder.glob("*.mcap"))), None)
    muscles = None if path is None else read_muscles(path)
    if path is None or muscles is None:
        left_out.append(f"{trial.id}: its recording has no EMG")
        return None
    where = out / f"sub-{label(person)}" / "emg"
    where.mkdir(parents=True, exist_ok=True)
    stem = f"sub-{label(person)}_task-{label(trial.object)}_run-{trial.trial:02d}"
    file = where / f"{stem}_emg.edf"
    gaps = write_edf(file, muscles)
    facts = {
        "TaskName": label(trial.object),
        "TaskDescription": f"Grasp, lift and hold the object {trial.object!r} with a teleoperated hand.",
        "ManufacturersModelName": muscles.device or "n/a",
        "SoftwareVersions": f"TEGA {tega.__version__}",
        "EMGPlacementScheme": "Other",
        "EMGPlacementSchemeDescription": f"Forearm; exact places {_UNKNOWN}.",
        "EMGReference": _UNKNOWN,
        "SamplingFrequency": muscles.rate_hz,
        "PowerLineFrequency": "n/a",
        "RecordingType": "continuous",
        "SoftwareFilters": "n/a",
        "EMGChannelCount": len(muscles.names),
        "RecordingDuration": len(muscles.samples) / muscles.rate_hz,
    }
    _write_json(where / f"{stem}_emg.json", facts)
    columns = [f"{f'EMG {name}'[:16]}\tEMG\t{muscles.unit}\t{muscles.rate_hz:g}" for name in muscles.names]
    _write_table(where / f"{stem}_channels.tsv", "name\ttype\tunits\tsampling_frequency", columns)
    electrodes = where / f"sub-{label(person)}_electrodes.tsv"
    known = electrodes.read_text(encoding="utf-8").splitlines()[1:] if electrodes.is_file() else []
    known += [f"{name}\tn/a\tn/a" for name in muscles.names]
    _write_table(electrodes, "name\tx\ty", list(dict.fromkeys(known)))
    rows = _events(counting(events, trial.trial, trial.attempt), trial, muscles, gaps)
    _write_table(where / f"{stem}_events.tsv", "onset\tduration\ttrial_type\tsource", rows)
    _write_json(where / f"{stem}_events.json", _EVENTS)
    note_copy(path, out)
    return file


def _events(
    events: Sequence[JournalEvent], trial: RecordedTrial, muscles: Muscles, gaps: Sequence[Gap]
) -> list[str]:
    begin_ns = trial.start_ns - trial.zero_ns + muscles.begin_ns
    whole = (trial.start_ns - begin_ns) / 1e9, trial.length_ns / 1e9, "trial", ""
    rows: list[tuple[float, float, str, str]] = [whole]
    rows.extend(((one.t_ns - begin_ns) / 1e9, one.duration_s or 0.0, one.kind, one.source) for one in events)
    rows += [(gap.onset_s, gap.duration_s, gap.kind, "") for gap in gaps]
    return [
        f"{onset:.6f}\t{duration:.6f}\t{kind}\t{re.sub(r'[^ -~]', '?', source) or 'n/a'}"
        for onset, duration, kind, source in sorted(rows)
    ]


def _head(out: Path, rows: Sequence[str], *, is_rehearsed: bool) -> None:
    """Write the files of the whole data set; ``RecordingError`` without any rows of people."""
    if not rows:
        raise RecordingError(
            "no muscle signals: no recorded trial that counts has EMG", "run the study with recordings"
        )
    name = "Rehearsal with TEGA, not data of people" if is_rehearsed else "Study with TEGA"
    _write_json(
        out / "dataset_description.json",
        {
            "Name": f"{name}: muscle signals",
            "BIDSVersion": BIDS_VERSION,
            "DatasetType": "raw",
            "GeneratedBy": [{"Name": "TEGA", "Version": str(tega.__version__)}],
        },
    )
    _write_table(out / "participants.tsv", "participant_id\tin_lab\tn_runs", rows)
    _write_json(
        out / "participants.json",
        {
            "in_lab": {
                "Description": "Whether the session ran in the lab, with a person.",
                "Levels": {"yes": "in the lab", "no": "rehearsed on simulated or emulated devices"},
            },
            "n_runs": {"Description": "Trials with muscle signals."},
        },
    )
    # The list of copies, by which a person's withdrawal finds them, is not a file of BIDS.
    (out / ".bidsignore").write_text(f"{NOTES}\n", encoding="utf-8")
    (out / "README").write_text(_README, encoding="utf-8")


def _write_json(path: Path, content: Mapping[str, Any]) -> None:
    path.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")


def _write_table(path: Path, head: str, rows: Sequence[str]) -> None:
    path.write_text("".join(f"{row}\n" for row in (head, *rows)), encoding="utf-8")


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
