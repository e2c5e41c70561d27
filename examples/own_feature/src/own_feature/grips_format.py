"""Join ``recording export``: ``--format grips``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click

from own_feature.recorded import grips
from tega.ui.cli.export_format import ExportFormat


def _export(recordings: Sequence[Path], out: Path, *, firm_only: bool) -> list[Path]:
    """Write one table for each recording."""
    out.mkdir(parents=True, exist_ok=True)
    made = []
    for recording in recordings:
        rows = [f"{t_s},{n}\n" for t_s, n, firm in grips(recording) if firm or not firm_only]
        made.append(out / f"{recording.stem}-grips.csv")
        made[-1].write_text("t_s,fingers\n" + "".join(rows))
    return made


FORMAT = ExportFormat(
    options=(click.Option(["--firm-only"], is_flag=True, help="Leave out grips that are not firm (grips)."),),
    export=_export,
)
