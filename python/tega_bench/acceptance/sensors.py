"""Accept a fingertip's camera or an EMG amplifier: rate, jitter, age, saturation, one least touch, and reopening."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.devices.base import optional
from tega_bench.acceptance.report import AcceptanceGuide, AcceptanceStep, spread_ms

_WATCH_S: Final = 5.0
_TOUCH_S: Final = 3.0
_SLOW: Final = 0.9
_SATURATED: Final = 0.2
"""Share of a picture's values at 255 above which it is overexposed."""
_RISE: Final = 1.5
"""By how much a lightly tensed muscle has to exceed rest, a ratio of spreads."""
_PICTURE_RISE: Final = 1.3
"""By how much a touched gel has to differ from rest, a ratio to what rest differs from itself."""


class _Arrivals(NamedTuple):
    """Items of a source over a while: arrival times, their own times, both s; how many samples; the values."""

    arrived_s: NDArray[np.float64]
    stamped_s: NDArray[np.float64]
    n: int
    gaps: int
    values: list[NDArray[Any]]


def _watch(source: Any, seconds: float, values_of: Callable[[Any], NDArray[Any]]) -> _Arrivals:
    arrived: list[float] = []
    stamped: list[float] = []
    values: list[NDArray[Any]] = []
    n = gaps = 0
    expected: int | None = None
    until_s = time.monotonic() + seconds
    while (left_s := until_s - time.monotonic()) > 0:
        item = source.read(min(left_s, 0.2))
        if item is None:
            continue
        arrived.append(time.monotonic())
        stamped.append(item.t_ns * 1e-9)
        taken = values_of(item)
        first = getattr(item, "first_index", getattr(item, "seq", 0))
        gaps += expected is not None and first != expected
        length = len(item.samples) if hasattr(item, "samples") else 1
        expected = first + length
        n += length
        values.append(taken)
    return _Arrivals(np.array(arrived), np.array(stamped), n, gaps, values)


def _rate_step(seen: _Arrivals, agreed_hz: float | None, measured_hz: float | None) -> AcceptanceStep:
    if seen.n < 2 or len(seen.stamped_s) < 2:
        text = f"{seen.n} items came in {_WATCH_S:g} s"
        return AcceptanceStep(
            name="rate", status="failed", said=text, todo="look at power, cable and the driver's page"
        )
    spans = np.diff(seen.stamped_s)
    rate_hz = measured_hz or (len(seen.stamped_s) - 1) / max(float(spans.sum()), 1e-9)
    slow = agreed_hz is not None and abs(rate_hz / agreed_hz - 1) > 1 - _SLOW
    agreed = "" if agreed_hz is None else f", {agreed_hz:g} were agreed"
    return AcceptanceStep(
        name="rate",
        status="look" if slow or seen.gaps else "passed",
        said=f"{rate_hz:.1f} a second for {_WATCH_S:g} s{agreed}; {seen.gaps} gaps in the numbers",
        todo="spread the devices over more USB controllers, or ask for less" if slow or seen.gaps else "",
        measured={
            "rate_hz": round(rate_hz, 2),
            "between_p50_ms": _ms(spans, 50),
            "between_p99_ms": _ms(spans, 99),
            "gaps_count": float(seen.gaps),
        },
    )


def _age_step(seen: _Arrivals) -> AcceptanceStep:
    ages = seen.arrived_s - seen.stamped_s
    return AcceptanceStep(
        name="latency",
        status="passed" if len(ages) else "failed",
        said="from the driver's time stamp until it was read here; without the device's delay before its stamp",
        measured=spread_ms("age", 1e3 * ages),
    )


def _ms(values_s: NDArray[np.float64], percentile: float) -> float:
    return round(1000 * float(np.percentile(values_s, percentile)), 2)


def accept_camera(source: Any, guide: AcceptanceGuide) -> Iterator[AcceptanceStep]:
    """Accept an open fingertip's camera."""
    seen = _watch(source, _WATCH_S, _small)
    yield _rate_step(seen, source.info.rate_hz, None)
    yield _age_step(seen)
    if not seen.values:
        return
    bright = float(np.mean([np.mean(v >= 255) for v in seen.values[-5:]]))
    yield AcceptanceStep(
        name="limits",
        status="look" if bright > _SATURATED else "passed",
        said=f"{100 * bright:.1f} % of the values are at the converter's end",
        measured={"saturated_percent": round(100 * bright, 2)},
    )
    rest = np.mean(np.array(seen.values[-10:], np.float64), axis=0)
    guide.say("Touch the gel with one finger, as lightly as you can, and hold it.")
    ready = guide.ask("Do you hold it? Press Enter, and go on holding for three seconds.")
    touched = _watch(source, _TOUCH_S, _small)
    noise = max(float(np.mean([np.abs(v - rest).mean() for v in seen.values[-10:]])), 1e-6)
    moved = max((float(np.abs(v - rest).mean()) for v in touched.values), default=0.0)
    yield _touch_step(moved / noise, _PICTURE_RISE, "the picture's change", {"Did you hold it?": ready})


def _small(frame: Any) -> NDArray[Any]:
    return np.asarray(frame.image[::4, ::4], np.float32)


def accept_amplifier(source: Any, guide: AcceptanceGuide) -> Iterator[AcceptanceStep]:
    """Accept an open EMG amplifier."""
    guide.say("Electrodes on the forearm, board and laptop on batteries. Rest your arm.")
    guide.ask("Does it rest? Press Enter, and rest for five seconds.")
    seen = _watch(source, _WATCH_S, lambda chunk: chunk.samples)
    yield _rate_step(seen, source.info.rate_hz, optional(source, "measured_hz"))
    yield _age_step(seen)
    if not seen.values:
        return
    rest = np.concatenate(seen.values)
    limits = optional(source, "limits")
    ends = 0.0 if limits is None else float(np.mean((rest <= limits[0]) | (rest >= limits[1])))
    yield AcceptanceStep(
        name="limits",
        status="look" if ends > 0 else "passed",
        said=f"{100 * ends:.2f} % of the samples at rest are at the converter's ends"
        + ("; the converter's ends are not known" if limits is None else ""),
        todo="look at electrodes, reference and gain" if ends > 0 else "",
        measured={"clipped_percent": round(100 * ends, 3)},
    )
    guide.say("Now make a fist, as lightly as you can, and hold it.")
    ready = guide.ask("Do you hold it? Press Enter, and go on holding for three seconds.")
    held = _watch(source, _TOUCH_S, lambda chunk: chunk.samples)
    spread = np.maximum(np.std(rest, axis=0), 1e-12)
    rises = np.std(np.concatenate(held.values), axis=0) / spread if held.values else np.zeros(1)
    yield _touch_step(float(rises.max()), _RISE, "the signal's spread", {"Did you hold it?": ready})


def _touch_step(ratio: float, wanted: float, subject: str, answers: dict[str, str]) -> AcceptanceStep:
    felt = ratio >= wanted
    return AcceptanceStep(
        name="least",
        status="passed" if felt else "look",
        said=f"{subject} rose to {ratio:.1f} times that of rest; {wanted:g} are needed to count as seen",
        todo=""
        if felt
        else "nothing was touched or tensed, or the sensor does not see so little: try it firmer",
        measured={"rise_ratio": round(ratio, 2)},
        answers=answers,
    )


def reopen_step(source: Any) -> AcceptanceStep:
    """Close a source, open it again, and wait for the first item: a program that ended must leave it usable."""
    source.close()
    start_s = time.monotonic()
    source.open()
    opened_s = time.monotonic() - start_s
    item = source.read(5.0)
    source.close()
    return AcceptanceStep(
        name="stop",
        status="failed" if item is None else "passed",
        said="it was closed and opened again, and " + ("sent nothing" if item is None else "sent"),
        measured={"reopened_s": round(opened_s, 2)},
    )
