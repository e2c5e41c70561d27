"""Record a live run in a process of its own, so that encoding and writing never hold the run's interpreter lock.

The run's threads put records into a bounded queue, as for a recorder in the same process. One thread sends them to
the process (:mod:`tega.recording.recorder_program`) a hundred times a second; another receives its answers.
"""

from __future__ import annotations

import contextlib
import io
import logging
import math
import subprocess
import threading
import time
from collections import Counter, deque
from collections.abc import Iterable, Mapping
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, Final, NamedTuple

from tega.config import RecordingSection
from tega.errors import RecordingError
from tega.recording.mcap_folder import SessionFolder
from tega.records import Picture, Record
from tega.records.base import VideoPacket
from tega.records.bus import report_drops
from tega.runtime.child_process import end_child, receive_object, send_object, start_child, widen_pipe
from tega.runtime.threads import run_realtime

_LOG = logging.getLogger(__name__)

_TURN_S: Final = 0.01
# So often the process receives how much waits, and writes what it has to the disk, though nothing new comes.
_BEAT_S: Final = 0.1
# Records go in parts of about so much, so that the queue empties while a full pipe waits.
_PART_BYTES: Final = 4 * 1024 * 1024
_ANSWER_S: Final = 30.0
_DRAIN_S: Final = 10.0
_LEAVE_S: Final = 2.0
_MIB: Final = 1024 * 1024
# Small records still find room when pictures have filled the queue: without them nothing could be replayed.
RESERVE_BYTES = 16 * 1024 * 1024
# A record costs this in memory besides its numbers.
_ITEM_BYTES = 512


class Item(NamedTuple):
    """A record to be written, not yet encoded.

    ``t_ns`` is its arrival since the start of the session; ``n_bytes`` is about its size in memory.
    """

    record: Record
    t_ns: int
    n_bytes: int


class BoundedQueue:
    """First in, first out, up to so many bytes; given by many threads, taken by one.

    The consumer holds no lock: its thread has the lowest priority in the program, and the producers would
    wait for it. Beyond ``most_bytes`` pictures are dropped and counted, everything else 16 MiB later.
    """

    def __init__(self, *, most_bytes: int) -> None:
        self._most_bytes = most_bytes
        self._items: deque[Item] = deque()
        self._lock = threading.Lock()
        self._closed = False
        self._given_bytes = 0
        self._done_bytes = 0
        self.dropped: Counter[str] = Counter()
        self._dropped_at_s = 0.0

    def __len__(self) -> int:
        """Return how many wait."""
        return len(self._items)

    @property
    def n_bytes(self) -> int:
        """Memory that the items take, bytes."""
        return self._given_bytes - self._done_bytes

    def put(self, item: Item) -> None:
        """Add an item, or drop it where there is no room; returns at once."""
        reserve = 0 if isinstance(item.record, Picture | VideoPacket) else RESERVE_BYTES
        with self._lock:
            # One item always fits, however large it is.
            room = self.n_bytes == 0 or self.n_bytes + item.n_bytes <= self._most_bytes + reserve
            if self._closed or not room:
                self.dropped[item.record.where] += 1
                self._dropped_at_s = time.monotonic()
                return
            self._given_bytes += item.n_bytes
            self._items.append(item)

    def take(self, most_bytes: float = math.inf) -> list[Item]:
        """Return the oldest items, the last of which reaches that size; their bytes count until :meth:`done`."""
        items, n_bytes = list[Item](), 0
        with contextlib.suppress(IndexError):  # no more are waiting
            while n_bytes < most_bytes:
                items.append(self._items.popleft())
                n_bytes += items[-1].n_bytes
        return items

    def done(self, items: Iterable[Item]) -> None:
        """Free the room of items; called by the consumer."""
        self._done_bytes += sum(item.n_bytes for item in items)

    def problem(self) -> str:
        """Return how many were dropped while that goes on, ``""`` once no more are."""
        dropped = report_drops(self.dropped.total(), self._dropped_at_s)
        return f"{dropped}: disk or processor does not keep up" if dropped else ""

    def close(self) -> None:
        """Accept no more items: new ones count as dropped, waiting ones can still be taken."""
        with self._lock:
            self._closed = True


class RecorderProcess:
    """Writes one trial of a session through a process of its own.

    The interface is that of :class:`~tega.recording.mcap_recorder.McapRecorder`, with the same results.
    ``RecordingError`` where the process does not start, or the file cannot be made. ``realtime`` is whether
    the process may ask for real-time priority.
    """

    def __init__(self, folder: SessionFolder, settings: RecordingSection, *, realtime: bool) -> None:
        self._folder, self._settings = folder, settings
        self._begun = (0, 0)
        self._sent_ns = 0
        self._queue = BoundedQueue(most_bytes=round(settings.queue_mib * _MIB))
        self.state, self.reason = "recording", ""
        self._reported_dropped: Counter[str] = Counter()
        self._answers: SimpleQueue[tuple[str, Any]] = SimpleQueue()
        self._closing = threading.Event()
        self._process = start_child("tega.recording.recorder_program", stdout=subprocess.PIPE)
        assert isinstance(self._process.stdin, io.BufferedWriter)
        assert isinstance(self._process.stdout, io.BufferedReader)
        self._requested, self._text = self._process.stdin, self._process.stdout
        widen_pipe(self._requested)
        self._listener = threading.Thread(target=self._listen, name="tega-recorder-answers", daemon=True)
        self._listener.start()
        self._thread = threading.Thread(target=self._ship, name="tega-recorder", daemon=True)
        try:
            send_object(self._requested, (folder.path, settings, realtime))
            self.path: Path = self._answer("start")
        except BaseException:
            self._end()
            raise

    @property
    def pid(self) -> int:
        """The process's number."""
        return self._process.pid

    def head(self, facts: Mapping[str, Mapping[str, str]], files: Mapping[str, tuple[str, bytes]]) -> None:
        """Write the file's head, which a reader needs first; returns when it is on the disk."""
        self._ask("head", facts, files)

    def begin(self, start_ns: int, epoch_ns: int) -> None:
        """Begin to take records, returning at once; see :meth:`.McapRecorder.begin`."""
        self._begun = (start_ns, epoch_ns)
        self._thread.start()

    def put(self, record: Record, *, t_ns: int | None = None) -> None:
        """Hand a record over; returns at once. Records that do not fit are dropped and counted."""
        t_ns = record.log_ns if t_ns is None else t_ns
        self._queue.put(Item(record, t_ns, record.n_bytes + _ITEM_BYTES))

    def problem(self) -> str:
        """Return why no more is recorded, or how many records were dropped while that goes on; else ``""``."""
        if self.state == "stopped":
            return f"stopped: {self.reason}"
        return self._queue.problem()

    def finish(self, summary: bytes = b"") -> dict[str, Any]:
        """Write what waits, the index and the run's summary (JSON); end the process, return the summary."""
        self._queue.close()
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join(_DRAIN_S)
        try:
            facts: dict[str, Any] = self._finished(summary)
        except (RecordingError, OSError) as error:
            facts = self._lost(str(error))
        self._end()
        return facts

    def abandon(self) -> None:
        """Take the file away; for a recording that has not begun."""
        with contextlib.suppress(RecordingError, OSError):
            self._ask("abandon")
        self._end()

    def _finished(self, summary: bytes) -> dict[str, Any]:
        if self._thread.is_alive():
            raise RecordingError(f"the recorder's process took no more within {_DRAIN_S:g} s")
        facts: dict[str, Any] = self._ask("finish", summary)
        self.state, self.reason = facts["state"], facts["reason"]
        return facts

    def _lost(self, why: str) -> dict[str, Any]:
        """Return the facts about a recording with a lost process, and write them into the index."""
        self._process.kill()
        self._queue.dropped.update(item.record.where for item in self._queue.take())
        if self.state != "stopped":
            self._stop(why)
        part = self.path.with_name(f"{self.path.name}.part")
        facts = {
            "state": self.state,
            "reason": self.reason,
            "lossless": self._settings.lossless,
            "duration_s": self._sent_ns / 1e9,
            "bytes": part.stat().st_size if part.exists() else 0,
            "written": {},  # nobody is left who knows
            "dropped": dict(sorted(self._queue.dropped.items())),
        }
        with contextlib.suppress(OSError, RecordingError):  # a full disk has no room for the index either
            self._folder.note(self.path.name, {**facts, "path": part.name})
        return {"file": part.name, **facts}

    def _end(self) -> None:
        end_child(self._process, _LEAVE_S)
        self._listener.join()
        self._text.close()

    def _ask(self, verb: str, *content: Any) -> Any:
        # A process that stands still with a full pipe would keep the run waiting: only its end frees the pipe.
        patience = threading.Timer(_ANSWER_S, self._process.kill)
        patience.start()
        try:
            send_object(self._requested, (verb, *content))
        except OSError as error:
            raise RecordingError(self._gone(), "see the recorder's message above") from error
        finally:
            patience.cancel()
        return self._answer(verb)

    def _answer(self, verb: str) -> Any:
        try:
            kind, content = self._answers.get(timeout=_ANSWER_S)
        except Empty:
            raise RecordingError(
                f"the recorder's process did not answer {verb!r} within {_ANSWER_S:g} s"
            ) from None
        if kind == "failed":
            raise content
        return content

    @run_realtime("beside")
    def _ship(self) -> None:
        if not self._say("begin", *self._begun):
            return
        said_s = 0.0
        while True:
            closing = self._closing.is_set()  # looked at first: nothing comes after it
            items = self._queue.take(_PART_BYTES)
            dropped = self._queue.dropped - self._reported_dropped
            if items or dropped or time.monotonic() - said_s >= _BEAT_S:
                said_s = time.monotonic()
                self._reported_dropped += dropped
                records, waiting = [(item.record, item.t_ns) for item in items], len(self._queue)
                if not self._say("records", records, dropped, (waiting, self._queue.n_bytes)):
                    self._queue.dropped.update(item.record.where for item in items)
                    return
                self._queue.done(items)
                self._sent_ns = max([self._sent_ns, *(item.t_ns for item in items)])
            elif closing:
                return
            else:
                time.sleep(_TURN_S)

    def _say(self, verb: str, *content: Any) -> bool:
        """Send the process a message without an answer; return whether it is still there to receive it."""
        try:
            send_object(self._requested, (verb, *content))
        except OSError:
            if self.state != "stopped":
                self._stop(self._gone())
            self._queue.close()
            return False
        return True

    def _listen(self) -> None:
        while True:
            try:
                kind, *content = receive_object(self._text)
            except (EOFError, OSError):
                self._answers.put(("failed", RecordingError(self._gone())))
                return
            if kind == "log":
                level, name, text = content
                logging.getLogger(name).log(level, "%s", text)
            elif kind == "state":
                self.state, self.reason = content
            else:
                self._answers.put((kind, content[0]))

    def _gone(self) -> str:
        code = self._process.poll()
        return "the recorder's process ended" + ("" if code is None else f" with code {code}")

    def _stop(self, reason: str) -> None:
        self.state, self.reason = "stopped", reason
        _LOG.warning("recording stopped: %s; the run goes on", reason)
