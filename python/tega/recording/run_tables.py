"""Write the output folder of a run from the bus: tables, calibration and summary; keep an earlier run's results."""

from __future__ import annotations

import contextlib
import itertools
import json
import logging
import os
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any, Final, Literal

import msgspec
import numpy as np

from tega.config.calibration import save_calibration
from tega.devices.hand.can_recorder import CanRecorder
from tega.devices.table_recorder import TableRecorderOptions
from tega.devices.vest.vest_recorder import VestRecorder
from tega.errors import ConfigError, RecordingError
from tega.haptics import vest as haptics
from tega.loop.inbox.inputs import Prepared
from tega.loop.pacing import LoopReport
from tega.loop.parts import Part, PartContext
from tega.loop.sinks import Sinks
from tega.loop.summary import SUMMARY_FORMAT
from tega.records import ArmTurn, Contact, Event, HandCommand, Intent, Record, VestFrame
from tega.records.bus import Backlog
from tega.records.display import Notice
from tega.records.table import columns, rows
from tega.runtime.files.csv_tables import CsvWriter
from tega.runtime.files.foreign_file import parse_json, read_words
from tega.runtime.files.whole_file import write_whole
from tega.runtime.threads import run_realtime

TABLES: Final[dict[type[Record], str]] = {
    Contact: "contacts.csv",
    Event: "events.csv",
    Intent: "levels.csv",
    ArmTurn: "arm.csv",
}
"""File of each record that has a table and no recording device."""

# A second of an arm's turns: a program that reads a table while the run lasts is not far behind.
_MOST_LINES = 64

OUTPUT_NAMES = (*TABLES.values(), "vest.csv", "can.csv", "summary.json", "calibration.toml", "picture.png")
NOT_ENDED = "not yet, or it was killed"

_LOG = logging.getLogger(__name__)
_NAME = "disk: tables are no longer written"


class _RunSummary(msgspec.Struct):
    """Marks a folder as an earlier run's, or as a demo's trials."""

    format: Literal["tega-run", "tega-demo"]


def prepare_folder(folder: Path, *, also: Sequence[Path] = ()) -> Path | None:
    """Make a folder ready for a run's outputs, and keep those of an earlier run in a folder below it.

    The folder may be new, empty, or hold an earlier run (recognised by its ``summary.json``). An earlier
    run's own files, and those of ``also``, are then moved to ``earlier-1``, ``earlier-2``, …, which is
    returned (``None`` without results); other files in the folder are unchanged. A ``summary.json`` that
    marks the run as unfinished is written at once: it stays if the run is killed, and the next run recognises
    the folder by it. ``ConfigError`` as of :func:`check_folder`.
    """
    check_folder(folder)
    folder.mkdir(parents=True, exist_ok=True)
    kept = _keep_earlier(folder, also)
    begun = {"format": SUMMARY_FORMAT, "version": 1, "ended": NOT_ENDED}
    write_whole(folder / "summary.json", json.dumps(begun, indent=2) + "\n")
    return kept


def check_folder(folder: Path) -> None:
    """Check that a folder can take a run's outputs, and change nothing.

    ``ConfigError`` where it is a file, or holds something that is not an earlier run.
    """
    if folder.exists() and not folder.is_dir():
        raise ConfigError(f"output folder {folder.name!r} is a file", "name a folder")
    if folder.is_dir() and any(folder.iterdir()) and not _holds_a_run(folder):
        raise ConfigError(
            f"output folder {folder.name!r} is not empty and holds no earlier run",
            "name a new or empty folder, or one whose summary.json was written by TEGA",
        )


def _keep_earlier(folder: Path, also: Sequence[Path]) -> Path | None:
    """Move the results of an earlier run into a folder of its own; a note of a begun run is no result."""
    ours = [folder / name for name in OUTPUT_NAMES if os.path.lexists(folder / name)]
    ours += also
    if not ours or (ours == [folder / "summary.json"] and NOT_ENDED in read_words(ours[0])):
        return None
    for number in itertools.count(1):
        kept = folder / f"earlier-{number}"
        with contextlib.suppress(FileExistsError):
            kept.mkdir()
            break
    for path in ours:
        path.rename(kept / path.name)  # a link is moved, not what it leads to
    return kept


def _holds_a_run(folder: Path) -> bool:
    try:
        parse_json(read_words(folder / "summary.json"), _RunSummary)
    except (OSError, UnicodeDecodeError, msgspec.DecodeError, RecordingError):
        return False
    return True


class RunTables(Part):
    """The output folder of a run; the settings of ``context`` name it.

    A run in real time may be steering a hand: a slow disk delays nothing, and a full one ends the tables but
    not the run. A run as fast as possible ends with the error.
    """

    def __init__(self, context: PartContext, folder: Path) -> None:
        self._context, self._folder = context, folder
        self._closes = context.stack.enter_context(ExitStack())
        self._prepared: Prepared | None = None

    def prepared(self, prepared: Prepared) -> Prepared:
        """Note the inputs of the run."""
        self._prepared = prepared
        return prepared

    def sinks(self, sinks: Sinks) -> Sinks:
        """Open the tables, when every device is open: a run that is refused leaves the folder as it was."""
        prepared, folder, stack = self._prepared, self._folder, self._closes
        config, bus = self._context.config, self._context.bus
        assert prepared is not None
        kept = prepare_folder(folder)
        if kept is not None:
            bus.publish(Notice(text=f"the earlier results in {folder} are kept in {kept}"))
        real = config.session.pace == "real"
        vest = VestRecorder(TableRecorderOptions(file=folder / "vest.csv"))
        hand = CanRecorder(TableRecorderOptions(file=folder / "can.csv"))
        vest.open()
        hand.open()
        # Columns of a list field with one number per part of a device.
        channels = prepared.muscles.maxima.channels if prepared.muscles else ()
        names: dict[type[Record], dict[str, Iterable[str]]] = {Intent: {"channels": channels}}
        tables = {
            kind: CsvWriter(folder / name, columns(kind, **names.get(kind, {})), most_lines=_MOST_LINES)
            for kind, name in TABLES.items()
            if kind is not ArmTurn or config.arm is not None
        }
        for close in (vest.close, hand.close, *(table.close for table in tables.values())):
            stack.callback(partial(_closed, close) if real else close)
        backlog = Backlog("tables", rank=run_realtime("beside")) if real else None
        if backlog is not None:
            stack.callback(backlog.close)

        def show(frame: VestFrame) -> None:
            layout: Any = frame.layout
            vest.write(frame.t_ns, haptics.MotorLevels(layout, np.array(frame.intensities, np.uint8)))

        def command(requested: HandCommand) -> None:
            frames: Any = requested.frames
            hand.write(requested.t_ns, frames)

        def add(table: CsvWriter, record: Record) -> None:
            table.write(*rows(record))

        fill: dict[type[Record], Callable[[Any], None]]
        fill = {kind: partial(add, table) for kind, table in tables.items()}
        for kind, function in (fill | {VestFrame: show, HandCommand: command}).items():
            bus.subscribe(kind, function, name=_NAME, vital=not real, backlog=backlog)
        save_calibration(prepared.calibration, folder / "calibration.toml")
        return sinks._replace(tables=(vest.info, hand.info))

    def ended(self, report: LoopReport, n_waits: int) -> None:  # noqa: ARG002
        """Complete the tables before the summary states so."""
        self._closes.close()

    def finish(self, summary: dict[str, Any]) -> None:
        """Write the summary as JSON, keys in their order, one newline at the end."""
        text = json.dumps(summary, indent=2, ensure_ascii=False).encode(errors="backslashreplace")
        write_whole(self._folder / "summary.json", text + b"\n")


def open_part(context: PartContext) -> RunTables | None:
    """Return the output folder's part; ``None`` where the settings name no folder."""
    folder = context.config.session.out_dir
    if folder is None:
        return None
    check_folder(folder)  # refused before any device is opened
    return RunTables(context, folder)


def _closed(close: Callable[[], None]) -> None:
    """Close a table; errors such as a full disk are logged, and end nothing."""
    try:
        close()
    except OSError as error:
        _LOG.warning("%s: %s", _NAME, error.strerror or error)
