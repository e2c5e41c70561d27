"""Write the output folder of a run from the bus: tables, calibration and summary."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tega.config.calibration import save_calibration
from tega.devices.hand.can_recorder import CanRecorder
from tega.devices.table_recorder import TableRecorderOptions
from tega.devices.vest.vest_recorder import VestRecorder
from tega.haptics import vest as haptics
from tega.loop.parts import Part, PartContext
from tega.recording.folder import check_folder, prepare_folder
from tega.recording.tables import RecordTable
from tega.records import ArmTurn, Contact, Event, HandCommand, Intent, Record, VestFrame
from tega.records.bus import Backlog
from tega.records.display import Notice
from tega.runtime.files.whole_file import write_whole
from tega.runtime.threads import run_realtime

if TYPE_CHECKING:
    from tega.config import SessionConfig
    from tega.devices.base import DeviceInfo
    from tega.loop.inbox.inputs import Prepared
    from tega.loop.pacing import LoopReport
    from tega.loop.sinks import Sinks
    from tega.records.bus import Bus


_LOG = logging.getLogger(__name__)
_NAME = "disk: tables are no longer written"


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
        assert self._prepared is not None
        kept = prepare_folder(self._folder)
        if kept is not None:
            message = f"the earlier results in {self._folder} are kept in {kept}"
            self._context.bus.publish(Notice(text=message))
        tables = _open_tables(
            self._closes, self._context.config, self._prepared, self._context.bus, self._folder
        )
        return sinks._replace(tables=tables)

    def ended(self, report: LoopReport, n_waits: int) -> None:  # noqa: ARG002
        """Complete the tables before the summary states so."""
        self._closes.close()

    def finish(self, summary: dict[str, Any]) -> None:
        """Write the summary as JSON, keys in their order, one newline at the end."""
        text = json.dumps(summary, indent=2, ensure_ascii=False)
        write_whole(self._folder / "summary.json", f"{text}\n")


def open_part(context: PartContext) -> RunTables | None:
    """Return the output folder's part; ``None`` where the settings name no folder."""
    folder = context.config.session.out_dir
    if folder is None:
        return None
    check_folder(folder)  # refused before any device is opened
    return RunTables(context, folder)


def _open_tables(
    stack: ExitStack, config: SessionConfig, prepared: Prepared, bus: Bus, folder: Path
) -> tuple[DeviceInfo, ...]:
    """Open the tables, have the bus fill them, and return the names of the tables of vest and hand."""
    real = config.session.pace == "real"
    vest = VestRecorder(TableRecorderOptions(file=folder / "vest.csv"))
    hand = CanRecorder(TableRecorderOptions(file=folder / "can.csv"))
    vest.open()
    hand.open()
    tables: dict[type[Record], RecordTable] = {
        Contact: RecordTable(folder, Contact),
        Event: RecordTable(folder, Event),
        Intent: RecordTable(
            folder, Intent, channels=prepared.muscles.maxima.channels if prepared.muscles else ()
        ),
    }
    if config.arm is not None:
        tables[ArmTurn] = RecordTable(folder, ArmTurn)
    for close in (vest.close, hand.close, *(table.close for table in tables.values())):
        stack.callback(_closed if real else _called, close)
    backlog = Backlog("tables", rank=run_realtime("beside")) if real else None
    if backlog is not None:
        stack.callback(backlog.close)

    def show(frame: VestFrame) -> None:
        layout: Any = frame.layout
        vest.write(frame.t_ns, haptics.MotorLevels(layout, np.array(frame.intensities, np.uint8)))

    def command(requested: HandCommand) -> None:
        frames: Any = requested.frames
        hand.write(requested.t_ns, frames)

    for kind, table in tables.items():
        bus.subscribe(kind, table.take, name=_NAME, vital=not real, backlog=backlog)
    bus.subscribe(VestFrame, show, name=_NAME, vital=not real, backlog=backlog)
    bus.subscribe(HandCommand, command, name=_NAME, vital=not real, backlog=backlog)
    save_calibration(prepared.calibration, folder / "calibration.toml")
    return vest.info, hand.info


def _called(close: Callable[[], None]) -> None:
    close()


def _closed(close: Callable[[], None]) -> None:
    """Close a table; errors such as a full disk are logged, and end nothing."""
    try:
        close()
    except OSError as error:
        _LOG.warning("%s: %s", _NAME, error.strerror or error)
