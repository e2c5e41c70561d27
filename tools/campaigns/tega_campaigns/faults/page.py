"""The page of the docs that the trials make."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from tega_campaigns.faults.trials import FAULTS, DriverOutcome, FaultTrial
from tega_campaigns.report import seconds, table

__all__ = ["page"]

_COLUMNS = ("the emulator", "effect", "after", "back", "the driver")

_HEAD = """# When something breaks

What every driver does, and in what time, tried on its emulator in another process. Written by

```sh
python -m tega_campaigns.faults --markdown docs/faults.md      # about ten minutes, Linux
python -m tega_campaigns.faults --only cyton --fault unplug    # one cell, printed
```

on a shared two-core machine; a trial during which the machine stood still is tried again. The times are those of one
run, with emulators: a real radio, adapter or hub adds its own. *After* is counted from the fault to its effect, *back*
from the fault's end to fresh data or the right touch. A finger is silent on the vest 100 ms after its last picture.

| effect | meaning |
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
    glance = [
        (_code(driver), *(_short(by_cell[driver, f][1]) if (driver, f) in by_cell else "–" for f in FAULTS))
        for driver in drivers
    ]
    parts = [
        _HEAD + "## At a glance\n",
        table(("", *FAULTS), glance),
        "–: that cannot happen there; the reason is below.\n",
    ]
    for fault, what in FAULTS.items():
        rows = [
            _row(_code(driver), *by_cell[driver, fault])
            if (driver, fault) in by_cell
            else (_code(driver), "–", "–", "", "", cannot[driver, fault])
            for driver in drivers
        ]
        parts += [f"## {fault.capitalize()}\n", f"{what}\n", table(("driver", *_COLUMNS), rows)]
    others = [
        _row(f"{_code(trial.driver)}, {trial.fault}", trial, outcome)
        for trial, outcome in done
        if trial.fault not in FAULTS
    ]
    parts += ["## Others\n", table(("driver, fault", *_COLUMNS), others)]
    return "\n".join(parts)


def _row(first: str, trial: FaultTrial, outcome: DriverOutcome) -> tuple[str, ...]:
    after, back = _seconds(outcome.seen_s), _seconds(outcome.back_s)
    return (first, trial.what, outcome.effect, after, back, outcome.said)


def _short(outcome: DriverOutcome) -> str:
    after, back = _seconds(outcome.seen_s), _seconds(outcome.back_s)
    return outcome.effect + (f" {after}" if after else "") + (f", back {back}" if back else "")


def _seconds(value: float | None) -> str:
    return "at once" if value is not None and value < 0.005 else seconds(value, never="")


def _code(driver: str) -> str:
    name, bracket, rest = driver.partition(" (")
    return f"`{name}`" + (f" ({rest}" if bracket else "")
