"""Check fingertip cameras and amplifiers, live or recorded, against the contract of a source."""

from __future__ import annotations

import hashlib
import itertools
from typing import Any

import numpy as np

from tega.devices.base import EmgSource, SkippingSource, TactileSource
from tega.setup.contract.rule import rule

# A recording read by a contract check is expected to end before this many reads.
_MOST_READS = 100_000


def check_source(source: TactileSource | EmgSource, most_items: int) -> None:
    """Check a camera or an amplifier: so many items of a live one, a recording to its end."""
    with source:
        first = _read_all(source, most_items)
        info = source.info
        rule(bool(first), "an open source delivers something")
        times = [item.t_ns for item in first]
        rule(all(isinstance(t, int) for t in times), "t_ns is an int")
        rule(times == sorted(times), "t_ns never decreases")
        rule(info.rate_hz is not None and info.rate_hz > 0, "an open source knows its rate")
        if info.kind == "tactile":
            _check_frames(first, live=info.live)
        else:
            _check_chunks(first, len(info.channels))
        if info.live:
            return
        rule(source.ended, "a recording that was read to its end says so")
        rule(source.read(0.0) is None, "nothing comes after the end")
        count = len(first) if info.kind == "tactile" else sum(len(c.samples) for c in first)
        rule(info.n_items == count, "n_items is the number of items delivered")
    with source:
        again = _read_all(source, most_items)
    rule([item.t_ns for item in again] == times, "opened again, a recording starts from its beginning")


def check_skip(source: SkippingSource) -> None:
    """Check that a recording can pass over frames."""
    with source:
        if source.info.live:
            return
        frames = _read_all(source, 0)
    if len(frames) < 3:
        return
    with source:
        source.read(0.0)
        source.skip(1)
        third = source.read(0.0)
        rule(third is not None and third.seq == frames[2].seq, "skip(1) passes over exactly one frame")
        rule(third is not None and np.array_equal(third.image, frames[2].image), "and not over its content")
        source.skip(_MOST_READS)
        rule(source.read(0.0) is None, "skipping past the end reaches the end")


def _read_all(source: TactileSource | EmgSource, most_items: int) -> list[Any]:
    items: list[Any] = []
    content: list[bytes] = []
    for _ in range(_MOST_READS):
        if source.ended or (source.info.live and len(items) >= most_items):
            break
        item = source.read(1.0)
        if item is not None:
            items.append(item)
            content.append(_content(item))
    rule([_content(item) for item in items] == content, "an item stays as it was when later ones are read")
    return items


def _content(item: Any) -> bytes:
    array = item.image if hasattr(item, "image") else item.samples
    return bytes(hashlib.blake2b(array.tobytes()).digest())


def _check_frames(frames: list[Any], *, live: bool) -> None:
    for frame in frames:
        image = frame.image
        rule(isinstance(image, np.ndarray) and image.dtype == np.uint8, "image is uint8")
        rule(image.ndim == 3 and image.shape[2] == 3, "image is (height, width, 3)")
        rule(image.shape == frames[0].image.shape, "all images have one size")
        rule(bool(frame.name), "a frame has a name")
    numbers = [frame.seq for frame in frames]
    # A live camera asked before its next picture is there may give the newest one again, under its own number.
    rule(all(b >= a for a, b in itertools.pairwise(numbers)), "seq never falls")
    rule(live or len(set(numbers)) == len(numbers), "a recording gives every frame once")


def _check_chunks(chunks: list[Any], n_channels: int) -> None:
    next_index = 0
    for chunk in chunks:
        samples = chunk.samples
        rule(samples.dtype == np.float64 and samples.ndim == 2, "samples are float64 (n, channels)")
        rule(samples.shape[1] == n_channels, "there is one column per channel of info.channels")
        rule(len(samples) > 0, "a chunk holds at least one sample")
        rule(chunk.first_index >= next_index, "first_index never goes back")
        next_index = chunk.first_index + len(samples)
