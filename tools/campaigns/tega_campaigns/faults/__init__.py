"""What every driver does when something breaks, and in what time, tried on its emulator.

``python -m tega_campaigns.faults --markdown docs/evidence/faults.md`` writes the table of the docs; ``--only
cyton --only pedal`` tries some drivers, ``--json`` prints what a program can read. All of it
takes about eight minutes, and needs Linux.
"""

from __future__ import annotations

from tega_campaigns.faults.trials import FAULTS, DriverOutcome, FaultTrial, all_trials

__all__ = ["FAULTS", "DriverOutcome", "FaultTrial", "all_trials"]
