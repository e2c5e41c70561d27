"""Check devices of each kind against their contracts: cameras and amplifiers, input devices, trackers and arms."""

from __future__ import annotations

import hashlib
import itertools
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from tega.arm.frames import FRAMES
from tega.arm.pose import ArmCommand, StampedPose
from tega.devices import base
from tega.errors import DeviceUnavailableError


def rule(holds: bool, text: str) -> None:  # noqa: FBT001  # an assertion that survives python -O
    """Break off where a rule does not hold; the message of the ``AssertionError`` is the rule."""
    if not holds:
        raise AssertionError(text)


def refuses(call: Callable[[], object], error: type[Exception], text: str) -> None:
    """Break off where a call does not raise this error; the ``AssertionError`` says so."""
    try:
        call()
    except error:
        return
    raise AssertionError(f"{text} raises {error.__name__}")


# A recording read by a contract check is expected to end before this many reads.
_MOST_READS = 100_000


def check_source(source: base.TactileSource | base.EmgSource, most_items: int) -> None:
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
    rule(
        [(item.t_ns, _content(item)) for item in again] == [(item.t_ns, _content(item)) for item in first],
        "opened again, a recording starts from its beginning",
    )
    if isinstance(source, base.SkippingSource):
        _check_skip(source)


def _check_skip(source: base.SkippingSource) -> None:
    """Check that a recording can pass over frames."""
    with source:
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


def _read_all(source: base.TactileSource | base.EmgSource, most_items: int) -> list[Any]:
    items: list[Any] = []
    content: list[bytes] = []
    for _ in range(_MOST_READS):
        if source.ended or (source.info.live and len(items) >= most_items):
            break
        item = source.read(1.0)
        if item is not None:
            of_kind = base.TactileFrame if source.info.kind == "tactile" else base.EmgChunk
            rule(isinstance(item, of_kind), f"read returns a tega.devices.{of_kind.__name__}, or None")
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


_TRACKED_S, _POLL_S = 3.0, 0.01
_STILL_M = 0.002


def check_input(source: base.InputSource, _most_items: int) -> None:
    """Check an operator's input device."""
    with source:
        for _ in range(100):
            state = source.state()
            rule(type(state) is base.InputReading and type(state.t_ns) is int, "state gives an InputState")
            rule(len(state.motion) == 6, "motion has six axes")
            rule(all(-1.0 <= share <= 1.0 for share in state.motion), "motion lies within -1 and 1")
            rule(isinstance(state.held, frozenset), "held is a frozenset")
            rule(
                state.live or not (any(state.motion) or state.held),
                "without data nothing moves and nothing is held",
            )
            events = list(source.events())
            rule(all(isinstance(e, base.InputEvent) for e in events), "events gives InputEvents")
            numbers = [e.seq for e in events]
            rule(numbers == sorted(set(numbers)), "the numbers of events rise")
    refuses(source.events, DeviceUnavailableError, "asking a closed device for events")


def check_tracker(tracker: base.Tracker, most_items: int) -> None:
    """Check a tracker of the forearm; of a live one so many poses are looked at."""
    rule(tracker.frame in FRAMES, f"frame is one of {', '.join(FRAMES)}")
    poses: list[StampedPose] = []
    with tracker:
        for _ in range(round(_TRACKED_S / _POLL_S)):
            poses += tracker.read(time.monotonic_ns())
            rule(isinstance(tracker.problem, str), "problem is text")
            if len(poses) >= most_items:
                break
            time.sleep(_POLL_S)
    rule(bool(poses), "an open tracker gives poses")
    rule(all(type(p) is StampedPose and type(p.t_ns) is int for p in poses), "poses are StampedPoses")
    rule(all(len(p.position_m) == 3 and len(p.quaternion_xyzw) == 4 for p in poses), "a place and a turn")
    times = [p.t_ns for p in poses]
    rule(times == sorted(times), "t_ns never decreases")


def check_arm(arm: base.ArmDriver, _most_items: int) -> None:
    """Check an arm without taking control of it: it reports its position, and does not move."""
    nothing = np.zeros(3)
    with arm:
        first = last = arm.measured()
        for number in range(round(_TRACKED_S / _POLL_S)):
            command = ArmCommand(time.monotonic_ns(), "idle", "contract", None, nothing, nothing, 0)
            arm.follow(command)
            last = arm.measured()
            first = first or last
            if last is not None and first is not None and number > 50 and last.t_ns > first.t_ns:
                break
            time.sleep(_POLL_S)
        rule(type(last) is StampedPose, "measured gives a StampedPose")
        assert first is not None
        assert last is not None
        rule(last.t_ns > first.t_ns, "an open arm reports new positions")
        moved_m = float(np.linalg.norm(np.subtract(first.position_m, last.position_m)))
        rule(moved_m < _STILL_M, "without a target it stays where it is")
        rule(arm.phase == "ready", "an arm without a command is ready")
        rule(arm.problem == "", "an arm that is well has no problem")
        rule(arm.health.rate_hz > 0, "it says how its loop runs")
    refuses(
        partial(arm.follow, ArmCommand(0, "idle", "contract", None, nothing, nothing, 0)),
        DeviceUnavailableError,
        "leading a closed arm",
    )
