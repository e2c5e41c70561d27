"""Write an analysis as CSV files: every table of the report, and the numbers behind its figures."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence

import msgspec

from tega.runtime.files.csv_tables import cell_text
from tega_study.analyse import Analysis
from tega_study.coupling import TouchCourse, on_grid
from tega_study.difference import Direction

PAPER_LABELS = {
    "duration_s": "Completion Time",
    "slips": "Slippage",
    "deformations": "Deformation",
    "success": "Success Rate",
}


def table_1(analysis: Analysis) -> list[list[str]]:
    """Return Table I as the paper prints it: a row a condition and metric, a column an object; time in seconds."""
    rows = [["Condition", "Metric", *analysis.objects]]
    of = {(cell.object, cell.condition): cell for cell in analysis.cells}
    for condition in analysis.conditions:
        cells = [of[name, condition] for name in analysis.objects]
        for metric, label in PAPER_LABELS.items():
            if metric == "success":
                values = [f"{cell.successes}/{len(cell.trials)}" for cell in cells]
            else:
                values = ["–" if (v := getattr(cell, metric)) is None else f"{v:.1f}" for cell in cells]
            rows.append([condition, label, *values])
    return rows


def csv_files(analysis: Analysis, courses: Mapping[str, TouchCourse]) -> dict[str, str]:
    """Return every CSV file by name."""
    from tega_study.figures import figure_8_trials

    files = {} if analysis.blind else {"table1.csv": _csv_text(table_1(analysis))}
    for name, rows in (
        ("trials", analysis.trials),
        ("cells", analysis.cells),
        ("tests", analysis.tests),
        ("coupling_trials", analysis.couplings),
        ("coupling", analysis.arms),
        ("coupling_contrast", analysis.contrasts),
        ("pose_use", analysis.pose_use),
        ("planner", analysis.planner),
        ("agreement", analysis.agreements),
        ("ratings", analysis.ratings),
        ("probes", analysis.probes),
        ("outcomes", (*analysis.outcomes, *analysis.further)),
        ("directions", analysis.directions),
        ("fig3", analysis.fingers),
    ):
        if rows:
            files[f"{name}.csv"] = _records(rows)
    lines = [["trial", *TouchCourse._fields]]
    for ids in figure_8_trials(analysis, courses).values():
        for trial in ids:
            samples = zip(*on_grid(courses[trial]), strict=True)
            lines += [[trial, *(f"{value:.6g}" for value in sample)] for sample in samples]
    if len(lines) > 1:
        files["fig8.csv"] = _csv_text(lines)
    if analysis.sensitivity:
        names = Direction.__struct_fields__
        found = [
            [row.what, row.setting, row.end, *(getattr(one, name) for name in names)]
            for row in analysis.sensitivity
            for one in row.directions
        ]
        files["sensitivity.csv"] = _csv_text([["what", "setting", "end", *names], *found])
    files["provenance.csv"] = _csv_text(_provenance(analysis, files))
    return files


def _provenance(analysis: Analysis, files: Mapping[str, str]) -> list[list[object]]:
    """Return where the tables come from, and each table's SHA-256, so that a table alone can be traced back."""
    lines: list[list[object]] = [["what", "value"], ["source", analysis.source]]
    lines += [["simulated", analysis.simulated], ["plan_sha256", analysis.plan_sha256]]
    if (stated := analysis.assumptions) is not None:
        lines += [
            ["parameters_sha256", stated.parameters_sha256],
            ["parameters", "frozen before the first run" if stated.frozen else "changed"],
            *([f"everyone {name}", value] for name, value in stated.everyone.items()),
            ["rules", stated.rules],
            ["people_sha256", stated.people_sha256],
            ["preset", stated.preset],
            ["view", stated.view],
            ["code_sha256", stated.code_sha256],
            ["assumptions_sha256", stated.digest],
            ["version", stated.version],
        ]
    return lines + [[name, hashlib.sha256(text.encode()).hexdigest()] for name, text in files.items()]


def _records(rows: Sequence[msgspec.Struct]) -> str:
    names = rows[0].__struct_fields__
    return _csv_text([list(names), *([getattr(row, name) for name in names] for row in rows)])


def _cell(value: object) -> str:
    return cell_text(" ".join(map(cell_text, value)) if isinstance(value, tuple) else value)


def _csv_text(rows: Sequence[Sequence[object]]) -> str:
    return "".join(",".join(map(_cell, row)) + "\n" for row in rows)
