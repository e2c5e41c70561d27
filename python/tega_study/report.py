"""Write the report: one HTML file that needs nothing else, each table as CSV, and the record behind both."""

from __future__ import annotations

import csv
import hashlib
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import msgspec
import numpy as np

from tega.errors import InvalidValueError, RecordingError
from tega.runtime.files.csv_tables import cell_text
from tega.runtime.files.foreign_file import read_words
from tega.ui.view.figures import draw_map
from tega_study.analyse import Analysis, FigureMaterial, analyse_bench, analyse_study
from tega_study.coupling import TouchCourse, on_grid
from tega_study.difference import PAPER_LABELS, Direction
from tega_study.figures import figure_7, figure_8, figure_8_trials, lag_figure, new_figure, pose_figure, svg
from tega_study.page import report_html
from tega_study.touch_picture import FingerPicture, FingerRow

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def figure_3(rows: Sequence[FingerRow], pictures: Mapping[str, FingerPicture]) -> Figure | None:
    """Draw Fig 3: untouched gel, frame, difference, the metric's map with the marks of CCI and EDA."""
    if not rows:
        return None
    figure = new_figure(7.0, 2.05 * len(rows) + 0.3)
    axes = figure.subplots(len(rows), 4, squeeze=False)
    for row, (untouched, touched, difference, drawn) in zip(rows, axes, strict=True):
        baseline, (frame, metrics, touch_map) = pictures[row.trial].baseline, pictures[row.trial].touch
        off = np.abs(frame.astype(np.int16) - baseline).mean(axis=2)
        untouched.imshow(baseline[..., ::-1])
        touched.imshow(frame[..., ::-1])
        difference.imshow(off, cmap="gray", vmin=0, vmax=max(float(off.max()), 1.0))
        draw_map(drawn, frame.shape, metrics, touch_map)
        untouched.set_ylabel(f"{row.object}, {row.finger}", fontsize=9)
        difference.set_xlabel(f"up to {off.max():.0f} of 255", fontsize=9)
        cci, eda = ("–" if one is None else f"{one:.2f}" for one in (row.cci_norm, row.eda_norm))
        drawn.set_xlabel(f"CCI {cci}   EDA {eda}", fontsize=9)
    for ax in axes.flat:
        ax.set_xticks([])
        ax.set_yticks([])
    for ax, title in zip(axes[0], ("untouched", "touched", "difference", "touch map"), strict=True):
        ax.set_title(title, fontsize=9)
    return figure


FIGURES = ("fig3", "fig7", "fig8", "lags", "poses")


class Report(NamedTuple):
    """A written report; ``tables`` is the folder of CSV files, figures and ``analysis.json``."""

    page: Path
    tables: Path
    analysis: Analysis


def write_report(source: Path, out: Path | None = None, *, unblind: bool = False) -> Report:
    """Analyse a study's folder, or a file of the bench's results, and write the report.

    ``out`` is the folder for ``report.html`` and ``report/``, ``None`` for the study's own or that of the file.
    A folder ``report`` that is no report is an ``InvalidValueError``. ``unblind`` compares conditions before
    the plan is complete; this is written into the study's journal.
    """
    material = FigureMaterial()
    if source.is_dir():
        analysis, material = analyse_study(source, unblind=unblind)
    else:
        analysis = analyse_bench([source])
    folder = out or (source if source.is_dir() else source.parent)
    folder.mkdir(parents=True, exist_ok=True)
    tables = folder / "report"
    is_report = all((tables / name).is_file() for name in ("analysis.json", "provenance.csv"))
    if tables.is_symlink() or (tables.exists() and not is_report):
        raise InvalidValueError(f"{tables}: is there, and is no report", "name another folder with --out")
    beside = Path(tempfile.mkdtemp(prefix=".report-", dir=folder))
    try:
        figures = figures_of(analysis, material)
        files = {
            "analysis.json": msgspec.json.format(msgspec.json.encode(analysis), indent=1).decode() + "\n",
            **csv_files(analysis, material.courses),
            **{f"{name}.svg": drawing for name, drawing in figures.items()},
            "report.html": report_html(analysis, figures),
        }
        for name, text in files.items():
            (beside / name).write_text(text, encoding="utf-8", newline="\n")
        beside.chmod(folder.stat().st_mode & 0o777)
        if tables.exists():
            _keep_others(tables, beside)
            shutil.rmtree(tables)
        beside.rename(tables)
        (tables / "report.html").replace(folder / "report.html")
    except BaseException:
        shutil.rmtree(beside, ignore_errors=True)
        raise
    return Report(folder / "report.html", tables, analysis)


def _keep_others(old: Path, new: Path) -> None:
    """Move what an earlier report did not write into the folder that takes its place."""
    try:
        written = {row[0] for row in csv.reader(read_words(old / "provenance.csv").splitlines()) if row}
    except (ValueError, csv.Error) as error:
        raise RecordingError(
            f"{old / 'provenance.csv'}: is damaged: {error}",
            "move that report, or name another folder with --out",
        ) from error
    written |= {"provenance.csv", "analysis.json", *(f"{name}.svg" for name in FIGURES)}
    for path in sorted(old.iterdir()):
        if path.name not in written and not (new / path.name).exists():
            path.rename(new / path.name)


def figures_of(analysis: Analysis, material: FigureMaterial) -> dict[str, str]:
    """Draw every figure that there are data for; SVG by name."""
    if analysis.blind:
        return {}
    drawn = {
        "fig3": figure_3(analysis.fingers, material.pictures),
        "fig7": figure_7(analysis),
        "fig8": figure_8(analysis, material.courses),
        "lags": lag_figure(analysis),
        "poses": pose_figure(analysis),
    }
    return {name: svg(figure) for name, figure in drawn.items() if figure is not None}


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
