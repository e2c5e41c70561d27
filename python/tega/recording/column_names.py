"""Name the columns of a recording's tables: the same names in an export, in Python and in a run's own tables."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from functools import cache
from typing import TYPE_CHECKING

import msgspec

from tega.devices.base import DeviceInfo
from tega.errors import TegaError
from tega.haptics.motor_layout import find_layout
from tega.runtime.files.foreign_file import parse_json

if TYPE_CHECKING:
    from tega.recording.mcap_reader import McapReader


def time_column(field: str) -> str:
    """Return the column of a time in nanoseconds, which a table has in seconds.

    Example:
        >>> time_column("taken_ns")
        'taken_s'
    """
    return f"{field.removesuffix('_ns')}_s"


def list_columns(
    field: str, n: int, *, layout: str = "", channels: Sequence[str] = (), taken: Collection[str] = ()
) -> Sequence[str]:
    """Return the columns of a list of numbers.

    Args:
        field: Field that holds the list: ``channels`` of EMG, ``intensities`` of motors, or any other.
        n: Its numbers.
        layout: Layout of the motors.
        channels: Names of the EMG channels.
        taken: Names of the other columns.

    Example:
        >>> list_columns("channels", 2), list_columns("gains", 2), list_columns("intensities", 2)
        (['ch1', 'ch2'], ('gains_1', 'gains_2'), ('m0', 'm1'))
    """
    if field == "channels":
        return channel_columns(channels, n, taken)
    return motor_columns(layout, n) if field == "intensities" else _numbered(field, n)


def channel_columns(channels: Sequence[str], n: int, taken: Collection[str] = ()) -> list[str]:
    """Return a column for each EMG channel: its name, or its number where names are missing, repeated or taken."""
    names = list(channels) if len(channels) == n else [""] * n
    good = [bool(name) and names.count(name) == 1 and name not in taken for name in names]
    return [name if ok else f"ch{k}" for k, (name, ok) in enumerate(zip(names, good, strict=True), 1)]


@cache
def motor_columns(layout: str, n: int) -> tuple[str, ...]:
    """Return the columns of a layout's motors, by their numbers at the device; of an unknown layout by their order."""
    numbers = list(range(n))
    with suppress(TegaError):
        known = find_layout(layout).numbers.tolist()
        numbers = known if len(known) == n else numbers
    return tuple(f"m{number}" for number in numbers)


@cache
def _numbered(field: str, n: int) -> tuple[str, ...]:
    return tuple(f"{field}_{k}" for k in range(1, n + 1))


def emg_source(reader: McapReader) -> DeviceInfo | None:
    """Return the EMG source's description in a recording; ``None`` if it is missing or damaged."""
    sources: Mapping[str, str] = reader.metadata.get("sources", {})
    with suppress(msgspec.MsgspecError):
        return parse_json(sources.get("emg", ""), DeviceInfo)
    return None
