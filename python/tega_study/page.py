"""Render the report as one HTML page, and a study's forms, by the Jinja2 templates beside this file."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from tega.errors import InvalidValueError
from tega.runtime.files.whole_file import write_whole
from tega.runtime.lifecycle import require
from tega_study.analyse import Analysis
from tega_study.compare import SMALLEST_FOR_P, Test
from tega_study.difference import (
    PAPER_LABELS,
    PAPER_OBJECTS,
    PAPER_SETUP,
    PAPER_TABLE_1,
    Direction,
    OutcomeDifference,
)
from tega_study.figures import p_text
from tega_study.lead.questions import QUESTIONS
from tega_study.plan import read_plan
from tega_study.power import MOST_PEOPLE, too_few
from tega_study.silico.sensitivity import SensitivityRow

if TYPE_CHECKING:
    from jinja2 import Environment


_SHORT = {"duration_s": "time", "slips": "slips", "deformations": "deformed", "success": "success"}
_MARKS = {"as printed": "yes told", "opposite": "no told", "not distinguished": "", "no data": ""}
_SMALLEST = 0.005
"""Differences that round to 0.00 are called none."""

_FEWEST = 3
"""People from which an interval over them is given: two leave one degree of freedom, and an interval of any width."""

_UNITS = {
    "duration_s": ", s",
    "slips": " per trial",
    "deformations": " per trial",
    "success": ", points of 100",
}


def report_html(analysis: Analysis, figures: Mapping[str, str]) -> str:
    """Return the page; ``MissingExtraError`` without Jinja2."""
    sizes = sorted({(row.people, row.trials) for row in analysis.sensitivity})
    n_people = max((cell.people for cell in analysis.cells), default=0)
    of = {(test.metric, test.object, test.level): test for test in reversed(analysis.tests)}
    family = [(metric, thing) for metric, _, thing in (test.partition(":") for test in analysis.family)]
    paper_values = {
        (condition, metric, name): text
        for condition, metrics in PAPER_TABLE_1.items()
        for metric, texts in metrics.items()
        for name, text in zip(PAPER_OBJECTS, texts, strict=True)
        if condition in analysis.conditions and name in analysis.objects
    }
    page = report_templates().get_template("report.html")
    return page.render(
        analysis=analysis,
        figures=figures,
        labels=PAPER_LABELS,
        short=_SHORT,
        marks=_MARKS,
        smallest=_SMALLEST,
        units=_UNITS,
        paper_objects=PAPER_OBJECTS,
        paper_setup=PAPER_SETUP,
        paper_values=paper_values,
        most_people=n_people,
        least_for_p=SMALLEST_FOR_P,
        most_planned=MOST_PEOPLE,
        hopeless=too_few(analysis.family, people=n_people, alpha=analysis.alpha),
        fewest=_FEWEST,
        cells={(cell.object, cell.condition): cell for cell in analysis.cells},
        trials={trial.id: trial for trial in analysis.trials},
        family=[(*one, of.get((*one, "as printed")), of.get((*one, "people"))) for one in family],
        counted_by=[
            f"{who} in {n} {'trial' if n == 1 else 'trials'}" for who, n in analysis.counted_by.items()
        ],
        sizes="; ".join(f"{people} people, {trials} trials" for people, trials in sizes),
        ranges=_ranges(analysis.sensitivity),
        questions={q.item: f"{q.title}: 0 {q.left}, 100 {q.right}" for q in QUESTIONS},
    )


def report_templates() -> Environment:
    """Return the environment of the templates beside this file; ``MissingExtraError`` without Jinja2."""
    jinja2: Any = require("jinja2", driver="study report", extra="study")
    made: Environment = jinja2.Environment(
        loader=jinja2.PackageLoader("tega_study"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters |= {
        "amounts": lambda one: f"{_amount(one, one.first)} / {_amount(one, one.second)}",
        "as_printed": _as_printed,
        "base64": lambda drawing: base64.b64encode(drawing.encode()).decode(),
        "difference": lambda one: (
            _outcome(one)
            + "\N{NO-BREAK SPACE}points" * (one.metric == "success" and one.difference is not None)
        ),
        "effect": _effect,
        "interval": interval,
        "number": number,
        "outcome": _outcome,
        "p": lambda p: (
            "–" if p is None else p_text(p)[2:].removeprefix("= ").replace(" ", "\N{NO-BREAK SPACE}")
        ),
        "people": people,
        "ranges": _events,
        "sd_of": lambda cell, metric: getattr(
            cell, f"{metric.removesuffix('_s')}_sd{'_s' * metric.endswith('_s')}"
        ),
        "share": lambda value: "–" if value is None else f"{100 * value:.0f}\N{NO-BREAK SPACE}%",
        "value_of": lambda cell, metric: (
            f"{cell.successes}/{len(cell.trials)}"
            if metric == "success"
            else number(getattr(cell, metric), 1)
        ),
    }
    return made


def number(value: float | None, digits: int = 2) -> str:
    """Return a number with so many decimals, and without a sign where they are all 0."""
    return "–" if value is None else f"{value:z.{digits}f}".replace("-", "−")


def interval(value: float | None, low: float | None, high: float | None) -> str:
    """Return an effect with its interval."""
    if value is None or low is None:
        return number(value)
    return f"{number(value)} ({number(low)} to {'∞' if high is None else number(high)})"


def _effect(test: Test) -> str:
    few = test.level in {"people", "adjusted"} and test.people < _FEWEST and test.effect is not None
    none = few or (test.low is None and "not estimable" in test.note)
    return f"{number(test.effect)} (not estimable)" if none else interval(test.effect, test.low, test.high)


def people(n: int, analysis: Analysis) -> str:
    """Return the noun for the study's people, one or many."""
    return ("simulated " if analysis.simulated else "") + ("person" if n == 1 else "people")


def _outcome(one: OutcomeDifference) -> str:
    """Return a difference with its interval, as the opening sentences have it."""
    if one.difference is None:
        return "–"
    scale, digits = (100.0, 0) if one.metric == "success" else (1.0, 2)
    if one.low is None or one.high is None or one.people < _FEWEST:
        return f"{number(scale * one.difference, digits)} (interval not estimable)"
    value, low, high = (number(scale * end, digits) for end in (one.difference, one.low, one.high))
    return f"{value} ({low} to {high})"


def _amount(one: Direction, value: float | None) -> str:
    if value is None:
        return "–"
    return f"{100 * value:.0f}\N{NO-BREAK SPACE}%" if one.metric == "success" else number(value)


def _ranges(rows: Sequence[SensitivityRow]) -> list[list[str]]:
    """Return for each direction how often it has the paper's sign, and which parameters reverse it."""
    found = []
    people = [row for row in rows if row.what not in {"arm", "reading"}]
    for place, requested in enumerate(rows[0].directions if rows else ()):
        signs = [_as_printed(row.directions[place]) for row in people]
        reported = [row.directions[place].verdict for row in people]
        base = next((_as_printed(row.directions[place]) for row in people if row.what == "base"), None)
        turned = []
        for subject, some in groupby((row for row in people if row.what != "base"), key=lambda row: row.what):
            ends = [row for row in some if _as_printed(row.directions[place]) != base]
            if ends and base is not None:
                turned.append(f"{subject} (at {' and '.join(str(row.setting) for row in ends)})")
        found.append(
            [
                f"{PAPER_LABELS[requested.metric]}, {requested.object}",
                f"{sum(signs)} of {len(signs)}",
                str(reported.count("as printed")),
                str(reported.count("opposite")),
                ", ".join(turned) or ("–" if base is None else "none"),
            ]
        )
    return found


def _as_printed(one: Direction) -> bool:
    off = one.difference or 0.0
    return abs(off) >= _SMALLEST and (off > 0) == (one.paper_sign > 0)


def _events(events: Sequence[str]) -> str:
    """Shorten ``file:3 file:4 file:5`` to ``file:3–5``."""
    runs: list[tuple[str, int, int]] = []
    for event in events:
        path, _, number = event.rpartition(":")
        n = int(number)
        if runs and runs[-1][0] == path and runs[-1][2] == n - 1:
            runs[-1] = (path, runs[-1][1], n)
        else:
            runs.append((path, n, n))
    return ", ".join(f"{path}:{i}" + (f"–{j}" if j > i else "") for path, i, j in runs)


FORMS: Final = ("consent.md", "data-protection.md")


def write_forms(folder: Path, out: Path) -> list[Path]:
    """Write the forms. Values missing from the plan are left in brackets, for the lab to complete.

    None of them may be in ``out`` already: it may have been completed (``InvalidValueError``).
    """
    plan = read_plan(folder)
    settings, first = plan.settings, plan.of(plan.participants[0])
    rests_s = sum(trial.rest_s for trial in first)
    known = {
        "objects": settings.objects,
        "conditions": settings.conditions,
        "participants": settings.participants,
        "trials": len(first),
        "window_s": settings.window_s,
        "rests_min": round(rests_s / 60),
        "total_min": round((rests_s + len(first) * settings.window_s) / 60),
        "probe": settings.probe,
    }
    paths = [out / name for name in FORMS]
    for path in paths:
        if path.exists() or path.is_symlink():
            raise InvalidValueError(f"{path}: is there already", "name another folder with --out")
    made = report_templates().overlay(autoescape=False)
    for path in paths:
        write_whole(path, made.get_template(path.name).render(known) + "\n")
    return paths
