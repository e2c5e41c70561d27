"""Write the tables of a run's output folder from the bus."""

from __future__ import annotations

import logging
from collections.abc import Callable
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

import numpy as np

from tega.config.calibration import save_calibration
from tega.devices.hand.can_recorder import CanRecorder, CanRecorderOptions
from tega.devices.vest.vest_recorder import VestRecorder, VestRecorderOptions
from tega.haptics import vest as haptics
from tega.recording import RecordTable
from tega.records import ArmTurn, Contact, Event, HandCommand, Intent, Record, VestFrame
from tega.records.bus import Backlog
from tega.runtime.threads import run_realtime

if TYPE_CHECKING:
    from tega.config import SessionConfig
    from tega.devices.base import DeviceInfo
    from tega.loop.inbox.prepared import Prepared
    from tega.records.bus import Bus


_LOG = logging.getLogger(__name__)
_NAME = "disk: tables are no longer written"


def open_tables(
    stack: ExitStack, config: SessionConfig, prepared: Prepared, bus: Bus
) -> tuple[DeviceInfo, ...]:
    """Open the tables of the output folder, and have the bus fill them.

    In real time somebody may be steering a hand: a slow disk keeps nobody waiting, and a full one ends the tables and
    not the run. A computation in a hurry ends with the error.

    Args:
        stack: Closes them, once all that waits for them is written.
        config: The settings.
        prepared: What the run starts with.
        bus: Tells them everything.

    Returns:
        What the tables of vest and hand call themselves; nothing without an output folder.
    """
    folder = config.session.out_dir
    if folder is None:
        return ()
    real = config.session.pace == "real"
    vest = VestRecorder(VestRecorderOptions(file=folder / "vest.csv"))
    hand = CanRecorder(CanRecorderOptions(file=folder / "can.csv"))
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

    def command(asked: HandCommand) -> None:
        frames: Any = asked.frames
        hand.write(asked.t_ns, frames)

    for kind, table in tables.items():
        bus.subscribe(kind, table.take, name=_NAME, vital=not real, backlog=backlog)
    bus.subscribe(VestFrame, show, name=_NAME, vital=not real, backlog=backlog)
    bus.subscribe(HandCommand, command, name=_NAME, vital=not real, backlog=backlog)
    save_calibration(prepared.calibration, folder / "calibration.toml")
    return vest.info, hand.info


def _called(close: Callable[[], None]) -> None:
    close()


def _closed(close: Callable[[], None]) -> None:
    """Close a table; what a full disk does not take is told, and ends nothing."""
    try:
        close()
    except OSError as error:
        _LOG.warning("%s: %s", _NAME, error.strerror or error)
