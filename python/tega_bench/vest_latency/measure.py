"""Play bursts on one motor, find their onsets in the recorded sound, and make the motor's record."""

from __future__ import annotations

import random
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple

import click
import numpy as np
from numpy.typing import NDArray

from tega.config import DEFAULT_LAYOUT, SessionConfig
from tega.config.calibration.folder import device_name
from tega.config.calibration.records import OnsetRecord, utc_now
from tega.devices.base import StampingVest, VestSink
from tega.errors import CalibrationError, ConfigError, DeviceUnavailableError
from tega.haptics import Layout
from tega.loop.worn_vest import dose_file, worn_vest
from tega.runtime.clock import Clock, SystemClock
from tega.runtime.keys import Keys
from tega.safety.stop import CtrlC
from tega.setup.calibration.identify import light_motor, motor_place
from tega.ui.cli.options import progress_bar
from tega_bench.vest_latency.detect import find_onsets
from tega_bench.vest_latency.log import OnsetLog, by_clicks, write_log, write_wav
from tega_bench.vest_latency.microphone import Microphone, Speaker

BURST_S: Final = 0.5
# Long enough for a motor to stand still again, uneven so that nothing periodic keeps step.
_REST_S: Final = (0.9, 1.3)
_BEFORE_S: Final = 0.8


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
    # The last one has to be recorded to its end.
    clock.sleep_until(begin_ns)
    return left_s, unsent


def record_of(samples: NDArray[np.float64], rate_hz: float, log: OnsetLog) -> OnsetRecord:
    """Find the onsets of a log's bursts in its recording, float64 (n,), -1 to 1, and make the motor's record.

    ``CalibrationError`` without a result, with the reason, or if nothing shows how log and recording lie in
    time; ``InvalidValueError`` if the clicks are not in the recording, or its rate is too low.
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
    onsets = find_onsets(samples, clock.rate_hz, commands_s, on_s=log.on_s)
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
        clock=clock.how,
        clock_uncertainty_ms=round(clock.uncertainty_ms, 1),
    )


class Bursts(NamedTuple):
    """How bursts are played on the vest of some settings, and what makes the clicks that synchronize."""

    config: SessionConfig
    percent: int
    bursts: int
    sync: Literal["keys", "speaker"]

    @property
    def layout(self) -> Layout:
        """Layout of the vest."""
        return self.config.vest.layout or DEFAULT_LAYOUT[self.config.session.preset]


def measure_motors(
    wanted: Bursts, motors: tuple[int, ...], microphone: str | None, keep: Path | None
) -> Iterator[OnsetRecord]:
    """Play and record the bursts of each motor; recording and log are kept in the folder ``keep``, if any."""
    for motor in motors:
        if len(motors) > 1 and sys.stdin.isatty():
            text = f"Tape the microphone onto motor {motor} ({motor_place(motor, wanted.layout)}), then Enter"
            click.prompt(text, default="", show_default=False, prompt_suffix=" ", err=True)
        with Microphone(microphone) as ear:
            log = play_log(wanted, motor)
            samples = ear.received()
        if keep is not None:
            name = f"{log.made:%Y%m%d-%H%M%S}-motor{motor:02}"
            write_wav(keep / f"{name}.wav", samples, ear.rate_hz)
            write_log(log, keep / f"{name}.json")
        yield record_of(samples, ear.rate_hz, log)


def play_log(wanted: Bursts, motor: int) -> OnsetLog:
    """Play the bursts of a motor, clicks before and after; ``DeviceUnavailableError`` if none left as wanted."""
    config = wanted.config
    if config.vest.driver is None:
        raise ConfigError("no vest: vest.driver is not set", "for example --set vest.driver=bhaptics-player")
    made, worn = utc_now(), worn_vest(config.vest, dose_file(config.calibration))
    with CtrlC() as stop, _clicker(wanted.sync, stop) as clicks, worn as vest:
        opened: Any = watched_vest(vest)
        clicks_s = clicks()
        with progress_bar() as displayed:
            bursts_s, unsent = play_bursts(
                opened,
                motor,
                layout=wanted.layout,
                percent=wanted.percent,
                bursts=wanted.bursts,
                clock=SystemClock(),
                stop=stop,
                reported=lambda done, total: displayed(f"motor {motor}", done, total),
            )
        clicks_s += clicks()
        info = opened.info
    if not bursts_s:
        raise DeviceUnavailableError(
            f"{info.label}: none of the {unsent} bursts left as wanted",
            "; ".join(info.notes) or "lower --percent, or look at the vest's limit",
        )
    zero_s = min(bursts_s + clicks_s)
    return OnsetLog(
        made=made,
        driver=info.driver,
        device=device_name(info),
        layout=wanted.layout,
        motor=motor,
        percent=wanted.percent,
        on_s=BURST_S,
        bursts_s=tuple(round(t - zero_s, 6) for t in bursts_s),
        clicks_s=tuple(round(t - zero_s, 6) for t in clicks_s),
        clicks=wanted.sync,
        unsent=unsent,
        notes=info.notes,
    )


_CLICKS = 4
_CLICK_APART_S = (0.37, 0.61, 0.83, 0.53)


@contextmanager
def _clicker(sync: str, stop: Callable[[], bool]) -> Iterator[Callable[[], list[float]]]:
    """Give what makes a few clicks and returns their times, seconds on the monotonic clock."""
    if sync == "speaker":
        with Speaker() as speaker:

            def clicked() -> list[float]:
                times = []
                for apart_s in _CLICK_APART_S:
                    times.append(speaker.click())
                    time.sleep(apart_s)
                return times

            yield clicked
        return
    with Keys() as keys:

        def struck() -> list[float]:
            text = f"Strike the space bar hard {_CLICKS} times, not evenly, beside the microphone: "
            click.echo(text, nl=False, err=True)
            times: list[float] = []
            while len(times) < _CLICKS:
                if stop():
                    raise KeyboardInterrupt
                pressed = keys.read()
                times += [time.monotonic()] * pressed.count(" ")
                click.echo("·" * pressed.count(" "), nl=False, err=True)
                time.sleep(0.001)
            click.echo(" heard", err=True)
            return times

        yield struck
