"""The page of the docs that the trials make."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from tega_campaigns.faults.trials import FAULTS, DriverOutcome, FaultTrial

__all__ = ["page"]

_HEAD = """# When something breaks

What every driver does, and in what time, tried on its emulator in another process. Written by

```sh
python -m tega_campaigns.faults --markdown docs/faults.md      # about ten minutes, Linux
python -m tega_campaigns.faults --only cyton --fault unplug    # one cell, printed
```

on a shared two-core machine; a trial during which the machine stood still is tried again. The times are those of one
run, with emulators: a real radio, adapter or hub adds its own. *After* is counted from the fault to its effect, *back*
from the fault's end to fresh data or the right touch. A finger is silent on the vest 100 ms after its last picture.

| effect | what it means |
|---|---|
| refused | opening fails, with the sentence given; nothing was sent |
| ends | reading raises, with the sentence given; a run goes on without; *back* is the time to open it again |
| falls silent | no data, nothing held, or motors at rest; the driver comes back by itself |
| lets go | the hand gets zero torque and SERVO OFF, then stepping raises with the sentence given |
| goes on | the fault is bridged, ignored or counted |

"""


def page(done: Sequence[tuple[FaultTrial, DriverOutcome]], cannot: Mapping[tuple[str, str], str]) -> str:
    """Write the page.

    Args:
        done: Every trial with its outcome.
        cannot: Why a driver cannot meet a fault.
    """
    drivers = list(dict.fromkeys(trial.driver for trial, _ in done))
    by_cell = {(trial.driver, trial.fault): (trial, outcome) for trial, outcome in done}
    lines = [_HEAD + "## At a glance\n"]
    lines += [f"| | {' | '.join(FAULTS)} |", "|---" * (len(FAULTS) + 1) + "|"]
    for driver in drivers:
        cells = [_short(by_cell[driver, f][1]) if (driver, f) in by_cell else "–" for f in FAULTS]
        lines.append(f"| {_code(driver)} | {' | '.join(cells)} |")
    lines.append("\n–: that cannot happen there; the reason is below.\n")
    for fault, what in FAULTS.items():
        lines += [f"## {fault.capitalize()}\n", f"{what}\n", *_header("driver")]
        for driver in drivers:
            if (driver, fault) in by_cell:
                lines.append(_row(_code(driver), *by_cell[driver, fault]))
            else:
                lines.append(f"| {_code(driver)} | – | – | | | {cannot[driver, fault]} |")
        lines.append("")
    lines += ["## Others\n", *_header("driver, fault")]
    lines += [
        _row(f"{_code(trial.driver)}, {trial.fault}", trial, outcome)
        for trial, outcome in done
        if trial.fault not in FAULTS
    ]
    lines.append("")
    return "\n".join(lines)


def _header(first: str) -> list[str]:
    return [f"| {first} | the emulator | effect | after | back | the driver |", "|---|---|---|---|---|---|"]


def _row(first: str, trial: FaultTrial, outcome: DriverOutcome) -> str:
    after, back = _seconds(outcome.seen_s), _seconds(outcome.back_s)
    said = outcome.said.replace("|", "\\|")
    return f"| {first} | {trial.what} | {outcome.effect} | {after} | {back} | {said} |"


def _short(outcome: DriverOutcome) -> str:
    after, back = _seconds(outcome.seen_s), _seconds(outcome.back_s)
    return outcome.effect + (f" {after}" if after else "") + (f", back {back}" if back else "")


def _seconds(value: float | None) -> str:
    return "" if value is None else "at once" if value < 0.005 else f"{value:.2f} s"


def _code(driver: str) -> str:
    name, bracket, rest = driver.partition(" (")
    return f"`{name}`" + (f" ({rest}" if bracket else "")
