"""Stand devices ready for a session, on which nothing happens."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from tega_study.lead.running_trial import Going
from tega_study.plan import PlannedTrial
from tega_study.state import Where


class StandingBench:
    """Devices that stand ready until the experimenter ends the trial.

    Args:
        own_time: Whether a trial's time is the bench's own, not the clock's.
    """

    where: Where = "simulated"
    sees_height = False
    measures_height = False
    closure: Any = None
    rest_tasks: Any = ()
    measurable = False

    def __init__(self, *, own_time: bool = False) -> None:
        self.own_time = own_time

    def felt(self, condition: str) -> bool:
        """Tell whether the vest is on."""
        return condition == "haptic"

    def run(self, _trial: PlannedTrial, going: Going, _folder: Path) -> None:
        """Be armed, begin when told to, and wait for the end."""
        going.notify("armed", "stands ready")
        while not going.over():
            if going.may_go():
                going.begin(0)
            time.sleep(0.001)
