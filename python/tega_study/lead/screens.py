"""Compose the experimenter's screens: while a trial is waited for, and while it goes on."""

from __future__ import annotations

from collections.abc import Sequence

from tega_study.journal import JournalEvent
from tega_study.lead.benches import TrialBench
from tega_study.lead.experimenter import Screen
from tega_study.lead.keys import keys_of
from tega_study.lead.rest_tasks import RunningTask
from tega_study.lead.trial import LedTrial
from tega_study.side_scores import beep_sentence


def waiting(
    heading: str, thing: str, left_s: float, before: Sequence[str], keys: Sequence[tuple[str, str]]
) -> Screen:
    """Return the screen of a rest, and of being asked to begin once it is over (``left_s`` of 0).

    ``thing`` is what will be lifted, ``""`` after the last trial; ``before`` how the trial before went,
    ``keys`` what can be noted about it.
    """
    stop = ("q q", "stop here")
    if left_s > 0:
        return Screen("rest", heading, f"rest  {_clock(left_s)}", before, [stop, *keys])
    if not thing:
        return Screen("ready", heading, "Enter to end the session", before, [("Enter", "end"), *keys])
    big = f"put the {thing} in its place; Enter to begin"
    return Screen("ready", heading, big, before, [("Enter", "begin"), stop, *keys])


def doing(heading: str, running: RunningTask) -> Screen:
    """Return the screen of a task in a rest."""
    left = "" if running.left_s is None else f"  {running.left_s:.0f} s"
    return Screen("task", heading, running.prompt + left, [running.task.words], [("a", "end it")])


def running(heading: str, led: LedTrial, window_s: float, *, bench: TrialBench) -> Screen:
    """Return the screen of a trial from the moment its devices start."""
    going = led.going
    big = {
        "preparing": going.reason or "devices start",
        "countdown": f"ready … {max(1, round(led.left_s + 0.5))}",
    }.get(led.phase, f"{going.elapsed_s():5.1f} s of {window_s:g}")
    lines = [] if led.phase != "trial" else [_about(led)]
    if going.state == "hold":
        lines.append(f"hold: {going.reason}")
    keys = [("a", "break off")]
    if led.phase == "trial":
        keys = keys_of(sees_height=bench.sees_height, measures_height=bench.measures_height)
    if led.phase == "trial" and led.beeps is not None:
        keys.append((led.beeps.key, "participant noticed a beep"))
    return Screen(led.phase, heading, big, lines, keys, going.alerts)


def ended(led: LedTrial, end: JournalEvent) -> list[str]:
    """Return the messages for an ended trial."""
    status = "" if end.status == "done" else f" ({end.status})"
    parts = [f"trial {led.trial.trial}: {end.text}{status}{beep_sentence(led.events(), end.t_ns)}"]
    if led.lift_off_s is None and any(event.kind == "slip" for event in led.events()):
        parts.append("No lift-off was marked, so the slips of this trial count as before lift-off.")
    return parts


def _about(led: LedTrial) -> str:
    rule = led.rule
    if rule.lifted:
        how = "lifted and held"
    elif rule.since_s is not None:
        how = "at the mark"
    elif led.lift_off_s is not None:
        how = "off the table"
    else:
        how = "on the table"
    events = led.events()
    n = {kind: sum(event.kind == kind for event in events) for kind in ("slip", "deformation", "drop")}
    return f"{how}   slips {n['slip']}   deformations {n['deformation']}   drops {n['drop']}"


def _clock(left_s: float) -> str:
    whole = max(0, int(left_s + 0.999))
    return f"{whole // 60}:{whole % 60:02d}"
