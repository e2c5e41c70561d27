"""Record one run, as a subscriber to its bus, with a folder and a recorder of the run's own."""

from __future__ import annotations

import io
import json
import logging
import threading
import time
from collections.abc import Callable, Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.config import SessionConfig
from tega.config.attached import attached_files, config_text
from tega.config.calibration.store import Calibration, calibration_text
from tega.config.choose import chosen_stage, metric_choice
from tega.config.guests import guest_files, guest_packages
from tega.loop.pacing import LoopReport
from tega.loop.parts import Part, PartContext, RunStart
from tega.recording.mcap_folder import SessionFolder
from tega.recording.mcap_recorder import McapRecorder
from tega.recording.mcap_schemas import record_versions, unit_table
from tega.recording.origin import versions
from tega.recording.recorder_process import RecorderProcess
from tega.records import End, HandExchange, LogLine, Record
from tega.records.bus import Bus
from tega.records.types import record_types
from tega.runtime.device_items import DeviceInfo
from tega.runtime.features import author_of

FORMAT = "tega-recording"
VERSION = "3"

_LOG = logging.getLogger(__name__)


class Recording(Part):
    """Records one run from its bus into a session's folder; ``ConfigError`` where that holds something else.

    Create it before the devices are opened, so that missing parts are reported first.
    """

    def __init__(self, config: SessionConfig, folder: Path, bus: Bus) -> None:
        self.folder = SessionFolder(folder)
        for recovered in self.folder.recovered:
            _LOG.warning(
                "recording: %s was not finished; recovered %d messages",
                recovered.path.name,
                recovered.n_messages,
            )
        self._recorder: McapRecorder | RecorderProcess
        if config.session.pace == "fast":  # nobody waits for a deadline
            self._recorder = McapRecorder(self.folder, config.recording)
        else:
            self._recorder = RecorderProcess(self.folder, config.recording, realtime=config.session.realtime)
        self._log = LogRecords(self._recorder.put)
        self._lock = threading.Lock()
        self._start_ns: int | None = None
        self._early: list[HandExchange] = []
        self.trial = self._recorder.path.stem
        self._kinds, self._undeclared = frozenset(record_types()), dict[type[Record], str]()
        bus.subscribe(Record, self._take, name="recording")

    def alerts(self) -> Mapping[str, Callable[[], str]]:
        """Return the alert of the recording."""
        return {"recording": self.problem}

    def head(self, run: RunStart) -> None:
        """Write the file's head, before the session starts: everything that a reader needs first."""
        config, prepared = run.config, run.prepared
        infos = {name: finger.source.info for name, finger in prepared.fingers.items()}
        if prepared.muscles is not None:
            infos["emg"] = prepared.muscles.source.info
        infos |= run.arm_infos
        self.describe(
            config,
            calibration=prepared.calibration,
            calibration_name=prepared.calibration_name or "self-calibrated",
            baselines={name: finger.baseline for name, finger in prepared.fingers.items()},
            sources=infos,
            facts={
                "layout": run.layout,
                "pace": run.pace,
                "live_vest": str(bool(run.sinks.live_vests)).lower(),
                "steered": str(run.sinks.steered is not None).lower(),
                "observed": str(run.observed).lower(),
            },
        )

    def describe(
        self,
        config: SessionConfig,
        *,
        calibration: Calibration,
        calibration_name: str,
        baselines: Mapping[str, NDArray[np.uint8]],
        sources: Mapping[str, DeviceInfo],
        facts: Mapping[str, str],
    ) -> None:
        """Write the head of the file from its parts.

        ``calibration_name`` is the origin of the maxima, ``baselines`` are untouched pictures by finger,
        uint8 (H, W, 3), ``sources`` the inputs by finger and ``emg`` for the muscles. ``facts`` are
        ``layout``, ``pace``, and whether the vest is live, the hand steered, and a display connected.
        """
        text = config_text(config)
        reported = {
            "tega": {
                "format": FORMAT,
                "version": VERSION,
                **facts,
                "sent": "every",
                "lossless": str(config.recording.lossless).lower(),
                "metric": metric_choice(config.stages, config.session.preset),
                "mapping": chosen_stage("mapping", config.stages, config.session.preset).name,
                "config_sha256": sha256(text.encode()).hexdigest(),
                "calibration": calibration_name,
            },
            "versions": versions(),
            "features": guest_packages(config),
            "records": {name: str(version) for name, version in record_versions().items()},
            "units": unit_table(),
            "sources": {name: msgspec.json.encode(info).decode() for name, info in sources.items()},
        }
        files = {
            "session.toml": ("application/toml", text.encode()),
            "calibration.toml": ("application/toml", calibration_text(calibration).encode()),
        }
        for name, baseline in baselines.items():
            file = io.BytesIO()
            np.save(file, baseline)
            files[f"baseline-{name}.npy"] = ("application/octet-stream", file.getvalue())
        poses = getattr(config.hand.options, "poses", None)
        if poses is not None:
            files["poses.toml"] = ("application/toml", poses.read_bytes())
        for name, data in attached_files(config.stages).items():
            files[name] = ("application/octet-stream", data)
        for name, path in guest_files(config).items():
            files[name] = ("application/octet-stream", path.read_bytes())
        self._recorder.head(reported, files)

    def begin(self, run: RunStart) -> None:
        """Begin, at the start of the session or just after, by the session's clock."""
        self.start(run.start_ns, run.now_ns)

    def start(self, start_ns: int, now_ns: int) -> None:
        """Begin at a time of the session's clock, nanoseconds."""
        # The time of day is looked at once: a step of that clock while recording moves nothing.
        self._recorder.begin(start_ns, time.time_ns() - (now_ns - start_ns))
        self._log.start_ns = time.monotonic_ns() - (now_ns - start_ns)
        logging.getLogger("tega").addHandler(self._log)
        with self._lock:
            self._start_ns = start_ns
            for exchange in self._early:
                self._recorder.put(exchange, t_ns=exchange.t_ns - start_ns)
            self._early.clear()

    def problem(self) -> str:
        """Return why no more is recorded, or how many records were dropped while that goes on; else ``""``."""
        problem = "; ".join(filter(None, (self._recorder.problem(), *self._undeclared.values())))
        return f"recording: {problem}" if problem else ""

    def ended(self, report: LoopReport, n_waits: int) -> None:
        """Record how the loop ended, and after how many deadlines."""
        self._recorder.put(End(end_ns=report.end_ns, ended=report.ended, n_waits=n_waits))

    def notes(self) -> list[str]:
        """Return which records were not recorded."""
        return list(self._undeclared.values())

    def finish(self, summary: dict[str, Any]) -> None:
        """Finish the file, and add its report to the summary."""
        summary["recording"] = self.close(summary)

    def close(self, summary: Mapping[str, Any]) -> dict[str, Any]:
        """Finish the file, and return its report."""
        logging.getLogger("tega").removeHandler(self._log)
        return self._recorder.finish(json.dumps(summary, ensure_ascii=False).encode())

    def abandon(self) -> None:
        """Take away the file of a run that never began."""
        if self._start_ns is None:
            self._recorder.abandon()

    def _take(self, record: Record) -> None:
        """Take a record; before the session starts, only exchanges with a hand are kept."""
        if (kind := type(record)) not in self._kinds:  # a recording has no schema for it
            if kind not in self._undeclared:
                author = author_of(kind.__module__)
                named = f"{kind.__module__}.{kind.__name__} is not in the records of"
                whose = f"the feature {author.name!r}" if author else "a feature"
                self._undeclared[kind] = f"{kind.topic} is not recorded: {named} {whose}"
                _LOG.error("recording: %s; add it there", self._undeclared[kind])
        elif isinstance(record, HandExchange):
            with self._lock:
                start_ns = self._start_ns
                if start_ns is None:
                    self._early.append(record)
                    return
            self._recorder.put(record, t_ns=record.t_ns - start_ns)
        elif self._start_ns is not None:
            self._recorder.put(record)


def open_part(context: PartContext) -> Recording | None:
    """Make the recording before devices are opened, to report missing parts first; ``None`` if not enabled."""
    folder = context.config.recording.dir
    if folder is None:
        return None
    recording = Recording(context.config, folder, context.bus)
    context.stack.callback(recording.abandon)
    return recording


class LogRecords(logging.Handler):
    """Makes a record of each line of the log; ``start_ns`` is the monotonic clock at the session's start."""

    def __init__(self, put: Callable[[LogLine], object]) -> None:
        super().__init__(logging.INFO)
        self._put = put
        # A logger with this handler only would no longer warn people where nobody has set logging up.
        self._last = None if logging.getLogger("tega").hasHandlers() else logging.lastResort
        self.start_ns = 0

    def emit(self, record: logging.LogRecord) -> None:
        """Hand a line over."""
        t_ns = time.monotonic_ns() - self.start_ns
        if self._last is not None and record.levelno >= self._last.level:
            self._last.handle(record)
        self._put(LogLine(t_ns=t_ns, level=record.levelno, name=record.name, text=record.getMessage()))
