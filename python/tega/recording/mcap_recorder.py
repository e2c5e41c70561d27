"""Record a session: encode and write records in the thread that hands them over."""

from __future__ import annotations

import logging
import shutil
import threading
import time
from collections import Counter
from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import Any

from tega.config import RecordingSection
from tega.errors import RecordingError
from tega.recording.mcap_folder import SessionFolder
from tega.recording.record_channels import McapFile
from tega.records import RECORDS, Record, RecorderStatus

_LOG = logging.getLogger(__name__)

# A kill loses what waits in the queue and what came since the last flush: half a second is promised.
FLUSH_NS = 100_000_000
SYNC_S = 1.0
STATUS_NS = 500_000_000
_MIB = 1024 * 1024


class McapRecorder:
    """Writes one trial of a session.

    When the disk is full, or nearly so, the recording stops and reports it; the run continues, and further
    records are dropped and counted, by topic.

    ``state`` is ``recording``, ``stopped`` (for ``reason``) or ``complete``, when ``path`` is the file.
    """

    def __init__(self, folder: SessionFolder, settings: RecordingSection) -> None:
        self._folder = folder
        self._settings = settings
        self.path = folder.new_trial()
        self._part = self.path.with_name(f"{self.path.name}.part")
        self._file = McapFile(
            self._part,
            lossless=settings.lossless,
            jpeg_quality=settings.jpeg_quality,
            most_bytes=round(settings.queue_mib * _MIB),
        )
        self._lock = threading.RLock()  # a line of the log about the recording is a record too
        self.state, self.reason = "recording", ""
        self._written, self._dropped = Counter[str](), Counter[str]()
        self._waiting = (0, 0)
        self._newest_ns = self._flushed_ns = self._status_ns = self._reported_dropped = 0
        self._warned = False
        self._closing = threading.Event()

    def head(self, facts: Mapping[str, Mapping[str, str]], files: Mapping[str, tuple[str, bytes]]) -> None:
        """Write the file's head, which a reader needs first; slow, so it comes before the session's start.

        ``facts`` are tables of names and texts, ``files`` media type and content; both by name.
        """
        for name, table in facts.items():
            self._file.metadata(name, table)
        for name, (media_type, data) in files.items():
            self._file.attach(name, media_type, data)
        self._file.flush()
        self._file.sync()
        self._folder.note(self.path.name, {"state": "recording", "lossless": self._settings.lossless})

    def begin(self, start_ns: int, epoch_ns: int) -> None:
        """Begin to take records; ``start_ns`` is the session's clock, ``epoch_ns`` that moment since 1970."""
        self._file.epoch_ns = epoch_ns
        self._file.metadata("tega", {"epoch_ns": str(epoch_ns), "start_ns": str(start_ns)})
        self._file.flush()
        threading.Thread(target=self._sync, name="tega-recorder-sync", daemon=True).start()

    def put(self, record: Record, *, t_ns: int | None = None) -> None:
        """Write a record; waits for the disk only where its memory is full. From any thread.

        ``t_ns`` is its arrival since the start of the session, if its own stamp is on another clock.
        """
        with self._lock:
            self._write(record, record.log_ns if t_ns is None else t_ns)
            self._keep_up()

    def take(
        self, records: Iterable[tuple[Record, int]], dropped: Mapping[str, int], waiting: tuple[int, int]
    ) -> None:
        """Write records with their arrivals; note which others were dropped, and how many, of how many bytes, wait."""
        for record, t_ns in records:
            self.put(record, t_ns=t_ns)
        with self._lock:
            self._dropped.update(dropped)
            self._waiting = waiting
            self._keep_up()

    def problem(self) -> str:
        """Return why no more is recorded; else ``""``."""
        return f"stopped: {self.reason}" if self.state == "stopped" else ""

    def finish(self, summary: bytes = b"") -> dict[str, Any]:
        """Write the index and the run's summary (JSON); close the file and give it its name.

        Returns the recording's summary, for people and machines.
        """
        self._closing.set()
        with self._lock:
            if self.state == "recording":
                self._close_file(summary)
            if self.state == "stopped":
                with suppress(Exception):  # why it stopped is known; the file and its thread must not be kept
                    self._file.close()
        facts = {
            "state": self.state,
            "reason": self.reason,
            "lossless": self._settings.lossless,
            "duration_s": self._newest_ns / 1e9,
            "bytes": self._file.disk.n_bytes,
            "written": dict(sorted(self._written.items())),
            "dropped": dict(sorted(self._dropped.items())),
        }
        name = (self.path if self.path.exists() else self._part).name
        try:
            self._folder.note(self.path.name, {**facts, "path": name})
        except (OSError, RecordingError) as error:  # a full disk has no room for the index either
            _LOG.warning("recording: the index could not be written: %s", error)
        return {"file": name, **facts}

    def leave(self) -> None:
        """Leave the file unfinished, to be recovered when the folder is next opened."""
        self._closing.set()
        with self._lock:
            if self.state == "recording":
                self._file.flush()

    def abandon(self) -> None:
        """Take the file away; for a recording that has not begun."""
        self._file.close()
        self._part.unlink(missing_ok=True)

    def _sync(self) -> None:
        """Bring the file to the disk now and then; a slow disk must not hold up the thread that writes."""
        while not self._closing.wait(SYNC_S):
            self._file.sync()

    def _keep_up(self) -> None:
        """Flush the file, and write how the recording goes, when that is due."""
        now_ns = time.monotonic_ns()
        if self.state != "recording":
            return
        flushes = now_ns - self._flushed_ns >= FLUSH_NS
        try:
            if now_ns - self._status_ns >= STATUS_NS or (
                flushes and self._dropped.total() != self._reported_dropped
            ):
                self._status_ns = now_ns
                self._status()
            if flushes and self.state == "recording":  # little room finishes the file
                self._file.flush()
                self._flushed_ns = time.monotonic_ns()
        except Exception as error:  # a recorder must neither take a run with it nor end without a word
            self._stop(f"the file could not be flushed: {type(error).__name__}: {error}")
        if self.state == "recording" and (failed := self._file.disk.error) is not None:
            self._stop(f"the disk took no more: {failed.strerror or failed}")

    def _write(self, record: Record, t_ns: int) -> None:
        topic = record.where
        if self.state != "recording":
            self._dropped[topic] += 1
            return
        try:
            self._file.write(record, t_ns)
        except Exception as error:  # a recorder must never take a run with it
            problem = f"{topic} could not be written: {type(error).__name__}: {error}"
            own = type(record) in RECORDS and not isinstance(error, TypeError)
            if own or isinstance(error, OSError):
                self._stop(problem)
                return
            # A feature's own record, or one with values of another type: the others do not suffer from it.
            self._dropped[topic] += 1
            if self._dropped[topic] == 1:
                _LOG.error("recording: %s; later ones are counted as dropped", problem)
            return
        self._written[topic] += 1
        self._newest_ns = max(self._newest_ns, t_ns)

    def _status(self) -> None:
        free = shutil.disk_usage(self._folder.path).free
        self._reported_dropped = self._dropped.total()
        queued, queued_bytes = self._waiting
        status = RecorderStatus(
            t_ns=self._newest_ns,
            queued=queued,
            queued_bytes=queued_bytes,
            written_bytes=self._file.disk.n_bytes,
            free_bytes=free,
            dropped_topics=tuple(self._dropped),
            dropped_counts=tuple(self._dropped.values()),
        )
        self._file.write(status, self._newest_ns)
        settings = self._settings
        if free < settings.stop_free_mib * _MIB:
            left = "left on the disk, recording.stop_free_mib is"
            reason = f"{free / _MIB:.0f} MiB {left} {settings.stop_free_mib:g}"
            self._close_file(b"", reason)
            self._stop(reason)
        elif free < settings.warn_free_mib * _MIB and not self._warned:
            self._warned = True
            _LOG.warning("recording: only %.0f MiB left on the disk", free / _MIB)

    def _close_file(self, summary: bytes, reason: str = "") -> None:
        dropped = {topic: str(n) for topic, n in self._dropped.items()}
        try:
            if summary:
                self._file.attach("summary.json", "application/json", summary)
            self._file.metadata("dropped", dropped)
            self._file.metadata("end", {"state": "stopped" if reason else "complete", "reason": reason})
            self._file.close()
            if (failed := self._file.disk.error) is None:
                self._part.replace(self.path)
        except Exception as error:  # reported; the file is finished at the next start
            self._stop(f"the file could not be finished: {type(error).__name__}: {error}")
            return
        if failed is not None:
            self._stop(f"the disk took no more: {failed.strerror or failed}")
            return
        self.state = "complete"

    def _stop(self, reason: str) -> None:
        self.state, self.reason = "stopped", reason
        _LOG.warning("recording stopped: %s; the run goes on", reason)
