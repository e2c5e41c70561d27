"""Write the report: one HTML file that needs nothing else, tables as CSV, and the record behind both."""

from __future__ import annotations

import csv
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import msgspec
import numpy as np

from tega.errors import InvalidValueError, RecordingError
from tega.runtime.files.foreign_file import read_words
from tega.ui.view.figures import draw_map
from tega_study.analyse import Analysis, FigureMaterial, analyse_bench, analyse_study
from tega_study.figures import figure_7, figure_8, lag_figure, new_figure, pose_figure, svg
from tega_study.page import report_html
from tega_study.tables import csv_files
from tega_study.touch_picture import FingerPicture, FingerRow

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def figure_3(rows: Sequence[FingerRow], pictures: Mapping[str, FingerPicture]) -> Figure | None:
    """Draw Fig 3: untouched gel, frame, difference, the metric's map with the marks of CCI and EDA."""
    if not rows:
        return None
    figure = new_figure(7.0, 2.05 * len(rows) + 0.3)
    axes = figure.subplots(len(rows), 4, squeeze=False)
    for number, row in enumerate(rows):
        _row(axes[number], row, pictures[row.trial], titled=number == 0)
    return figure


def _row(axes: Sequence[Axes], row: FingerRow, picture: FingerPicture, *, titled: bool) -> None:
    frame, metrics, touch_map = picture.touch
    off = np.abs(frame.astype(np.int16) - picture.baseline).mean(axis=2)
    axes[0].imshow(picture.baseline[..., ::-1])
    axes[1].imshow(frame[..., ::-1])
    axes[2].imshow(off, cmap="gray", vmin=0, vmax=max(float(off.max()), 1.0))
    draw_map(axes[3], frame.shape, metrics, touch_map)
    for ax, title in zip(axes, ("untouched", "touched", "difference", "touch map"), strict=True):
        ax.set_xticks([])
        ax.set_yticks([])
        if titled:
            ax.set_title(title, fontsize=9)
    axes[0].set_ylabel(f"{row.object}, {row.finger}", fontsize=9)
    axes[2].set_xlabel(f"up to {off.max():.0f} of 255", fontsize=9)
    cci, eda = ("–" if one is None else f"{one:.2f}" for one in (row.cci_norm, row.eda_norm))
    axes[3].set_xlabel(f"CCI {cci}   EDA {eda}", fontsize=9)


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
