"""Play bursts on one motor, find their onsets in the recorded sound, and make the motor's record."""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.config.calibration.folder import device_name
from tega.config.calibration.records import OnsetRecord
from tega.devices.base import DeviceInfo, StampingVest, VestSink
from tega.errors import CalibrationError, DeviceUnavailableError
from tega.haptics import Layout
from tega.runtime.clock import Clock
from tega.setup.calibration.identify import light_motor
from tega_bench.vest_latency.detect import Onsets, find_onsets
from tega_bench.vest_latency.log import ClockMap, OnsetLog, by_clicks

BURST_S: Final = 0.5
# Long enough for a motor to stand still again, uneven so that nothing periodic keeps step.
_REST_S: Final = (0.9, 1.3)
_BEFORE_S: Final = 0.8


class OnsetFound(NamedTuple):
    """Onsets found in a recording, and how it lies in time."""

    clock: ClockMap
    onsets: Onsets


def watched_vest(vest: VestSink) -> VestSink:
    """Return a vest; ``DeviceUnavailableError`` unless it reports when a frame leaves, as delays need."""
    if not vest.info.live or not isinstance(vest, StampingVest):
        raise DeviceUnavailableError(
            f"{vest.info.driver}: does not report when a frame leaves, so no delay can be measured",
            "use bhaptics-player, bhaptics-ble or hid-vest, or let your driver have handed_over()",
        )
    return vest


def play_bursts(
    vest: VestSink,
    motor: int,
    *,
    layout: Layout,
    percent: int,
    bursts: int,
    clock: Clock,
    stop: Callable[[], bool] = lambda: False,
    reported: Callable[[int, int], None] = lambda _done, _total: None,
) -> tuple[list[float], int]:
    """Drive one motor again and again, with rests; the vest is silent afterwards whatever happens.

    The vest is open, and reports when a frame leaves; every frame passes its own limits, and a burst that
    they lower is not counted. ``stop`` is asked all the time whether to end early, which raises
    ``KeyboardInterrupt``; ``reported`` gets the number of finished bursts and the total. Returns when the
    first frame of each burst left, seconds on the monotonic clock, and how many did not leave as wanted.
    ``DeviceUnavailableError`` if the vest was not reached all the time.
    """
    rests, left_s, unsent = random.Random(0), list[float](), 0
    leaving: Any = watched_vest(vest)
    sent: list[int] = []
    begin_ns = clock.now_ns() + round(_BEFORE_S * 1e9)
    for k in range(bursts):
        reported(k, bursts)
        clock.sleep_until(begin_ns)
        if stop():
            raise KeyboardInterrupt
        leaving.handed_over()  # of the burst before
        sent.clear()
        light_motor(
            vest,
            motor,
            layout=layout,
            percent=percent,
            duration_s=BURST_S,
            clock=clock,
            stop=stop,
            reported=lambda frame: sent.append(int(frame.intensities.max())),
        )
        first = next((at_ns / 1e9 for t_ns, _, at_ns in leaving.handed_over() if t_ns == 0), None)
        if first is None or min(sent, default=0) < percent:
            unsent += 1
        else:
            left_s.append(first)
        begin_ns = clock.now_ns() + round(rests.uniform(*_REST_S) * 1e9)
    reported(bursts, bursts)
    # The last one has to be heard to its end.
    clock.sleep_until(begin_ns)
    return left_s, unsent


def found_in(samples: NDArray[np.float64], rate_hz: float, log: OnsetLog) -> OnsetFound:
    """Find the onsets of a log's bursts in a recording; ``samples`` is float64 (n,), -1 to 1.

    ``CalibrationError`` if nothing shows how log and recording lie in time; ``InvalidValueError`` if the
    clicks are not in the recording, or its rate is too low.
    """
    if log.clicks_s:
        clock = by_clicks(samples, rate_hz, log.clicks_s, source=log.clicks)
    elif log.clock is not None:
        clock = log.clock
    else:
        raise CalibrationError(
            "nothing says how log and recording lie in time: there are no clicks in the log",
            "make it again with --sync keys",
        )
    commands_s = [at_s - clock.began_s for at_s in log.bursts_s]
    return OnsetFound(clock, find_onsets(samples, clock.rate_hz, commands_s, on_s=log.on_s))


def record_of(found: OnsetFound, log: OnsetLog) -> OnsetRecord:
    """Make the record of a measurement; a ``CalibrationError`` without a result, which gives the reason."""
    onsets = found.onsets
    if onsets.problem:
        raise CalibrationError(f"motor {log.motor}: no result: {onsets.problem}", onsets.hint)
    delays_ms, halves_ms = 1e3 * onsets.delays_s, 1e3 * onsets.halves_s
    low, middle, high, most = np.percentile(delays_ms, (25, 50, 75, 100))
    left_out = onsets.left_out() | ({"not sent as wanted": log.unsent} if log.unsent else {})
    return OnsetRecord(
        device=log.device,
        driver=log.driver,
        made=log.made,
        notes=log.notes,
        layout=log.layout,
        motor=log.motor,
        percent=log.percent,
        onset_ms=round(float(middle), 1),
        middle_half_ms=(round(float(low), 1), round(float(high), 1)),
        worst_ms=round(float(most), 1),
        half_strength_ms=round(float(np.median(halves_ms)), 1),
        bursts=len(onsets.bursts) + log.unsent,
        used=len(delays_ms),
        left_out=tuple(f"{n}: {why}" for why, n in sorted(left_out.items())),
        spin_hz=round(onsets.spin_hz, 1),
        clock=found.clock.how,
        clock_uncertainty_ms=round(found.clock.uncertainty_ms, 1),
    )


def log_of(
    info: DeviceInfo, bursts_s: list[float], clicks_s: list[float], *, unsent: int, **facts: Any
) -> OnsetLog:
    """Make the log of some bursts, times counted from the first; ``DeviceUnavailableError`` if no burst left.

    ``bursts_s`` is when each left, seconds on the monotonic clock, ``clicks_s`` likewise; ``unsent`` counts
    bursts that did not leave as wanted. ``facts`` are other attributes of
    :class:`tega_bench.vest_latency.log.OnsetLog`.
    """
    if not bursts_s:
        raise DeviceUnavailableError(
            f"{info.label}: none of the {unsent} bursts left as wanted",
            "; ".join(info.notes) or "lower --percent, or look at the vest's limit",
        )
    zero_s = min(bursts_s + clicks_s)
    return OnsetLog(
        driver=info.driver,
        device=device_name(info),
        on_s=BURST_S,
        bursts_s=tuple(round(t - zero_s, 6) for t in bursts_s),
        clicks_s=tuple(round(t - zero_s, 6) for t in clicks_s),
        unsent=unsent,
        notes=info.notes,
        **facts,
    )
