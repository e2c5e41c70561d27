"""Stream a run live to the Rerun viewer: pictures, touch, levels, vest, joints, states and log lines."""

from __future__ import annotations

import socket
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, Self

import numpy as np

from tega.errors import DeviceUnavailableError
from tega.haptics import FINGERS
from tega.records import Alert, Contact, Event, Intent, Joints, LogLine, Picture, Record, RunState, VestFrame
from tega.records.bus import Backlog, Bus
from tega.runtime.lifecycle import require
from tega.runtime.threads import run_realtime

RERUN_PORT: Final = 9876
"""Default port of the viewer."""

_APPLICATION = "tega"
_TIMELINE = "run"
_JPEG_QUALITY = 80
_MOST = 2048
_FLUSH_S = 1.0


class RerunStream:
    """Sends a run's records to a viewer that is open on this machine; use as a context manager.

    TEGA serves nothing here: the viewer does. The layout is sent first; ``docs/rerun-layout.rbl`` is the
    same, to open beside a recording. The records go to ``url``; empty while closed.
    """

    def __init__(self, bus: Bus, *, port: int = RERUN_PORT, file: Path | None = None) -> None:
        self._bus, self._port, self._file = bus, port, file
        self._rerun: Any = None
        self._stream: Any = None
        self._fingers: list[str] = []
        self._backlog = Backlog("rerun", most=_MOST, newest=True, rank=run_realtime("beside"))
        self.url = ""

    def __enter__(self) -> Self:
        """Connect, send the layout and subscribe to the run; ``DeviceUnavailableError`` without a viewer."""
        self._rerun = require("rerun", driver="rerun", extra="rerun")
        if self._file is None:
            try:
                socket.create_connection(("127.0.0.1", self._port), timeout=1.0).close()
            except OSError as error:
                raise DeviceUnavailableError(
                    f"rerun: no viewer listens at 127.0.0.1:{self._port}", "start it first: rerun"
                ) from error
        # Now, so that the packages behind them are not loaded while the loop runs: that takes a second.
        self._rerun.Image(np.zeros((2, 2, 3), np.uint8)).compress(jpeg_quality=_JPEG_QUALITY)
        self._rerun.BarChart([0])
        stream = self._rerun.RecordingStream(_APPLICATION)
        if self._file is None:
            self.url = f"rerun+http://127.0.0.1:{self._port}/proxy"
            stream.connect_grpc(self.url, default_blueprint=_layout())
        else:
            self.url = str(self._file)
            stream.save(self._file, default_blueprint=_layout())
        self._stream = stream
        for finger in FINGERS:
            self._name(finger)
        self._bus.subscribe(Record, self._take, name="rerun", backlog=self._backlog)
        return self

    def __exit__(self, *_error: object) -> None:
        """Send the waiting records, for a second at most, and disconnect."""
        self._backlog.close()
        stream, self._stream, self.url = self._stream, None, ""
        if stream is not None:
            try:
                stream.flush(timeout_sec=_FLUSH_S)
            except RuntimeError:  # the viewer was closed meanwhile
                pass
            finally:
                stream.disconnect()

    def _name(self, finger: str) -> None:
        """Name a finger's lines, and give it a place in the layout."""
        self._fingers.append(finger)
        names = self._rerun.SeriesLines(names=[f"{finger} CCI", f"{finger} EDA"])
        self._stream.log(f"/tactile/{finger}/contact", names, static=True)

    def _take(self, record: Record) -> None:
        if self._stream is None or (displayed := self._displayed(record)) is None:
            return
        if isinstance(record, Contact) and record.finger not in self._fingers:
            self._name(record.finger)
            self._stream.send_blueprint(_layout(self._fingers))
        self._stream.set_time(_TIMELINE, duration=record.log_ns / 1e9)
        self._stream.log(record.where, displayed)

    def _displayed(self, record: Record) -> Any:
        rr = self._rerun
        displayed: Any = None
        match record:
            case Picture():
                displayed = rr.Image(record.image, color_model="BGR").compress(jpeg_quality=_JPEG_QUALITY)
            case Contact():
                displayed = rr.Scalars([record.cci_norm, record.eda_norm])
            case Intent():
                displayed = rr.Scalars([record.level])
            case VestFrame():
                displayed = rr.BarChart(list(record.intensities))
            case Joints():
                displayed = rr.Scalars(list(record.angles_rad))
            case RunState():
                displayed = rr.TextLog(f"{record.state}: {record.reason}")
            case Alert():
                displayed = rr.TextLog(record.said or f"over: {record.name}", level="WARN")
            case Event():
                displayed = rr.TextLog(record.words)
            case LogLine():
                displayed = rr.TextLog(record.text)
        return displayed


def save_layout(path: Path) -> None:
    """Write the viewer's layout as an ``.rbl`` file, which Rerun opens; needs rerun-sdk."""
    require("rerun", driver="rerun", extra="rerun")
    _layout().save(_APPLICATION, str(path))


def _layout(fingers: Sequence[str] = FINGERS) -> Any:
    """Return the viewer's layout: fingertips above, touch and vest below them, then hand and words."""
    import rerun.blueprint as rrb

    def named(share: str, finger: str) -> Any:
        return rrb.Spatial2DView(origin=f"/tactile/{finger}/{share}", name=finger)

    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(*(named("image", finger) for finger in fingers)),
            rrb.Horizontal(
                rrb.TimeSeriesView(
                    contents=[f"/tactile/{finger}/contact" for finger in fingers],
                    name="CCI and EDA, share of the maximum",
                ),
                rrb.BarChartView(origin="/vest/frame", name="vest, percent"),
            ),
            rrb.Horizontal(
                rrb.TimeSeriesView(origin="/emg/levels", name="closure level"),
                rrb.TimeSeriesView(origin="/hand/joints", name="joint angles, rad"),
                rrb.TextLogView(origin="/", name="states, alerts, events"),
            ),
        ),
        collapse_panels=True,
    )
