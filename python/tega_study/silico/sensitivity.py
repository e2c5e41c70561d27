"""Vary one assumption at a time, and find over which range each of the paper's directions holds.

Each change is a small study of its own, in ``sensitivity/<change>/``, with the same people and chance as the others. A
parameter is set to either end of its range for everybody; the sham arms take the place of the first condition.
"""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Literal, NamedTuple

import msgspec

from tega.errors import ConfigError, InvalidValueError, RecordingError
from tega_sim.operator import load_parameters
from tega_study.difference import Direction, directions
from tega_study.plan import StudyPlan, read_plan
from tega_study.silico.assumptions import PARAMETERS, read_assumptions, read_parameters
from tega_study.silico.session import RUNNING, SessionJob
from tega_study.silico.simulate import Progress, jobs_of, made_study, run_sessions, unfinished
from tega_study.trials import study_trials

SENSITIVITY = "sensitivity"
"""Folder in the study's folder."""

VARIED = (
    "vest.threshold",
    "vest.weber",
    "vest.rt_ms",
    "vest.dual_ms",
    "vision.rt_ms",
    "vision.motion_c",
    "vision.gaze_grasp",
    "vision.deform_theta",
    "motor.aim_sd",
    "motor.slack_per_s",
    "emg.drive_share",
    "grip.harm_cost",
    "grip.effort_cost",
)
"""Parameters changed by default: what people feel and see, the muscles, the weighing."""

ARMS = ("half", "unrelated", "constant", "inverted")
"""Arms of :data:`tega_sim.conditions.CONDITIONS` that take the place of the first condition."""


class SensitivityRow(msgspec.Struct, frozen=True, kw_only=True):
    """One changed assumption, and the directions that a study finds under it.

    Attributes:
        what: ``base``, a parameter's ``section.name``, ``arm`` or ``reading``; ``setting`` is its value.
        end: Where a parameter's value lies.
    """

    what: str
    setting: str
    end: Literal["low", "high", ""]
    people: int
    trials: int
    directions: tuple[Direction, ...]


class _Change(NamedTuple):
    name: str
    everyone: dict[str, float]
    first: str = "haptic"
    preset: Literal["paper", "live"] = "live"


def run_sensitivity(
    folder: Path,
    *,
    operators: int = 4,
    trials: int = 2,
    varied: Sequence[str] = VARIED,
    jobs: int = 0,
    shard: tuple[int, int] = (1, 1),
    progress: Progress = lambda _subject, _done, _total: None,
) -> list[str]:
    """Run the small studies that are not finished; return the names of the changes left to other shards.

    ``folder`` has a study in silico, not changed itself; its seed, objects and parameter file are used.
    ``varied`` are parameters, ``section.name``; the arms and the printed readings come always, and first. The
    last three arguments are those of :func:`tega_study.silico.simulate.simulate`. Raises ``ConfigError`` if a
    parameter is not known, ``InvalidValueError`` if a change was begun before with other people or trials.
    """
    stated = read_assumptions(folder)
    if stated is None:
        raise RecordingError(f"{folder}: is no study in silico", "make one with tega-teleop study simulate")
    if stated.everyone or stated.preset != "live" or stated.settings:
        raise InvalidValueError(f"{folder}: is a changed study itself", "name the study it was changed from")
    settings = read_plan(folder).settings
    part, parts = shard
    todo: list[SessionJob] = []
    made: list[tuple[Path, StudyPlan]] = []
    for change in _changes(folder, varied):
        where = folder / SENSITIVITY / change.name
        plan, small = made_study(
            where,
            operators=operators,
            seed=settings.seed or 0,
            objects={name: stated.spec(name) for name in settings.objects},
            conditions=(change.first, "non-haptic"),
            trials=trials,
            parameters=folder / PARAMETERS,
            everyone=change.everyone,
            preset=change.preset,
            view=stated.view,
        )
        if len(made) % parts == part - 1:
            todo += jobs_of(where, plan, small, plan.participants, pictures=False)
        made.append((where, plan))
    run_sessions(todo, workers=jobs, progress=progress)
    left = []
    for where, plan in made:
        if unfinished(where, plan):
            left.append(where.name)
        else:
            shutil.rmtree(where / RUNNING, ignore_errors=True)
    return left


def read_sensitivity(folder: Path) -> tuple[SensitivityRow, ...]:
    """Work out the rows of the changes that are done; none where there are no changes."""
    rows = []
    for where in sorted((folder / SENSITIVITY).glob("*/study.toml")):
        small = where.parent
        stated = read_assumptions(small)
        if stated is None or unfinished(small, read_plan(small)):
            continue
        plan, trials = study_trials(small)
        first = plan.settings.conditions[0]
        subject, setting = "base", ""
        end: Literal["low", "high", ""] = ""
        if stated.everyone:
            ((subject, value),) = stated.everyone.items()
            section, _, name = subject.partition(".")
            p = read_parameters(small)[section][name]
            setting, end = f"{value:g} {p.unit}".strip(), "low" if value < p.value else "high"
        elif first != "haptic":
            subject, setting = "arm", first
        elif stated.preset != "live":
            subject, setting = "reading", stated.preset
        rows.append(
            SensitivityRow(
                what=subject,
                setting=setting,
                end=end,
                people=len(plan.participants),
                trials=len(trials),
                directions=directions(trials, (first, "non-haptic")),
            )
        )
    others = sorted({row.what for row in rows} - {"base", *VARIED, "arm", "reading"})
    order = ["base", *VARIED, *others, "arm", "reading"]
    return tuple(sorted(rows, key=lambda row: (order.index(row.what), row.end == "high", row.setting)))


def _changes(folder: Path, varied: Sequence[str]) -> list[_Change]:
    sections = load_parameters(folder / PARAMETERS).sections
    changes = [_Change("base", {}), *(_Change(f"arm-{arm}", {}, first=arm) for arm in ARMS)]
    changes.append(_Change("reading-paper", {}, preset="paper"))
    for key in varied:
        section, _, name = key.partition(".")
        p = sections.get(section, {}).get(name)
        if p is None:
            raise ConfigError(f"parameter {key!r} is not known", "write section.name, such as vest.weber")
        changes += [
            _Change(f"{key}-{end}", {key: value})
            for end, value in (("low", p.low), ("high", p.high))
            if value != p.value or p.sd
        ]
    return changes
