"""Write one MCAP file of records through foxglove-sdk."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping
from pathlib import Path
from typing import BinaryIO

from tega.errors import RecordingError
from tega.recording.disk import RecordingDisk
from tega.recording.record_channels import RecordChannels
from tega.runtime.files.whole_file import lock_file
from tega.runtime.lifecycle import require

_CHUNK_BYTES = 4 * 1024 * 1024
# Of zstd: the noise of a camera hardly yields to more effort.
_LEVEL = 1


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
        self._disk = RecordingDisk(self._raw, path, most_bytes=most_bytes)
        # A thread of its own for compression would only wait for the one that writes.
        self._writer = self._foxglove.open_mcap(
            self._disk,
            context=self.context,
            writer_options=options.MCAPWriteOptions(
                chunk_size=_CHUNK_BYTES, compression_level=_LEVEL, compression_threads=0, disable_seeking=True
            ),
        )

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
