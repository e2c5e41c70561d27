"""Score the slips that a run's own loop tells, by touch alone and by hand and arm, each in the loop that it closes.

``python -m tega_figures.live_slips --seeds 9100:9124`` runs the same simulated people once with each rule.
An event is there at the tick that tells it, with the cameras' delay.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

import click

from tega.records import Event
from tega_figures.slip_score import HEAD, SlipsTold, score_row, slid_mm
from tega_sim.recorded import LiftRecorder
from tega_sim.streams import Streams
from tega_sim.trial import TrialPlan, run_trial

if TYPE_CHECKING:
    from tega.loop.loop_report import LoopReport
    from tega.records.bus import Bus
    from tega_sim.lab import Lab
    from tega_sim.plan import TrialResult

__all__ = ["LiveTrial", "main", "run"]

_OBJECTS: Final = ("bottle", "container", "bag")
_RULES: Final = ("touch", "hand")


class _SlipKeeper(LiftRecorder):
    """Keeps a lift's slips, in the place of its recording."""

    def __init__(self) -> None:
        super().__init__(Path())
        self.slips_s: list[float] = []

    def begin(self, lab: Lab, bus: Bus, **_more: object) -> None:  # noqa: ARG002  # of the recorder
        bus.subscribe(Event, self._keep, vital=True)

    def end(self, report: LoopReport, n_waits: int) -> None:
        """Write nothing."""

    def finish(self, result: TrialResult) -> None:
        """Write nothing."""

    def _keep(self, event: Event) -> None:
        if event.kind == "slip":
            self.slips_s.append(event.taken_ns / 1e9)


class LiveTrial(NamedTuple):
    """A trial, and the slips that its own loop told.

    Attributes:
        result: What became of it.
        slips: True and told ones.
    """

    result: TrialResult
    slips: SlipsTold


def run(plan: TrialPlan) -> LiveTrial:
    """Run a trial and keep the slips that its loop told."""
    heard, streams = _SlipKeeper(), Streams()
    result = run_trial(plan, recorder=heard, streams=streams)
    t_s, speed = streams.array("truth", "t_s"), streams.array("truth", "slip_m_s")
    course = list(zip(t_s.tolist(), speed.tolist(), strict=True))
    truth_s = [event.t_s for event in result.events if event.kind == "slip"]
    slid = [slid_mm(course, at_s) for at_s in heard.slips_s]
    return LiveTrial(result, SlipsTold(plan.seed, result.duration_s / 60, truth_s, heard.slips_s, slid))


@click.command(help=__doc__)
@click.option("--seeds", required=True, metavar="FIRST:END", help="People.")
@click.option("--condition", default="event-gated", help="One whose vest or reflex is told of events.")
@click.option("--set", "sets", multiple=True, metavar="KEY=VALUE", help="Further settings of the loop.")
def main(seeds: str, condition: str, sets: tuple[str, ...]) -> None:
    """Print the scores by rule and object, and what became of the lifts."""
    first, end = map(int, seeds.split(":"))
    rows, ends = [HEAD], []
    for rule in _RULES:
        settings = (f"stages.slips={rule}", *sets)
        plans = [
            TrialPlan.checked({"object": name, "condition": condition, "seed": seed, "settings": settings})
            for seed in range(first, end)
            for name in _OBJECTS
        ]
        trials = [run(plan) for plan in plans]
        for name in ("all", *_OBJECTS):
            some = [one for one in trials if name in {"all", one.result.object}]
            rows.append(score_row(f"{rule}; {name}", [one.slips for one in some]))
            lifted = sum(one.result.success for one in some)
            dropped = sum(one.result.drops for one in some)
            ends.append(f"{rule}; {name}: {lifted} of {len(some)} lifted and held, {dropped} dropped")
    click.echo("\n".join((*rows, *ends)))


if __name__ == "__main__":
    main()
