"""The result of a soak, for people and machines, and as a picture: its faults and its memory over time."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from tega.runtime.lifecycle import require

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["MOST_LOST_S", "SoakFault", "SoakReport", "draw", "memory_is_flat", "print_report"]

MOST_LOST_S = 0.5
LEAST_JUDGED = 0.95
"""Share of the faults that have to be judged; the rest fell into a standstill of the machine."""

NOT_JUDGED = "not judged"
# What an interpreter with threads takes and gives back by itself.
_SLACK_MIB = 16.0
_SLACK_SHARE = 0.1


class SoakFault(msgspec.Struct, kw_only=True):
    """One fault.

    Attributes:
        how: In the emulator's own word.
        injected_s: When, since the soak's beginning.
        ended_s: When the soak took it away.
        detected_s: When the program first reported it; ``None`` if it never did.
        recovered_s: When it was active again and nothing was wrong; ``None`` if it never was.
        said: What it reported.
        outcome: ``recovered``, ``restarted``, or what went wrong.
    """

    kind: str
    device: str
    how: str
    injected_s: float
    ended_s: float | None = None
    detected_s: float | None = None
    recovered_s: float | None = None
    said: str = ""
    outcome: str = "the soak ended before"

    @property
    def judged(self) -> bool:
        """Whether it can be judged."""
        return not self.outcome.startswith(NOT_JUDGED)

    @property
    def good(self) -> bool:
        """Whether it was reported, and over afterwards; or cannot be judged."""
        return self.outcome in {"recovered", "restarted"} or not self.judged


class SoakReport(msgspec.Struct, kw_only=True):
    """What a soak showed.

    Attributes:
        failures: Why not.
        over_limit_commands: Commands above a limit that emulated vest and hand got, and the arm as recorded.
        over_limit: The same by device.
        lost_s: The longest stretch that a recording lost at a kill, a full disk, or on the way.
        lost_where: In which recording, and where in it.
        rss_mib_start: Resident memory soon after the start of the longest process.
        rss_mib_end: The same at its end.
        commands: Messages that vest and hand took in all, and targets that the arm was given.
        stood_still_s: How long the whole machine, this program included, did nothing.
        emulators_first: Whether the system let the emulators go before all threads of the run, as devices go.
        stations: Whether there were two stations instead of one program.
        patient: Whether the hand's limits of silence and rate were loosened for a busy machine.
        memory: Resident memory over time, of every process, as (seconds since the soak's beginning, MiB).
    """

    passed: bool = False
    failures: list[str] = []
    seconds: float = 0.0
    seed: int = 0
    faults: list[SoakFault] = []
    over_limit_commands: int = 0
    over_limit: dict[str, int] = {}
    lost_s: float = 0.0
    lost_where: str = ""
    rss_mib_start: float = 0.0
    rss_mib_end: float = 0.0
    restarts: int = 0
    commands: dict[str, int] = {}
    stood_still_s: float = 0.0
    recordings: int = 0
    stations: bool = False
    patient: bool = False
    emulators_first: bool = False
    memory: list[list[tuple[float, float]]] = []

    def judge(self) -> None:
        """Set ``passed``, ``failures`` and ``over_limit_commands`` from everything else."""
        failed = self.failures
        failed += [f"{f.kind} of {f.device} ({f.how}): {f.outcome}" for f in self.faults if not f.good]
        if not self.faults:
            failed.append("no fault was made: the soak was too short")
        failed += self._unproven()
        self.over_limit_commands = sum(self.over_limit.values())
        if self.over_limit_commands:
            failed += [
                f"{n} commands above a limit reached the {name}" for name, n in self.over_limit.items() if n
            ]
        if self.lost_s > MOST_LOST_S:
            failed.append(
                f"{self.lost_s:.2f} s of a recording are lost ({self.lost_where}), {MOST_LOST_S} s are allowed"
            )
        if not memory_is_flat(self.rss_mib_start, self.rss_mib_end):
            failed.append(f"memory grew from {self.rss_mib_start:.0f} to {self.rss_mib_end:.0f} MiB")
        self.passed = not failed

    def _unproven(self) -> list[str]:
        """Return what this soak does not show because too little of it took place."""
        judged = [fault for fault in self.faults if fault.judged]
        unproven = []
        if len(judged) < LEAST_JUDGED * len(self.faults):
            unproven.append(
                f"{len(judged)} of {len(self.faults)} faults could be judged, {100 * LEAST_JUDGED:g} % have to be"
            )
        kinds = {(f.kind, f.device, f.how) for f in self.faults}
        never = sorted(kinds - {(f.kind, f.device, f.how) for f in judged})
        unproven += [f"{kind} of {device} ({how}) was never judged" for kind, device, how in never]
        idle = [name for name in ("vest", "hand", "arm") if self.commands.get(name, 0) == 0]
        unproven += [f"the {name} was commanded nothing" for name in idle]
        if self.recordings == 0:
            unproven.append("nothing was recorded")
        if self.rss_mib_start <= 0 or self.rss_mib_end <= 0:
            unproven.append("memory was not measured")
        return unproven


def memory_is_flat(start_mib: float, end_mib: float) -> bool:
    """Return whether memory has grown by no more than an interpreter's own ups and downs."""
    return end_mib <= start_mib * (1 + _SLACK_SHARE) + _SLACK_MIB


def print_report(report: SoakReport, out: Console) -> None:
    """Print a report as tables."""
    from rich.box import SIMPLE
    from rich.table import Table

    table = Table(box=SIMPLE)
    for name in ("at s", "fault", "device", "lasted s", "reported after s", "well after s", "outcome"):
        table.add_column(name, justify="right" if name.endswith(" s") else "left")
    for f in report.faults:
        table.add_row(
            f"{f.injected_s:.1f}",
            f"{f.kind} ({f.how})",
            f.device,
            _after(f.ended_s, f.injected_s),
            _after(f.detected_s, f.injected_s),
            _after(f.recovered_s, f.ended_s),
            f.outcome,
            style="" if f.good else "red",
        )
    out.print(table)
    patient = ", the hand with loosened limits" if report.patient else ""
    form = ", two stations" if report.stations else ""
    out.print(
        f"{report.seconds:.0f} s{form}, {len(report.faults)} faults, {sum(f.judged for f in report.faults)} judged, "
        f"{sum(f.good and f.judged for f in report.faults)} as they should be, "
        f"{report.restarts} restarts; {report.over_limit_commands} commands above a limit of "
        f"{sum(report.commands.values())}{patient}; at most {report.lost_s:.2f} s of a recording lost; "
        f"memory {report.rss_mib_start:.0f} to {report.rss_mib_end:.0f} MiB",
        highlight=False,
    )
    for failure in report.failures:
        out.print(f"failed: {failure}", markup=False, highlight=False)
    out.print("passed" if report.passed else "not passed", highlight=False)


def _after(at_s: float | None, from_s: float | None) -> str:
    return "–" if at_s is None or from_s is None else f"{at_s - from_s:.2f}"


_ROW_IN = 0.14
_GOOD, _BAD, _TOLD, _MEMORY = "#8fb8de", "#d1495b", "#20639b", "#3b3b3b"


def draw(report: SoakReport, path: Path) -> None:
    """Draw every fault as a bar from its beginning until all was well again, above each process's memory.

    The ending of ``path`` is the kind of picture.
    """
    figures = require("matplotlib.figure", driver="the picture of a soak", extra="pictures")
    rows = sorted({(f.device, f.kind) for f in report.faults}, reverse=True)
    above, below = 0.5 + _ROW_IN * len(rows), 1.4
    figure = figures.Figure(figsize=(10, above + below), layout="constrained")
    faults, memory = figure.subplots(2, 1, sharex=True, height_ratios=(above, below))
    faults.set_ylim(-0.8, len(rows) - 0.2)
    for f in report.faults:
        row = rows.index((f.device, f.kind))
        end_s = f.recovered_s or f.ended_s or f.injected_s
        faults.barh(
            row,
            max(end_s - f.injected_s, 0.3),
            left=f.injected_s,
            color=_GOOD if f.good else _BAD,
            height=0.7,
        )
        if f.detected_s is not None:
            faults.plot([f.detected_s] * 2, [row - 0.35, row + 0.35], color=_TOLD, linewidth=1.5)
    faults.set_yticks(range(len(rows)), [f"{device}: {kind}" for device, kind in rows], fontsize=7)
    faults.set_title(
        "Bars: from the fault until all is well again; dark line: told. All devices emulated.", fontsize=9
    )
    faults.grid(axis="x", alpha=0.3)
    for process in report.memory:
        memory.plot(*zip(*process, strict=True), color=_MEMORY, linewidth=1)
    memory.set_ylim(bottom=0)
    memory.set_ylabel("memory, MiB", fontsize=8)
    memory.set_xlabel("seconds", fontsize=8)
    memory.grid(alpha=0.3)
    figure.savefig(path, dpi=110)
