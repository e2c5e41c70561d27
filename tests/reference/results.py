"""Results of simulated trials without a trial."""

from __future__ import annotations

from typing import Any

from tega_sim.plan import TrialResult


def trial_result(**changes: Any) -> TrialResult:
    """Return what came of a lift that was held: after 4 s off the table, after 6 s lifted, over after 9 s."""
    lift: dict[str, Any] = {
        "object": "bag",
        "success": True,
        "slips": 1,
        "deformations": 0,
        "drops": 0,
        "duration_s": 9.0,
        "peak_force_n": 2.0,
        "lift_off_s": 4.0,
        "lifted_s": 6.0,
        "slid_m": 0.0,
        "deformation_m": 0.0,
        "mean_level": 2.0,
        "events": (),
        "simulated_s": 9.0,
    }
    return TrialResult(**lift | changes)
