"""Plan, lead, score and report a user study: ``tega-teleop study``."""

from __future__ import annotations

import click

from tega_study.cli.plan import forms, object_, plan, status
from tega_study.cli.privacy import bundle, export, open_, withdraw
from tega_study.cli.report import power, report
from tega_study.cli.run import observe, run, tell
from tega_study.cli.score import clips, detect, score
from tega_study.cli.simulate import sensitivity, simulate

__all__ = ["study"]


@click.group(epilog="Example: tega-teleop study plan --participants 12 --out my-study")
def study() -> None:
    """Plan, lead, score and report a user study."""


_LED = (plan, object_, forms, run, tell, observe, detect, clips, status)
_DONE = (score, report, withdraw, export, bundle, open_, power, simulate, sensitivity)

for _verb in (*_LED, *_DONE):
    study.add_command(_verb)
