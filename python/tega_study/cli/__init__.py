"""Plan, lead, score and report a user study: ``tega-teleop study``."""

from __future__ import annotations

import click

from tega_study.cli.bundle import bundle, open_
from tega_study.cli.clips import clips
from tega_study.cli.detect import detect
from tega_study.cli.forms import forms
from tega_study.cli.object import object_
from tega_study.cli.observe import observe
from tega_study.cli.plan import plan, status
from tega_study.cli.power import power
from tega_study.cli.privacy import export, withdraw
from tega_study.cli.report import report
from tega_study.cli.run import run
from tega_study.cli.score import score
from tega_study.cli.sensitivity import sensitivity
from tega_study.cli.simulate import simulate
from tega_study.cli.sites import sites
from tega_study.cli.tell import tell

__all__ = ["study"]


@click.group(epilog="Example: tega-teleop study plan --participants 12 --out my-study")
def study() -> None:
    """Plan, lead, score and report a user study."""


for _verb in (
    plan,
    object_,
    forms,
    run,
    tell,
    observe,
    detect,
    clips,
    status,
    score,
    report,
    withdraw,
    export,
    bundle,
    open_,
    sites,
    power,
    simulate,
    sensitivity,
):
    study.add_command(_verb)
