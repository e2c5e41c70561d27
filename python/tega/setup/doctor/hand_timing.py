"""Measure the timing and the cost of the hand's loop."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import msgspec
import numpy as np

if TYPE_CHECKING:
    from tega.devices.hand.allegro import Allegro


_PERCENTILES = (50, 99, 99.9, 100)


class LoopTiming(msgspec.Struct, frozen=True, kw_only=True):
    """Timing of the hand's loop, as measured once.

    ``rate_hz`` counts sets of positions that were answered. ``period_ms`` is from one answer to the next,
    ``answer_ms`` from taking the frames to having sent the torques, percentiles 50, 99, 99.9 and 100.
    ``cpu_percent`` is the load of one core by the hand's loop alone. ``incomplete`` sets missed a finger's
    frame, ``late`` gaps were longer than 9 ms, at ``silences`` the motors went off, ``unsent`` frames the
    adapter did not take.
    """

    seconds: float
    rate_hz: float
    period_ms: tuple[float, ...]
    answer_ms: tuple[float, ...]
    cpu_percent: float
    incomplete: int
    late: int
    silences: int
    unsent: int


def time_loop(hand: Allegro, *, seconds: float) -> LoopTiming:
    """Watch an open hand for up to 45 s; its level changes every second.

    Raises ``DeviceUnavailableError`` if the hand had to be let go.
    """
    start_ns, cpu_s, before = time.monotonic_ns(), hand.cpu_s, hand.state().counts
    level = 1
    while (now_ns := time.monotonic_ns()) - start_ns < seconds * 1e9:
        level = 1 + (now_ns - start_ns) // 1_000_000_000 % 5
        hand.step(level)
        time.sleep(0.01)
    spent_s = (now_ns - start_ns) * 1e-9
    cpu_s, after = hand.cpu_s - cpu_s, hand.state().counts
    cycles = (
        np.array([c for c in hand.cycles if start_ns <= c[0] <= now_ns], np.float64).reshape(-1, 2) * 1e-6
    )
    periods = np.diff(cycles[:, 0]) if len(cycles) > 1 else np.zeros(1)
    answers = cycles[:, 1] if len(cycles) else np.zeros(1)
    return LoopTiming(
        seconds=spent_s,
        rate_hz=(after.sets - before.sets) / spent_s,
        period_ms=tuple(float(p) for p in np.percentile(periods, _PERCENTILES)),
        answer_ms=tuple(float(p) for p in np.percentile(answers, _PERCENTILES)),
        cpu_percent=100 * cpu_s / spent_s,
        incomplete=after.incomplete - before.incomplete,
        late=after.late - before.late,
        silences=after.silences - before.silences,
        unsent=hand.n_unsent,
    )
