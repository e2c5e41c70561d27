"""Print the summary of a run and the findings of a replay, for people."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tega.errors import RecordingError
from tega.runtime.words import number_text, printable
from tega.ui.cli.options import echo_json, with_origin

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from tega.records.bus import Bus


def echo_summary(summary: dict[str, Any], *, wall_s: float, as_json: bool) -> None:
    """Report a summary of ``run_session`` as text or JSON.

    Raises ``RecordingError`` if recording stopped before the run, ``KeyboardInterrupt`` if the run was stopped.
    ``wall_s``, this run's duration, is printed and written to no file; JSON has a table ``measured`` of
    ``wall_s`` and ``real_time_factor``.
    """
    measured = {"wall_s": wall_s, "real_time_factor": summary["duration_s"] / wall_s}
    if as_json:
        echo_json({**summary, "measured": measured})
    else:
        print_summary(summary, measured=measured)
    if (recording := summary.get("recording")) is not None:
        check_recorded(recording)
    if summary["ended"] == "stopped":
        raise KeyboardInterrupt


def check_recorded(recording: Mapping[str, Any]) -> None:
    """Raise ``RecordingError`` if a recording, by its summary, stopped before what it records."""
    if recording["state"] != "complete":
        raise RecordingError(
            f"recording stopped after {recording['duration_s']:.1f} s: {recording['reason']}",
            f"{recording['file']} holds what came before",
        )


def _print_link(out: Console, net: dict[str, Any]) -> None:
    operator = net["station"] == "operator"
    n_led = "" if operator else f"{net['leaders']} operator{'' if net['leaders'] == 1 else 's in turn'}"
    words = [f"led robot {net['robot']!r}" if operator else f"led by {n_led}"]
    if operator and net["lost"]:
        words.append(f"lost it {net['lost']} time{'' if net['lost'] == 1 else 's'}")
    if (route := net["way_ms"]) is not None:
        subject = "touch" if operator else "commands"
        words.append(f"{subject} on the way {route['p50']:.1f} ms (p99 {route['p99']:.1f})")
    if (clock := net["clock"]) is not None:
        words.append(f"clock {clock['offset_ms']:+.1f} ms ± {clock['round_trip_ms'] / 2:.1f}")
    refused = net["refused_features" if operator else "refused_commands"]
    if refused:
        words.append("not used: " + ", ".join(f"{n} {why}" for why, n in refused.items()))
    out.print(f"link: {', '.join(words)}", soft_wrap=True)


def _print_arm(out: Console, arm: dict[str, Any]) -> None:
    shares = ", ".join(f"{state} {s:.1f} s" for state, s in arm["state_s"].items() if s)
    if off := arm.get("off_target_mm"):
        shares += f"; {off['rms']:.1f} mm from its target (rms), {off['worst']:.1f} at most"
    out.print(f"arm: {arm['source']}, led by {arm['led_by']}, {arm['holds']} holds; {shares}")


def print_summary(summary: dict[str, Any], *, measured: dict[str, float]) -> None:
    """Print a summary of ``run_session``, with ``wall_s`` and ``real_time_factor``, which are in no file."""
    out = wide_console()
    if summary["tactile"]:
        table = figures_table(["finger", "source"], ["frames", "Hz", "CCI max", "EDA max"], "touch")
        table.add_column("baseline")
        for finger, f in summary["tactile"].items():
            baseline = "estimated" if f["baseline"].startswith("estimated") else f["baseline"]
            figures = (
                str(f["frames"]),
                number_text(f["rate_hz"] or 0),
                *map(_short, (f["cci_max"], f["eda_max"])),
            )
            table.add_row(finger, printable(f["source"]), *figures, baseline)
        out.print(table)
    if (emg := summary["emg"]) is not None:
        rate_hz, levels = number_text(emg["rate_hz"]), summary["hand"]["level_s"]
        title = f"intent from {printable(emg['source'])} ({emg['kind']}, {rate_hz} Hz), time at each level"
        columns = [*(f"{name} max" for name in emg["channels"]), *(f"at {level}" for level in levels)]
        table = figures_table([], columns, title)
        table.add_row(*map(_short, emg["maxima"]), *(f"{s:.1f} s" for s in levels.values()))
        out.print(table)
    vest = summary["vest"]
    sent = f", {vest['sent']} sent, {vest['skipped']} unchanged" if vest["sent"] else ""
    lead_s = summary.get("played", {}).get("lead_s", 0.0)  # before a recording begins to play
    out.print(
        f"{summary['ended']}: {max(summary['duration_s'] - lead_s, 0.0):.2f} s of input, {vest['frames']} vest frames "
        f"({vest['layout']}{sent}), {4 * summary['hand']['ticks']} torque frames"
    )
    for name, text in summary.get("inputs", {}).items():
        away = f", no data {100 * text['no_data_share']:.0f} % of the time" if text["no_data_share"] else ""
        out.print(f"{name.replace('_', ' ')}: {text['source']}, {text['presses']} presses{away}")
    for name, print_row in (("arm", _print_arm), ("net", _print_link)):
        if (row := summary.get(name)) is not None:
            print_row(out, row)
    _print_safety(out, summary)
    for note in summary["notes"]:
        out.print(printable(f"note: {note}"))
    if (recording := summary.get("recording")) is not None:
        n_dropped = sum(recording["dropped"].values())
        lost = f"{n_dropped} records dropped" if n_dropped else "nothing dropped"
        size = f"{recording['bytes'] / 1e6:.1f} MB"
        out.print(f"recorded: {recording['file']}, {size}, {lost}", soft_wrap=True)
    if (pacing := summary.get("pacing")) is not None:
        out.print(
            f"paced by the clock: {pacing['overruns']} of {pacing['ticks']} ticks late by more than 3 ms "
            f"(worst {pacing['worst_late_ms']:.1f} ms), {pacing['skipped']} skipped"
        )
    else:
        out.print(f"took {measured['wall_s']:.2f} s: {measured['real_time_factor']:.1f} times real time")


def _print_safety(out: Console, summary: dict[str, Any]) -> None:
    changes = summary["safety"]["changes"]
    # A run that was active from the first moment to its end has nothing to report.
    if len(changes) > 3 or (changes and changes[0]["t_s"] > 0):
        table = figures_table([], ["s"], "states")
        table.add_column("state")
        table.add_column("why")
        for change in changes:
            table.add_row(f"{change['t_s']:.2f}", change["state"], change["reason"])
        out.print(table)
    if [change["state"] for change in changes] == ["stopped"] and (alerts := summary["safety"]["alerts"]):
        out.print(f"never armed: {'; '.join(alerts)}", soft_wrap=True)
    for table in latency_tables(summary.get("latency_ms", {})):
        out.print(table)
    if "motor_onset" in summary:
        motor = summary["motor_onset"]
        unknown = "not measured, so the latency ends at the vest's transport (tega-teleop vest onset)"
        out.print(f"motor onset: {unknown}" if motor is None else motor["said"])


def latency_tables(latency_ms: dict[str, Any]) -> Iterator[Table]:
    """Make a table of every path's stages; fewer than 100 samples have no percentiles."""
    titles = {"touch": "camera to vest, ms", "intent": "muscle to hand, ms", "motion": "muscle to joint, ms"}
    for path, stages in latency_ms.items():
        table = figures_table(["stage"], ["n", "p50", "p95", "p99", "worst"], titles[path])
        for stage, spread in stages.items():
            names = ("p50", "p95", "p99", "worst")
            figures = (f"{spread[name]:.2f}" if name in spread else "-" for name in names)
            table.add_row(stage, str(spread["n"]), *figures)
        yield table


def _short(value: float | None) -> str:
    return "none" if value is None else number_text(value)


class Findings:
    """Follows the replay of a recording on its bus, and reports its findings afterwards.

    ``picture`` is the PNG to draw; ``None`` for words alone. If it is ``required`` and matplotlib is not
    installed, ``MissingExtraError`` is raised before the run; else a note at the end reports that.
    """

    def __init__(self, bus: Bus, picture: Path | None, *, required: bool) -> None:
        from tega.errors import MissingExtraError
        from tega.ui.view.course import RunCourse, SessionPicture

        self._course, self._path = RunCourse(bus), picture
        self._picture: SessionPicture | None = None
        self._note = ""
        if picture is not None:
            try:
                self._picture = SessionPicture(bus, self._course)
            except MissingExtraError as error:
                if required:
                    raise
                self._note = f"no picture: {error}"

    def notify(self, title: str, *, pose_base: int, words: bool) -> None:
        """Draw the picture and print the words; the most open level is number ``pose_base``, 0 or 1."""
        if words:
            for sentence in self._course.words(pose_base=pose_base):
                click.echo(f"  {sentence}")
        if self._picture is not None and self._path is not None:
            self._picture.write(self._path, title, pose_base=pose_base)
            if words:
                click.echo(f"  picture: {self._path}")
        if self._note:
            click.echo(with_origin(self._note), err=True)


def figures_table(left: Sequence[str], right: Sequence[str], title: str = "", **layout: Any) -> Table:
    """Return an empty table: columns of words, then columns of figures."""
    from rich.box import SIMPLE
    from rich.table import Table

    table = Table(title=title or None, title_justify="left", **({"box": SIMPLE} | layout))
    for place, name in enumerate(left):
        table.add_column(name, no_wrap=place == 0)
    for name in right:
        table.add_column(name, justify="right", overflow="fold")  # a number that is cut off is another one
    return table


def wide_console() -> Console:
    """Return a console that breaks no line of a table where the output is no terminal."""
    from rich.console import Console

    return Console(highlight=False, markup=False, width=None if Console().is_terminal else 160)
