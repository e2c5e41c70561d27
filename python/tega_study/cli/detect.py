"""Find lift-off and slip in the signals of trials: ``tega-teleop study detect``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from tega.ui.cli.options import echo_json, json_option
from tega_study.cli.options import folder_argument

if TYPE_CHECKING:
    from tega_study.detecting import TrialEvents


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
    if as_json:
        rows = msgspec.to_builtins(found)
        for row, one in zip(rows, found, strict=True):
            row["events"] = [event._asdict() for event in one.events]
            row["unobservable"] = one.unobservable
        echo_json({"trials": rows})
        return
    for one in found:
        again = " again" if one.attempt > 1 else ""
        click.echo(f"{one.participant} trial {one.trial}{again}, {one.object}: {_reported(one)}")
    for subject, lacks in _LACKS.items():
        if n_lack := sum(subject in one.missing for one in found):
            click.echo(f"{n_lack} of {len(found)} trials have no {lacks}")


_LACKS = {
    "closure": "closure of the hand on record: slips are not observable on this rig",
    "height": "height of the arm on record: lift-off and slips are not observable on this rig",
}


def _reported(one: TrialEvents) -> str:
    words = [
        f"{event.kind.replace('_', '-')} {event.t_s:.2f} s ({event.confidence:.2f})"
        for event in one.events
        if not event.finger
    ]
    fingers = sum(event.kind == "contact" for event in one.events)
    return ", ".join([*words, f"{fingers} contact{'' if fingers == 1 else 's'} of fingers"])
