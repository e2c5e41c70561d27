"""Compare accounts of the same trials and add some: ``tega-teleop study score``, ``detect`` and ``clips``."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import click

from tega.ui.cli.options import FILE, PATH, FiniteRange, answer, json_option, progress_bar
from tega_study.cli.options import FOLDER, folder_argument, shown_option

_COLUMNS = {
    "event": "kind",
    "first": "a",
    "second": "b",
    "trials": "trials",
    "n first": "n_a",
    "n second": "n_b",
    "F1": "f1",
    "chance": "chance_f1",
    "delay s": "delay_s",
    "kappa 1 s": "kappa",
    "ICC": "icc",
    "": "note",
}
"""Attributes of an agreement in the printed table, by heading."""


@click.command(epilog="Example: tega-teleop study score my-study --boris my-study.boris")
@folder_argument
@shown_option(
    "--tolerance-s",
    type=FiniteRange(0.01, 10),
    default=1.0,
    help="How far apart two events may be and still be one; 0.5 suits video, 1 suits live.",
)
@click.option("--boris", type=PATH, metavar="OUT.boris", help="Write a BORIS project.")
@click.option(
    "--elan", type=PATH, metavar="FOLDER", help="Write an ELAN file for each trial into a new folder."
)
@click.option(
    "--import",
    "taken",
    type=PATH,
    metavar="FILE",
    help="Events to import: a BORIS project (.boris, .boris.gz), its tabular or aggregated events as TSV or CSV, or an "
    "ELAN file or a folder of them.",
)
@click.option(
    "--rater", metavar="ID", help="With --import: code of the rater whose events they are; it must be new."
)
@json_option
def score(
    *,
    folder: Path,
    tolerance_s: float,
    boris: Path | None,
    elan: Path | None,
    taken: Path | None,
    rater: str | None,
    as_json: bool,
) -> None:
    """Compare raters, experimenter and, in simulation, the truth on the same trials.

    F1 of matched events with its chance level, delay, Cohen's kappa in bins of a second, ICC of the counts. With
    --json: {"agreements": [...], "imported": {person: trials}, "boris": file, "elan": folder}.
    """
    import msgspec

    from tega_study.plan import read_plan
    from tega_study.score.accounts import agreements
    from tega_study.score.boris import export_boris, export_elan, import_boris

    if (taken is None) != (rater is None):
        raise click.UsageError("--import FILE and --rater ID belong together")
    read_plan(folder)
    imported = {} if taken is None or rater is None else import_boris(folder, taken, rater)
    written = 0 if boris is None else export_boris(folder, boris)
    n_elan = 0 if elan is None else export_elan(folder, elan)
    found = agreements(folder, tolerance_s=tolerance_s)
    files = {"boris": boris and str(boris), "elan": elan and str(elan)}
    lines = [f"{person}: {n} trials of rater {rater} taken in" for person, n in imported.items()]
    if boris is not None:
        lines.append(f"{boris}: {written} observations")
    if elan is not None:
        lines.append(f"{elan}: {n_elan} ELAN files")
    if found:
        lines.append(f"events within {tolerance_s:g} s are one; delay: second less first")
        values = ((getattr(one, name) for name in _COLUMNS.values()) for one in found)
        cells = (
            [f"{v:.2f}" if isinstance(v, float) else str("–" if v is None else v) for v in one]
            for one in values
        )
        rows = [list(_COLUMNS), *cells]
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        lines += ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]
    else:
        lines.append("nothing to compare: two accounts of the same trials are needed, such as two raters")
    answer({"agreements": msgspec.to_builtins(found), "imported": imported, **files}, lines, as_json=as_json)


@click.command(epilog="Example: tega-teleop study detect my-study p01")
@folder_argument
@click.argument("participants", nargs=-1, metavar="[PARTICIPANT]...")
@click.option(
    "--live",
    is_flag=True,
    help="Use only earlier data at each moment (causal), as event-gated feedback must.",
)
@json_option
def detect(*, folder: Path, participants: tuple[str, ...], live: bool, as_json: bool) -> None:
    """Find lift-off and slip in the signals of the trials that were run.

    Fingertips, hand and arm are looked at, and nothing that anybody has said. Each event has a time and a confidence of
    0 to 1; they are written beside the session (sessions/ID/detected.jsonl) and compared with observers by study score
    and study report. They replace no observer's counts. With --json: {"trials": [{"participant", "trial", "attempt",
    "object", "events": [{"kind", "t_s", "confidence", "known_s", "finger"}], "missing",
    "unobservable"}]}.
    """
    import msgspec

    from tega_study.detecting import detect_study

    found = detect_study(folder, participants, live=live)
    rows = msgspec.to_builtins(found)
    lines = []
    for row, one in zip(rows, found, strict=True):
        row |= {"events": [event._asdict() for event in one.events], "unobservable": one.unobservable}
        again = " again" if one.attempt > 1 else ""
        named = [event for event in one.events if not event.finger]
        words = [f"{e.kind.replace('_', '-')} {e.t_s:.2f} s ({e.confidence:.2f})" for e in named]
        fingers = sum(event.kind == "contact" for event in one.events)
        words.append(f"{fingers} contact{'' if fingers == 1 else 's'} of fingers")
        lines.append(f"{one.participant} trial {one.trial}{again}, {one.object}: {', '.join(words)}")
    for subject, lacks in _LACKS.items():
        if n_lack := sum(subject in one.missing for one in found):
            lines.append(f"{n_lack} of {len(found)} trials have no {lacks}")
    answer({"trials": rows}, lines, as_json=as_json)


_LACKS = {
    "closure": "closure of the hand on record: slips are not observable on this rig",
    "height": "height of the arm on record: lift-off and slips are not observable on this rig",
}


@click.command(epilog="Example: tega-teleop study clips my-study r3-clips --rater r3")
@folder_argument
@click.argument("out", type=FOLDER, required=False)
@click.option(
    "--rater", metavar="ID", required=True, help="Code of the rater who gets the clips; it must be new."
)
@click.option(
    "--proposals",
    is_flag=True,
    help="Put the events that rule and detector found into the project, for the rater to decide.",
)
@click.option(
    "--scene",
    "scenes",
    multiple=True,
    type=FILE,
    metavar="SCENE.mcap",
    help="Scene recording of the sessions, which shows the object in the clips; repeatable.",
)
@click.option(
    "--take", type=FILE, metavar="FILE.boris", help="BORIS project with the rater's codes to take in."
)
@json_option
def clips(
    *, folder: Path, out: Path | None, rater: str, take: Path | None, as_json: bool, **requested: Any
) -> None:
    """Make blind, shuffled clips of the recorded trials with a BORIS project, or take one back with --take.

    Clips show fingertips, and what scene cameras of the settings or --scene filmed, in an order of the rater's own.
    With --proposals events of rule and detector stand in the project; the modifier "proposal" confirms or rejects each,
    and a shifted time moves it. Then study score compares; a rater who saw proposals is not compared with rule or
    detector.

    With --json: {"project", "clips", "left_out"}, or with --take {"trials", "unfinished", "added", "proposals"}.
    """
    import msgspec

    from tega_study.score.clips import make_clips, take_clips

    if (out is None) == (take is None):
        raise click.UsageError("name the folder OUT to make clips, or --take FILE.boris to take them back")
    if take is not None:
        taken = take_clips(folder, take, rater)
        lines = [f"{person}: {n} trials of rater {rater} taken in" for person, n in taken.trials.items()]
        for source, counts in taken.proposals.items():
            verdicts = ", ".join(f"{n} {verdict}" for verdict, n in counts.items())
            lines.append(f"proposed by {source}: {verdicts}")
        lines.append(f"added by {rater}: {taken.added}")
        if taken.unfinished:
            lines.append(f"with open proposals, counted in no comparison: {', '.join(taken.unfinished)}")
        answer(msgspec.to_builtins(taken), lines, as_json=as_json)
        return
    assert out is not None
    with progress_bar(enabled=not as_json) as displayed:
        key = make_clips(folder, out, rater, reported=partial(displayed, "clips"), **requested)
    project = out / f"{rater}.boris"
    answer(
        {"project": str(project), "clips": len(key.clips), "left_out": key.left_out},
        [
            f"{len(key.clips)} clips; open {project} in BORIS, save it there, then:",
            f"  tega-teleop study clips {folder} --rater {rater} --take {project}",
            *(f"left out: {line}" for line in key.left_out),
        ],
        as_json=as_json,
    )
