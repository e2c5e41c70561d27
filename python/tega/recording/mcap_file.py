"""Queue records, bounded, those that do not fit counted, and write one MCAP file of them through foxglove-sdk."""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections import Counter, deque
from collections.abc import Mapping
from pathlib import Path
from typing import BinaryIO, NamedTuple, Self

from tega.errors import RecordingError
from tega.recording.disk import open_disk
from tega.recording.record_channels import RecordChannels
from tega.records import Picture, Record
from tega.records.base import VideoPacket
from tega.records.bus import report_drops
from tega.runtime.files.whole_file import lock_file
from tega.runtime.lifecycle import require

# Small records still find room when pictures have filled the queue: without them nothing could be replayed.
RESERVE_BYTES = 16 * 1024 * 1024
_WAIT_S = 0.002
# A record costs this in memory besides its numbers.
_ITEM_BYTES = 512

_CHUNK_BYTES = 4 * 1024 * 1024
# Of zstd: the noise of a camera hardly yields to more effort.
_LEVEL = 1


class Item(NamedTuple):
    """A record to be written, not yet encoded.

    ``t_ns`` is its arrival since the start of the session; ``n_bytes`` is about its size in memory.
    """

    record: Record
    t_ns: int
    n_bytes: int

    @classmethod
    def of(cls, record: Record, t_ns: int | None) -> Self:
        """Make the item of a record, which came at the time of its own stamp unless another is given."""
        return cls(record, record.log_ns if t_ns is None else t_ns, record.n_bytes + _ITEM_BYTES)


class BoundedQueue:
    """First in, first out, up to so many bytes; given by many threads, taken by one.

    The consumer holds no lock: its thread has the lowest priority in the program, and the producers would
    wait for it. Beyond ``most_bytes`` pictures are dropped and counted, everything else 16 MiB later; with
    ``wait`` producers wait instead, for runs that are not in real time.
    """

    def __init__(self, *, most_bytes: int, wait: bool = False) -> None:
        self._most_bytes = most_bytes
        self._wait = wait
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

    def put(self, item: Item) -> bool:
        """Add an item; return at once (unless ``wait`` is set) whether there was room."""
        reserve = 0 if isinstance(item.record, Picture | VideoPacket) else RESERVE_BYTES
        limit = self._most_bytes + reserve
        while True:
            with self._lock:
                if self._closed:
                    self._drop(item)
                    return False
                # One item always fits, however large it is.
                if self.n_bytes == 0 or self.n_bytes + item.n_bytes <= limit:
                    self._given_bytes += item.n_bytes
                    self._items.append(item)
                    return True
                if not self._wait:
                    self._drop(item)
                    return False
            time.sleep(_WAIT_S)

    def take(self) -> Item | None:
        """Return the oldest item, ``None`` when there is none; its bytes count until :meth:`done`."""
        try:
            return self._items.popleft()
        except IndexError:
            return None

    def done(self, item: Item) -> None:
        """Free an item's room; called by the consumer."""
        self._done_bytes += item.n_bytes

    def problem(self) -> str:
        """Return how many were dropped while that goes on, ``""`` once no more are."""
        dropped = report_drops(self.dropped.total(), self._dropped_at_s)
        return f"{dropped}: disk or processor does not keep up" if dropped else ""

    def close(self) -> None:
        """Accept no more items: new ones count as dropped, waiting ones can still be taken."""
        with self._lock:
            self._closed = True

    def discard(self) -> None:
        """Count everything that waits as dropped."""
        while (item := self.take()) is not None:
            self.dropped[item.record.where] += 1
            with self._lock:
                self._given_bytes -= item.n_bytes

    def _drop(self, item: Item) -> None:
        self.dropped[item.record.where] += 1
        self._dropped_at_s = time.monotonic()


class McapFile(RecordChannels):
    """A file that grows by items; ``path`` must not exist.

    Pictures are kept as they are (``lossless``), else as JPEG of ``jpeg_quality``, 1 to 100. At most
    ``most_bytes`` wait in memory for the disk. ``raw`` is another target, opened for writing without a
    buffer.
    """

    def __init__(
        self,
        path: Path,
        *,
        lossless: bool,
        jpeg_quality: int = 95,
        most_bytes: int = 128 * 1024 * 1024,
        raw: BinaryIO | None = None,
    ) -> None:
        super().__init__(lossless=lossless, jpeg_quality=jpeg_quality, cells=True)
        options = require("foxglove.mcap", driver="recording", extra="record")
        try:
            self._raw = path.open("xb", buffering=0) if raw is None else raw
        except OSError as error:
            raise RecordingError(
                f"{path.name}: cannot be made: {error.strerror}", f"looked at {path.parent}"
            ) from error
        lock_file(self._raw, path)
        self._disk = open_disk(self._raw, path, most_bytes=most_bytes)
        # A thread of its own for compression would only wait for the one that writes.
        self._writer = self._foxglove.open_mcap(
            self._disk,
            context=self.context,
            writer_options=options.MCAPWriteOptions(
                chunk_size=_CHUNK_BYTES, compression_level=_LEVEL, compression_threads=0, disable_seeking=True
            ),
        )
        self.n_items = 0

    @property
    def n_bytes(self) -> int:
        """Bytes written so far."""
        return self._disk.n_bytes

    @property
    def error(self) -> OSError | None:
        """Reason why the file cannot be written any more."""
        return self._disk.error

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add a table of names and texts."""
        self._writer.write_metadata(name, dict(values))

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Add a file."""
        self._writer.attach(
            log_time=self.epoch_ns, create_time=self.epoch_ns, name=name, media_type=media_type, data=data
        )

    def write(self, record: Record, t_ns: int) -> None:
        """Encode a record and add it; ``t_ns`` is its arrival, nanoseconds since the start of the session."""
        self.n_items += 1
        super().write(record, t_ns)

    def flush(self) -> None:
        """Hand everything to where it outlives this process."""
        self._writer.flush()
        self._disk.flush()

    def sync(self) -> None:
        """Wait until all that was flushed is on the disk, which outlives the power; any thread may."""
        if self._disk.error is None:
            # A pipe cannot be waited for, nor a file that was closed meanwhile.
            with contextlib.suppress(OSError, ValueError):
                os.fsync(self._raw.fileno())

    def close(self) -> None:
        """Write the index and close the file."""
        try:
            self._writer.close()
            self._disk.close()
        finally:
            with contextlib.suppress(OSError):
                self._raw.close()
