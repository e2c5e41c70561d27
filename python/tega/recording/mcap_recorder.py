"""Record a session: take records from others at once, while one thread encodes and writes them."""

from __future__ import annotations

import logging
import shutil
import threading
import time
from collections.abc import Mapping
from typing import Any, BinaryIO

from tega.config import RecordingSection
from tega.errors import RecordingError
from tega.recording.mcap_file import BoundedQueue, Item, McapFile
from tega.recording.mcap_folder import SessionFolder
from tega.records import RECORDS, Record, RecorderStatus
from tega.runtime.threads import run_realtime

_LOG = logging.getLogger(__name__)

# A kill loses what waits in the queue and what came since the last flush: half a second is promised.
FLUSH_NS = 100_000_000
SYNC_S = 1.0
STATUS_NS = 500_000_000
_IDLE_S = 0.01
# How long the end of a run waits for a slow disk.
_DRAIN_S = 10.0
_MIB = 1024 * 1024


class McapRecorder:
    """Writes one trial of a session.

    :meth:`put` never waits for the disk (unless ``wait``, for runs that are not in real time) and never
    encodes. Records that do not fit into the queue, of ``queue_bytes`` or as the settings have it, are
    dropped and counted, by topic. When the disk is full, or nearly so, the recording stops and reports it;
    the run continues. ``raw`` is something else to write to than a file in the folder.

    ``state`` is ``recording``, ``stopped`` (for ``reason``) or ``complete``, when ``path`` is the file.
    """

    def __init__(
        self,
        folder: SessionFolder,
        settings: RecordingSection,
        *,
        wait: bool = False,
        queue_bytes: int | None = None,
        raw: BinaryIO | None = None,
    ) -> None:
        self._folder = folder
        self._settings = settings
        self.path = folder.new_trial()
        self._part = self.path.with_name(f"{self.path.name}.part")
        self._file = McapFile(
            self._part,
            lossless=settings.lossless,
            jpeg_quality=settings.jpeg_quality,
            most_bytes=round(settings.queue_mib * _MIB),
            raw=raw,
        )
        self._queue = BoundedQueue(
            most_bytes=round(settings.queue_mib * _MIB) if queue_bytes is None else queue_bytes, wait=wait
        )
        self.state, self.reason = "recording", ""
        self.written: dict[str, int] = {}
        self._newest_ns = 0
        self._warned = False
        self._reported_dropped = 0
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._work, name="tega-recorder", daemon=True)

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
        self._thread.start()
        threading.Thread(target=self._sync, name="tega-recorder-sync", daemon=True).start()

    def put(self, record: Record, *, t_ns: int | None = None) -> None:
        """Hand over a record, not encoded yet.

        ``t_ns`` is its arrival since the start of the session, if its own stamp is on another clock.
        """
        self._queue.put(Item.of(record, t_ns))

    def count_dropped(self, dropped: Mapping[str, int]) -> None:
        """Count records, by topic, that were dropped before they came here."""
        self._queue.dropped.update(dropped)

    @property
    def dropped(self) -> dict[str, int]:
        """Records that did not fit, by topic."""
        return dict(self._queue.dropped)

    def problem(self) -> str:
        """Return why no more is recorded, or how many records were dropped while that goes on; else ``""``."""
        if self.state == "stopped":
            return f"stopped: {self.reason}"
        return self._queue.problem()

    def finish(self, summary: bytes = b"") -> dict[str, Any]:
        """Write what waits, the index and the run's summary (JSON); close the file and give it its name.

        Returns the recording's summary, for people and machines.
        """
        self._drain()
        if self._thread.is_alive():
            self._queue.discard()
            self._stop(f"the disk did not take what waited within {_DRAIN_S:g} s")
        elif self.state == "recording":
            self._close_file(summary)
        facts = self.facts()
        name = self.path.name if self.state == "complete" or self.path.exists() else self._part.name
        try:
            self._folder.note(self.path.name, {**facts, "path": name})
        except (OSError, RecordingError) as error:  # a full disk has no room for the index either
            _LOG.warning("recording: the index could not be written: %s", error)
        return {"file": name, **facts}

    def leave(self) -> None:
        """Write the waiting records and leave the file unfinished, to be recovered when the folder is next opened."""
        self._drain()
        if self.state == "recording" and not self._thread.is_alive():
            self._file.flush()

    def abandon(self) -> None:
        """Take the file away; for a recording that has not begun."""
        self._file.close()
        self._part.unlink(missing_ok=True)

    def facts(self) -> dict[str, Any]:
        """Return state, sizes and counts."""
        return {
            "state": self.state,
            "reason": self.reason,
            "lossless": self._settings.lossless,
            "duration_s": self._newest_ns / 1e9,
            "bytes": self._file.n_bytes,
            "written": dict(sorted(self.written.items())),
            "dropped": dict(sorted(self._queue.dropped.items())),
        }

    def _drain(self) -> None:
        self._queue.close()
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join(_DRAIN_S)

    def _sync(self) -> None:
        """Bring the file to the disk now and then; a slow disk must not hold up the thread that writes."""
        while not self._closing.wait(SYNC_S):
            self._file.sync()

    @run_realtime("beside")
    def _work(self) -> None:
        """Write until asked to close, then write the rest."""
        now_ns = time.monotonic_ns()
        flush_ns = now_ns
        status_ns = now_ns - STATUS_NS
        while True:
            closing = self._closing.is_set()  # looked at first: nothing comes after it
            item = self._queue.take()
            if item is None:
                if closing:
                    return
                time.sleep(_IDLE_S)
            else:
                self._write(item)
                self._queue.done(item)
            now_ns = time.monotonic_ns()
            if self.state != "recording":
                continue
            flushes = now_ns - flush_ns >= FLUSH_NS
            try:
                if now_ns - status_ns >= STATUS_NS or (
                    flushes and self._queue.dropped.total() != self._reported_dropped
                ):
                    status_ns = now_ns
                    self._status()
                if flushes and self.state == "recording":  # little room finishes the file
                    self._file.flush()
                    flush_ns = time.monotonic_ns()
            except Exception as error:  # a recorder must neither take a run with it nor end without a word
                self._stop(f"the file could not be flushed: {type(error).__name__}: {error}")
            if self.state == "recording" and (failed := self._file.error) is not None:
                self._stop(f"the disk took no more: {failed.strerror or failed}")

    def _write(self, item: Item) -> None:
        topic = item.record.where
        if self.state != "recording":
            self._queue.dropped[topic] += 1
            return
        try:
            self._file.write(item.record, item.t_ns)
        except Exception as error:  # a recorder must never take a run with it
            problem = f"{topic} could not be written: {type(error).__name__}: {error}"
            own = type(item.record) in RECORDS and not isinstance(error, TypeError)
            if own or isinstance(error, OSError):
                self._stop(problem)
                return
            # A feature's own record, or one with values of another type: the others do not suffer from it.
            self._queue.dropped[topic] += 1
            if self._queue.dropped[topic] == 1:
                _LOG.error("recording: %s; later ones are counted as dropped", problem)
            return
        self.written[topic] = self.written.get(topic, 0) + 1
        self._newest_ns = max(self._newest_ns, item.t_ns)

    def _status(self) -> None:
        free = shutil.disk_usage(self._folder.path).free
        dropped = dict(self._queue.dropped)
        self._reported_dropped = sum(dropped.values())
        t_ns = self._newest_ns
        status = RecorderStatus(
            t_ns=t_ns,
            queued=len(self._queue),
            queued_bytes=self._queue.n_bytes,
            written_bytes=self._file.n_bytes,
            free_bytes=free,
            dropped_topics=tuple(dropped),
            dropped_counts=tuple(dropped.values()),
        )
        self._file.write(status, t_ns)
        settings = self._settings
        if free < settings.stop_free_mib * _MIB:
            self._close_file(b"")
            left = "left on the disk, recording.stop_free_mib is"
            self._stop(f"{free / _MIB:.0f} MiB {left} {settings.stop_free_mib:g}")
        elif free < settings.warn_free_mib * _MIB and not self._warned:
            self._warned = True
            _LOG.warning("recording: only %.0f MiB left on the disk", free / _MIB)

    def _close_file(self, summary: bytes) -> None:
        dropped = {topic: str(n) for topic, n in self._queue.dropped.items()}
        try:
            if summary:
                self._file.attach("summary.json", "application/json", summary)
            self._file.metadata("dropped", dropped)
            self._file.metadata("end", {"state": "complete"})
            self._file.close()
        except Exception as error:  # told; the file is finished at the next start
            self._stop(f"the file could not be finished: {type(error).__name__}: {error}")
            return
        if (failed := self._file.error) is not None:
            self._stop(f"the disk took no more: {failed.strerror or failed}")
            return
        if self._part.exists():
            self._part.replace(self.path)
        self.state = "complete"

    def _stop(self, reason: str) -> None:
        self.state, self.reason = "stopped", reason
        _LOG.warning("recording stopped: %s; the run goes on", reason)
