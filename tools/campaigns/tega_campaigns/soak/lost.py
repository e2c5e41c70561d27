"""What is missing in a recording, at its end and on the way, and where it says that the arm was led."""

from __future__ import annotations

import math
from pathlib import Path

import msgspec

from tega.recording.mcap_reader import McapReader

__all__ = ["KeptCounts", "check"]

# Ticks come 30 times a second.
LEAST_GAP_S = 0.2
# Each of the loop's vest ticks leaves one of these, so that a gap in them is a gap in the recording.
_TICKS = frozenset({"/vest/frame", "/run/skipped"})
_ARM = "/arm/target"
# The limits that an arm has as they come, written down here again.
_SPEED_M_S = 0.25
_LOW_M, _HIGH_M = (0.30, -0.40, 0.03), (0.70, 0.40, 0.70)
# After a longer silence the arm was let go, and a target begins where the arm is.
_LET_GO_NS = 250_000_000
_ROUNDING = 1e-6
_RATES_HZ = {"image": 60.0, "frames": 333.0, "bus": 333.0, "samples": 60.0}


class KeptCounts(msgspec.Struct, frozen=True):
    """What a recording holds.

    Attributes:
        newest_ns: Time of day of the newest record of the loop.
        gaps: Times of day, ns, from one such record to the next where that is longer than ``LEAST_GAP_S``.
        dropped_s: The records that did not fit, of the stream that lost most, in seconds of it.
        cut: Why reading ended early, ``""`` where it did not.
        arm_targets: How many targets the arm was given.
        arm_over: How many of them lie outside of the workspace, or farther from the last than its speed
            allows.
    """

    file: str
    newest_ns: int
    gaps: list[tuple[int, int]]
    dropped_s: float
    cut: str
    arm_targets: int
    arm_over: int


def check(path: Path) -> KeptCounts:
    """Read a recording from its beginning to its end."""
    reader = McapReader(path)
    newest_ns = last_ns = 0
    gaps: list[tuple[int, int]] = []
    dropped: dict[str, int] = {}
    arm = _Led()
    wanted = _TICKS | {"/recorder/status", _ARM}
    for message in reader.messages(lambda topic: topic in wanted):
        if message.topic == "/recorder/status":
            dropped = dict(zip(message.value.dropped_topics, message.value.dropped_counts, strict=True))
            continue
        if message.topic == _ARM:
            at = message.value.pose.position
            arm.observe(message.log_ns, (at.x, at.y, at.z))
            continue
        if (
            message.topic not in _TICKS
        ):  # the reader gives every record, those that were not wanted without content
            continue
        newest_ns = max(newest_ns, message.log_ns)
        if last_ns and message.log_ns - last_ns > LEAST_GAP_S * 1e9:
            gaps.append((last_ns, message.log_ns))
        last_ns = message.log_ns
    dropped |= {name: int(n) for name, n in reader.metadata.get("dropped", {}).items()}
    dropped_s = max(
        (n / _RATES_HZ.get(topic.rsplit("/", 1)[-1], 30.0) for topic, n in dropped.items()), default=0.0
    )
    return KeptCounts(path.name, newest_ns, gaps, dropped_s, reader.cut, arm.n, arm.n_over)


class _Led:
    """Counts the targets that an arm was given, and those beyond a limit."""

    def __init__(self) -> None:
        self.n = self.n_over = 0
        self._last: tuple[int, tuple[float, float, float]] | None = None

    def observe(self, t_ns: int, place: tuple[float, float, float]) -> None:
        over = any(
            not low - _ROUNDING <= at <= high + _ROUNDING
            for low, at, high in zip(_LOW_M, place, _HIGH_M, strict=True)
        )
        if self._last is not None and 0 < (away_ns := t_ns - self._last[0]) <= _LET_GO_NS:
            over |= math.dist(place, self._last[1]) > _SPEED_M_S * away_ns / 1e9 + _ROUNDING
        self._last = t_ns, place
        self.n += 1
        self.n_over += over
