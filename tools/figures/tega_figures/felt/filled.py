"""Run the planned study of the task ``fill`` on simulated people: ``filled.toml`` beside this module is the plan.

``python -m tega_figures.felt.filled first --out first.jsonl`` runs what the file does not hold yet, and prints the
plan's hash and a table: losses of each arm, and differences within people from the run's first arm.
"""

from __future__ import annotations

import argparse
import hashlib
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from scipy import stats

from tega_sim.plan import TrialResult
from tega_sim.trials import plan_trials, run_trials

__all__ = ["people_for", "table"]

_PLAN: Final = Path(__file__).with_suffix(".toml")
_OBJECT: Final = "container"


def people_for(difference: float, sd: float, *, alpha: float = 0.05 / 3, power: float = 0.8) -> int:
    """Return how many people a paired t test needs to find a difference, 32 to 64."""
    for n in range(32, 64):
        reach = stats.t.ppf(1 - alpha / 2, n - 1)
        if stats.nct.sf(reach, n - 1, abs(difference) / sd * n**0.5) >= power:
            return n
    return 64


def table(results: Sequence[TrialResult], *, confidence: float) -> str:
    """Return a Markdown table: each arm's losses, slips and level, and the first arm's difference from each."""
    arms = {
        arm: [r for r in results if r.condition == arm] for arm in dict.fromkeys(r.condition for r in results)
    }
    lost = {arm: np.array([not r.success for r in rows], float) for arm, rows in arms.items()}
    first = next(iter(arms))
    lines = [
        f"| arm | people | lost | slips | level | {first} less it: lost ({100 * confidence:.4g} %) | SD |",
        "|---" * 7 + "|",
    ]
    for arm, rows in arms.items():
        apart = lost[first] - lost[arm]
        cells = [arm, str(len(rows)), str(int(lost[arm].sum()))]
        cells += [f"{np.mean([getattr(r, name) for r in rows]):.2f}" for name in ("slips", "mean_level")]
        if arm != first:
            low, high = stats.ttest_1samp(apart, 0).confidence_interval(confidence)
            cells += [f"{apart.mean():+.3f} ({low:+.3f} to {high:+.3f})", f"{apart.std(ddof=1):.3f}"]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _main() -> None:
    plan = tomllib.loads(_PLAN.read_text())
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("run", choices=plan["runs"], help="which run of the plan")
    words.add_argument("--people", type=int, help="instead of the plan's")
    words.add_argument("--out", type=Path, required=True, help="keep results in this file, and go on from it")
    given = words.parse_args()
    run, task = plan["runs"][given.run], dict(plan["task"])
    del task["rules"]  # which people have followed since
    seeds = range(run["first_seed"], run["first_seed"] + (given.people or run["people"]))
    plans = plan_trials([_OBJECT], run["conditions"], seeds, mass_kg=[task.pop("mass_kg")], **task)
    results = run_trials(plans, out=given.out)
    print(f"plan {hashlib.sha256(_PLAN.read_bytes()).hexdigest()}, {len(seeds)} people from seed {seeds[0]}")
    print(table(results, confidence=1 - 0.05 / 3 if given.run == "vest" else 0.95))


if __name__ == "__main__":
    _main()
