"""Open XDF recordings of the Lab Streaming Layer with pyxdf: a stream of EMG by its type or name, markers as events."""

from __future__ import annotations

import contextlib
import logging
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tega.errors import RecordingError, TegaError
from tega.runtime.files.tables.encoding import opened
from tega.runtime.files.tables.table import MOST_JUDGED, FileEvent, Reading, Table, in_one, judged_columns
from tega.runtime.lifecycle import require

_MOST_LISTED = 12


def open_xdf(path: Path, reading: Reading) -> Table:
    """Open a stream of EMG, its own stamps as its clock; refused where none, or several, can be the EMG."""
    pyxdf: Any = require("pyxdf", driver="emg-file", extra="formats")
    with _damage(path.name) as found:
        table = _open(pyxdf, path, reading)
    if found:
        table.notes.append(f"damaged in {len(found)} places, and read as far as possible: {found[0][:100]}")
    return table


@contextlib.contextmanager
def _damage(name: str) -> Iterator[list[str]]:
    """Keep pyxdf's log and warnings about a damaged file off the terminal; yield them."""
    found: list[str] = []
    log, handler = logging.getLogger("pyxdf"), logging.Handler(logging.ERROR)
    handler.emit = lambda record: found.append(record.getMessage())  # type: ignore[method-assign]
    propagated, log.propagate = log.propagate, False
    log.addHandler(handler)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield found
    except TegaError:
        raise
    except Exception as error:  # pyxdf raises whatever the bytes lead it to
        raise RecordingError(f"{name}: a damaged XDF file: {error}", "copy it again") from error
    finally:
        log.removeHandler(handler)
        log.propagate = propagated


def _open(pyxdf: Any, path: Path, reading: Reading) -> Table:
    with opened(path) as file:
        streams = [one for one in pyxdf.resolve_streams(file) if one.get("stream_id") is not None]
    chosen = _chosen(streams, reading.variable, path.name)
    marks = [one["stream_id"] for one in streams if _is_marks(one)]
    wanted = [chosen["stream_id"], *marks]
    with opened(path) as file:
        loaded, _ = pyxdf.load_xdf(file, select_streams=wanted, dejitter_timestamps=False, verbose=False)
    by_id = {one["info"]["stream_id"]: one for one in loaded}
    stream = by_id.get(chosen["stream_id"])
    samples = np.asarray(stream["time_series"]) if stream is not None else np.empty((0, 0))
    if stream is None or samples.dtype.kind not in "iuf" or samples.ndim != 2 or not len(samples):
        raise RecordingError(
            f"{path.name}: the stream {chosen.get('name')!r} holds no sample", "record it again"
        )
    labels, units = _labels(stream["info"], samples.shape[1])
    columns = judged_columns(labels, samples[:MOST_JUDGED].astype(np.float64), units=units)
    if str(chosen.get("type", "")).lower() in {"emg", "exg"} and not any(
        c.holds == "channel" for c in columns
    ):
        for column in columns:
            column.holds = "channel" if column.why != "name" else column.holds
    table = Table(path.name, "XDF", columns, in_one(samples))
    table.times_s = np.asarray(stream["time_stamps"], np.float64)
    rate_hz = float(stream["info"]["nominal_srate"][0])
    table.rate_hz, table.rate_from = (rate_hz, "its stream's header") if rate_hz > 0 else (None, "")
    table.events = _events([by_id[k] for k in marks if k in by_id], float(table.times_s[0]))
    others = len(streams) - 1 - len(marks)
    table.notes += [f'the EMG is the stream "{chosen.get("name", "")}"'] if others else []
    return table


def _chosen(streams: Sequence[dict[str, Any]], variable: str, file: str) -> dict[str, Any]:
    named = [one for one in streams if variable in {one.get("name"), str(one["stream_id"])}]
    numeric = [one for one in streams if not _is_marks(one)]
    typed = [one for one in numeric if str(one.get("type", "")).lower() == "emg"]
    like = [
        one for one in numeric
        if any(word in f"{one.get('name')} {one.get('type')}".lower() for word in ("emg", "exg", "myo"))
    ]  # fmt: skip
    for found in [named] if variable != "emg" else [named, typed, like, numeric]:
        if len(found) == 1:
            return found[0]
        if found:
            break
    there = (f"{one['stream_id']} {one.get('name')!r} ({one.get('type')})" for one in streams[:_MOST_LISTED])
    text = "EMG by its type or name" if variable == "emg" else f"called {variable!r}"
    raise RecordingError(
        f"{file}: no single stream is {text}",
        f"it has: {', '.join(there) or 'none'}; give the number of one as the variable",
    )


def _is_marks(stream: dict[str, Any]) -> bool:
    return stream.get("channel_format") == "string" or str(stream.get("type", "")).lower() == "markers"


def _labels(info: dict[str, Any], n: int) -> tuple[list[str], list[str]]:
    """Return the channels' labels and units, as the stream describes them; empty where it does not."""
    try:
        channels = info["desc"][0]["channels"][0]["channel"]
        labels = [str((one.get("label") or [""])[0]) for one in channels]
        units = [str((one.get("unit") or [""])[0]) for one in channels]
    except (KeyError, IndexError, TypeError, AttributeError):
        return [], []
    units = ["uV" if unit.lower() in {"microvolts", "microvolt"} else unit for unit in units]
    return (labels, units) if len(labels) == n else ([], [])


def _events(streams: Sequence[dict[str, Any]], zero_s: float) -> list[FileEvent]:
    events = [
        FileEvent(t_s=float(t) - zero_s, text=" ".join(str(word) for word in np.atleast_1d(row)))
        for stream in streams
        for t, row in zip(stream["time_stamps"], stream["time_series"], strict=False)
    ]
    return sorted(events, key=lambda event: event.t_s)
