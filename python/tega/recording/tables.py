"""The two tables the loop itself fills: contacts and levels."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from tega.recording.csv import CsvWriter, time_text

if TYPE_CHECKING:
    from tega.tactile import ContactMetrics
    from tega.teleop.touch import Felt

__all__ = ["CONTACT_COLUMNS", "RunRecorder"]

CONTACT_COLUMNS = (
    "t_s",
    "finger",
    "cci",
    "eda",
    "cci_norm",
    "eda_norm",
    "peak",
    "in_contact",
    "front",
    "back",
)


class RunRecorder:
    """Writes ``contacts.csv`` and ``levels.csv``.

    Args:
        folder: Where to.
        channels: Names of the EMG channels, such as ``ch3``.
    """

    def __init__(self, folder: Path, channels: Sequence[str]) -> None:
        self._contacts = CsvWriter(folder / "contacts.csv", CONTACT_COLUMNS)
        self._levels = CsvWriter(folder / "levels.csv", ("t_s", *channels, "fused"))

    def contact(self, t_ns: int, finger: str, metrics: ContactMetrics, felt: Felt) -> None:
        """Add one measured frame.

        Args:
            t_ns: Time of the frame in nanoseconds.
            finger: Whose it is.
            metrics: What was measured.
            felt: What of it the wearer is to feel.
        """
        self._contacts.write(
            f"{time_text(t_ns)},{finger},{metrics.cci!r},{metrics.eda},{felt.cci_norm!r},{felt.eda_norm!r},"
            f"{metrics.peak!r},{metrics.in_contact:d},{felt.front!r},{felt.back!r}\n"
        )

    def levels(self, t_ns: int, channels: Sequence[int], fused: int) -> None:
        """Add one EMG block: the level of each channel and the fused one."""
        self._levels.write(f"{time_text(t_ns)},{','.join(map(str, channels))},{fused}\n")

    def close(self) -> None:
        """Finish both files."""
        self._contacts.close()
        self._levels.close()
