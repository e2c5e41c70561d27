"""The table of the docs that the trials make."""

from __future__ import annotations

from collections.abc import Sequence

from tega_campaigns.faults.trials import FAULTS, DriverOutcome, FaultTrial
from tega_campaigns.report import seconds, table

__all__ = ["glance"]


def glance(done: Sequence[tuple[FaultTrial, DriverOutcome]]) -> str:
    """Return a row for each driver, with the effect of every fault and its times."""
    cells = {(trial.driver, trial.fault): _short(outcome) for trial, outcome in done}
    drivers = dict.fromkeys(trial.driver for trial, _ in done)
    return table(
        ("", *FAULTS), [(_code(name), *(cells.get((name, f), "–") for f in FAULTS)) for name in drivers]
    )


def _short(outcome: DriverOutcome) -> str:
    after, back = _seconds(outcome.seen_s), _seconds(outcome.back_s)
    return outcome.effect + (f" {after}" if after else "") + (f", back {back}" if back else "")


def _seconds(value: float | None) -> str:
    return "at once" if value is not None and value < 0.005 else seconds(value, never="")


def _code(driver: str) -> str:
    name, bracket, rest = driver.partition(" (")
    return f"`{name}`" + (f" ({rest}" if bracket else "")
