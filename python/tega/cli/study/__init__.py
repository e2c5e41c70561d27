"""Plan, lead, score and report a user study: ``tega-teleop study``."""

from __future__ import annotations

import click

from tega.cli.study.bundle import bundle, open_
from tega.cli.study.clips import clips
from tega.cli.study.detect import detect
from tega.cli.study.forms import forms
from tega.cli.study.object import object_
from tega.cli.study.observe import observe
from tega.cli.study.plan import plan, status
from tega.cli.study.power import power
from tega.cli.study.privacy import export, withdraw
from tega.cli.study.report import report
from tega.cli.study.run import run
from tega.cli.study.score import score
from tega.cli.study.sensitivity import sensitivity
from tega.cli.study.simulate import simulate
from tega.cli.study.tell import tell

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
    power,
    simulate,
    sensitivity,
):
    study.add_command(_verb)
