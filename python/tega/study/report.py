"""The report: one HTML file that needs nothing else, the tables as CSV, and the record that both are made from."""

from __future__ import annotations

import html
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import msgspec

from tega.errors import InvalidValueError
from tega.study.analyse import Analysis, analyse_bench, analyse_study
from tega.study.coupling import TouchCourse
from tega.study.figures import figure_7, figure_8, lag_figure, p_text, pose_figure, svg
from tega.study.paper import PAPER_OBJECTS, PAPER_TABLE_1
from tega.study.report_text import ALONE, METHODS, STYLE
from tega.study.tables import PAPER_LABELS, table_1, write_csv

__all__ = ["Report", "figures_of", "report_html", "write_report"]


class Report(NamedTuple):
    """Where a report went.

    Attributes:
        page: The HTML file.
        tables: The folder of CSV files, figures and ``analysis.json``.
        analysis: What is in it.
    """

    page: Path
    tables: Path
    analysis: Analysis


def write_report(source: Path, out: Path | None = None, *, interim: bool = False) -> Report:
    """Analyse a study's folder, or a file of the bench's results, and write the report.

    Args:
        source: The folder, or the file.
        out: Folder for ``report.html`` and ``report/``; the study's own where ``None``, for a file the one it is in.
        interim: Show p-values before the plan is done.

    Raises:
        RecordingError: The source is damaged or has too little.
        InvalidValueError: There is a folder ``report`` already that is no report.
        MissingExtraError: A package of the extra ``study`` is not installed.
    """
    courses: Mapping[str, TouchCourse] = {}
    if source.is_dir():
        analysis, courses = analyse_study(source, interim=interim)
    else:
        analysis = analyse_bench([source])
    folder = out or (source if source.is_dir() else source.parent)
    folder.mkdir(parents=True, exist_ok=True)
    tables = folder / "report"
    if tables.exists() and not (tables / "analysis.json").is_file():
        raise InvalidValueError(f"{tables}: is there, and is no report", "name another folder with --out")
    beside = Path(tempfile.mkdtemp(prefix=".report-", dir=folder))
    try:
        figures = figures_of(analysis, courses)
        (beside / "analysis.json").write_bytes(
            msgspec.json.format(msgspec.json.encode(analysis), indent=1) + b"\n"
        )
        write_csv(analysis, courses, beside)
        for name, drawing in figures.items():
            (beside / f"{name}.svg").write_text(drawing, encoding="utf-8", newline="\n")
        page = beside / "report.html"
        page.write_text(report_html(analysis, figures), encoding="utf-8", newline="\n")
        beside.chmod(folder.stat().st_mode & 0o777)
        if tables.exists():
            shutil.rmtree(tables)
        beside.rename(tables)
        (tables / "report.html").replace(folder / "report.html")
    except BaseException:
        shutil.rmtree(beside, ignore_errors=True)
        raise
    return Report(folder / "report.html", tables, analysis)


def figures_of(analysis: Analysis, courses: Mapping[str, TouchCourse]) -> dict[str, str]:
    """Draw every figure that there are data for; SVG by name."""
    drawn = {
        "fig7": figure_7(analysis),
        "fig8": figure_8(analysis, courses),
        "lags": lag_figure(analysis),
        "poses": pose_figure(analysis),
    }
    return {name: svg(figure) for name, figure in drawn.items() if figure is not None}


def report_html(analysis: Analysis, figures: Mapping[str, str]) -> str:
    """Return the page."""
    a, b = analysis.conditions[:2]
    kind = "Simulated study" if analysis.simulated else "Study"
    parts = [
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{kind}: {_e(a)} against {_e(b)}</title>',
        f'<meta name="viewport" content="width=device-width"><style>{STYLE}</style></head><body>',
        f"<h1>{kind}: {_e(a)} against {_e(b)}</h1>",
    ]
    if analysis.simulated:
        parts.append(
            '<p class="banner">Everything here is simulated: made-up people, hand, objects and touch. It says what '
            "follows from the model's assumptions, and nothing about people.</p>"
        )
    if analysis.interim:
        shown = (
            "They are shown because somebody asked."
            if analysis.p_shown
            else "p-values are withheld until it is."
        )
        parts.append(
            '<p class="banner">Interim: the plan is not done yet. Looking at p-values before, and stopping where one '
            f"is small, makes them worthless. {shown}</p>"
        )
    parts += [_flow(analysis), _table_1(analysis), _family(analysis, figures), _touch(analysis, figures)]
    parts += [_planner(analysis), METHODS, _details(analysis), "</body></html>\n"]
    return "\n".join(parts)


def _flow(analysis: Analysis) -> str:
    flow = analysis.flow
    planned = "" if flow.planned_people is None else f" of {flow.planned_people} planned"
    gone = f", {flow.withdrawn} withdrew" if flow.withdrawn else ""
    ended = ", ".join(f"{n} {_e(status.replace('_', ' '))}" for status, n in flow.status.items())
    signed = f" Plan <code>{analysis.plan_sha256[:16]}</code>." if analysis.plan_sha256 else ""
    return (
        f"<p>{flow.people} {_people(flow.people, analysis)}{planned}{gone}; {flow.complete} complete. "
        f"Trials: {ended}. "
        f"A trial that was failed is data; one that was broken off is not.{signed}</p>"
    )


def _people(n: int, analysis: Analysis) -> str:
    return ("simulated " if analysis.simulated else "") + ("person" if n == 1 else "people")


def _table_1(analysis: Analysis) -> str:
    rows = table_1(analysis)
    of = {(cell.object, cell.condition): cell for cell in analysis.cells}
    beside = analysis.simulated and analysis.objects == PAPER_OBJECTS
    head = [*rows[0], *([f"paper: {name}" for name in PAPER_OBJECTS] if beside else [])]
    body = []
    for row, (condition, metric) in zip(
        rows[1:], ((c, m) for c in analysis.conditions for m in PAPER_LABELS), strict=True
    ):
        cells = []
        for name, text in zip(analysis.objects, row[2:], strict=True):
            cell = of[name, condition]
            link = f'<a href="#{_anchor(name, condition)}">{_e(text)}</a>'
            if metric == "success":
                extra = f"{100 * cell.success_low:.0f}–{100 * cell.success_high:.0f} %"
            else:
                sd = getattr(cell, {"duration_s": "duration_sd_s"}.get(metric, f"{metric}_sd"))
                extra = "" if sd is None else f"SD {sd:.2g}"
            cells.append(f'{link} <span class="small">{extra}</span>')
        printed = PAPER_TABLE_1.get(condition, {}).get(metric, ("–",) * len(PAPER_OBJECTS)) if beside else ()
        body.append([_e(row[0]), _e(row[1]) + (", s" if metric == "duration_s" else ""), *cells, *printed])
    note = (
        "Means over trials. Success: trials that were lifted to the height, held, and not dropped, of "
        "all, with the exact "
        "95 % interval. Slips after lift-off. Each number leads to its trials, and they to their events."
    )
    if beside:
        note += (
            "  The paper's columns stand as printed; its times have no unit, and fit the 15 s window only as "
            "sums of ten trials."
        )
    return "<h2>Table I</h2>" + _table(head, body, note)


def _family(analysis: Analysis, figures: Mapping[str, str]) -> str:
    body = []
    for test in analysis.family:
        metric, _, name = test.partition(":")
        mine = [t for t in analysis.tests if (t.metric, t.object) == (metric, name)]
        printed = next((t for t in mine if t.level == "as printed"), None)
        people = next((t for t in mine if t.level == "people"), None)
        row = [_e(PAPER_LABELS[metric]), _e(name)]
        if printed is None:
            row += ["–"] * 4
        else:
            how = "exact" if ", exact" in printed.test else "approx."
            row += [
                _span(printed.effect, printed.low, printed.high),
                f"{_p(printed.p)} <span class='small'>{how}</span>",
                _p(printed.p_exact),
                _p(printed.p_holm),
            ]
        row += ["–"] * 3 if people is None else [
            _span(people.effect, people.low, people.high),
            _p(people.p),
            _p(people.p_holm),
        ]  # fmt: skip
        body.append(row)
    head = ["metric", "object", "rank-biserial", "Mann-Whitney p", "exact p with ties", "Holm"]
    head += ["ratio of means", "p over people", "Holm"]
    note = (
        "First three p: trials taken as independent, as the paper does; says nothing about other people. "
        "Last columns: "
        f"people as the unit; no p below six people. Holm over the {len(analysis.family)} tests of the "
        "plan, within each kind. "
        f"Rank-biserial above 0 and ratios above 1: more with {_e(analysis.conditions[0])}. Brackets: 95 % intervals."
    )
    caption = (
        f"Fig 7. {_cells_text(analysis)} Dots: trials; violins: their spread; diamonds: means; "
        "p: Mann-Whitney over trials, uncorrected, as in the paper."
    )
    return "<h2>Tests</h2>" + _table(head, body, note) + _figure(figures, "fig7", caption)


def _cells_text(analysis: Analysis) -> str:
    n = [len(cell.trials) for cell in analysis.cells]
    people = [cell.people for cell in analysis.cells]
    trials = f"{min(n)} to {max(n)}" if min(n) != max(n) else f"{n[0]}"
    return f"{trials} trials in each violin, of {max(people)} {_people(max(people), analysis)}."


def _touch(analysis: Analysis, figures: Mapping[str, str]) -> str:
    if not analysis.arms:
        return "<h2>Touch and pose</h2><p>No courses of touch and pose were kept with these trials.</p>"
    head = [
        "condition",
        "signal",
        "trials",
        "people",
        "r",
        "lowest",
        "r > 0",
        "r, all samples",
        "other trials' touch",
    ]
    head += ["peak lag, s", "answer, levels per unit"]
    body = [
        [
            _e(arm.condition),
            arm.signal.upper(),
            str(arm.trials),
            str(arm.people),
            _f(arm.r),
            _f(arm.lowest),
            f"{100 * arm.positive:.0f} %",
            _f(arm.r_pooled),
            _f(arm.r_others),
            _f(arm.peak_lag_s, 1),
            _f(arm.slope),
        ]
        for arm in analysis.arms
    ]
    text = "<h2>Touch and pose</h2>" + _table(head, body, ALONE)
    if analysis.contrasts:
        rows = [
            [
                c.signal.upper(),
                {"r": "r (Fisher z)", "slope": "answer"}[c.what],
                str(c.people),
                _f(c.difference),
                _p(c.p),
            ]
            for c in analysis.contrasts
        ]
        a, b = analysis.conditions[:2]
        note = f"{_e(a)} less {_e(b)}, person by person; sign-flip p, exploratory, uncorrected."
        text += _table(["signal", "what", "people", "difference", "p"], rows, note)
    text += _figure(
        figures, "lags", "Correlation over the lag; the cross is what other trials' touch gives at lag 0."
    )
    who = analysis.conditions[0]
    fig8 = f"Fig 8. First person with courses, first three {who} trials of each object, in the plan's order."
    text += _figure(figures, "fig8", fig8)
    head = [
        "object",
        "condition",
        "trials",
        *[f"pose {p}" for p in range(5)],
        "1 to 3",
        "changes",
        "of them 1 to 3",
    ]
    uses = [
        [
            _e(u.object),
            _e(u.condition),
            str(u.trials),
            *(f"{100 * share:.0f} %" for share in (*u.dwell, u.intermediate)),
            f"{u.transitions:.1f}",
            f"{u.transitions_intermediate:.1f}",
        ]
        for u in analysis.pose_use
    ]
    note = (
        "Share of time at each pose and changes per trial, means over trials. Use of poses 1 to 3 shows "
        "graded control."
    )
    return text + _figure(figures, "poses", "Share of time at each pose.") + _table(head, uses, note)


def _planner(analysis: Analysis) -> str:
    if not analysis.planner:
        return ""
    body = [
        [
            _e(PAPER_LABELS[row.metric]),
            _e(row.object),
            f"{row.reference:.2g} → {row.mean:.2g}",
            row.spread,
            "more than 30" if row.people is None else str(row.people),
            f"{100 * row.power_at_12:.0f} % ± {100 * row.error:.0f}",
        ]
        for row in analysis.planner
    ]
    head = ["metric", "object", "effect", "people differ", "people for 80 %", "power of 12"]
    note = (
        "If the effects were as large as seen here, uncorrected at 0.05, paired t on log sums. Effects "
        "seen in a small study are "
        "too large on average: plan for less. Other effects: <code>tega-teleop study power</code>."
    )
    return "<h2>The next study</h2>" + _table(head, body, note)


def _details(analysis: Analysis) -> str:
    tests = [
        [
            _e(PAPER_LABELS[t.metric]),
            _e(t.object),
            t.level,
            _e(t.test),
            f"{t.n[0]}, {t.n[1]}",
            str(t.people),
            _f(t.statistic),
            _p(t.p),
            _p(t.p_holm),
            _e(t.effect_name),
            _span(t.effect, t.low, t.high),
            _e(t.note),
        ]
        for t in analysis.tests
    ]
    head = [
        "metric",
        "object",
        "level",
        "test",
        "trials",
        "people",
        "statistic",
        "p",
        "Holm",
        "effect",
        "",
        "note",
    ]
    out = [
        "<h2>Everything</h2>",
        _fold("All tests", _table(head, tests, "Tests outside the family are exploratory.")),
    ]
    if analysis.couplings:
        rows = [
            [
                *(
                    _e(c.trial),
                    _e(c.object),
                    _e(c.condition),
                    c.signal.upper(),
                    str(c.samples),
                    _f(c.n_eff, 1),
                ),
                *(_span(c.r, c.low, c.high), _f(c.r_others), _p(c.p_others), _f(c.slope)),
            ]
            for c in analysis.couplings
        ]
        head = ["trial", "object", "condition", "signal", "samples", "worth", "r", "others", "p", "answer"]
        note = (
            "Worth: independent samples; the interval goes by it. p: share of pairings with other trials "
            "that reach r."
        )
        out.append(_fold("Correlation of each trial", _table(head, rows, note)))
    sections = []
    of = {trial.id: trial for trial in analysis.trials}
    for cell in analysis.cells:
        rows = []
        for trial in (of[one] for one in cell.trials):
            duration = "–" if trial.duration_s is None else f"{trial.duration_s:.3f}"
            counts = [
                str(trial.slips),
                str(trial.deformations),
                str(trial.drops),
                "yes" if trial.success else "no",
            ]
            rows.append(
                [_e(trial.id), duration, *counts, f'<span class="small">{_e(_ranges(trial.events))}</span>']
            )
        head = ["trial", "time, s", "slips", "deformations", "drops", "success", "events"]
        title = f"{cell.object}, {cell.condition}"
        anchor = _anchor(cell.object, cell.condition)
        sections.append(f'<h3 id="{anchor}">{_e(title)}</h3>' + _table(head, rows, ""))
    return "".join(out) + "<h2>Trials</h2>" + "".join(sections)


def _ranges(events: Sequence[str]) -> str:
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


def _table(head: Sequence[str], rows: Sequence[Sequence[str]], note: str) -> str:
    top = "".join(f'<th scope="col">{_e(cell)}</th>' for cell in head)
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>\n" for row in rows)
    caption = f"<caption>{note}</caption>" if note else ""
    return f'<div class="wide"><table>{caption}<thead><tr>{top}</tr></thead><tbody>\n{body}</tbody></table></div>'


def _figure(figures: Mapping[str, str], name: str, caption: str) -> str:
    if name not in figures:
        return ""
    import base64

    # As a picture of its own: ids of several drawings in one page would be mixed up.
    data = base64.b64encode(figures[name].encode()).decode()
    text = _e(caption)
    return f'<figure><img src="data:image/svg+xml;base64,{data}" alt="{text}"><figcaption>{text}</figcaption></figure>'


def _fold(title: str, content: str) -> str:
    return f"<details><summary>{title}</summary>{content}</details>"


def _anchor(name: str, condition: str) -> str:
    return f"cell-{_e(name)}-{_e(condition)}"


def _e(text: str) -> str:
    return html.escape(text)


def _f(value: float | None, digits: int = 2) -> str:
    return "–" if value is None else f"{value:.{digits}f}".replace("-", "−")


def _p(p: float | None) -> str:
    return "–" if p is None else p_text(p).removeprefix("p = ").removeprefix("p ").replace("<", "&lt;")


def _span(value: float | None, low: float | None, high: float | None) -> str:
    if value is None:
        return "–"
    return _f(value) + ("" if low is None else f" ({_f(low)} to {'∞' if high is None else _f(high)})")
