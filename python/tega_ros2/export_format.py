"""Join ``recording export``: ``--format ros2``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from tega.recording.origin import new_session
from tega.ui.cli.export_format import ExportFormat
from tega_ros2.bag import export_bag


def _export(recordings: Sequence[Path], out: Path) -> list[Path]:
    """Write one bag for each recording."""
    new_session(out)
    return [export_bag(path, out / path.stem) for path in recordings]


FORMAT = ExportFormat(options=(), export=_export)
