"""Calibrate the muscles in steps: at rest, in strong squeezes, and one by one."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tega.config import EmgConfig
from tega.config.calibration import EmgMaxima
from tega.devices.base import EmgChunk, EmgSource, optional
from tega.errors import CalibrationError
from tega.runtime.guide import Bar, Guide, Shows
from tega.setup.calibration.effort import Maxima, Quiet, judge_muscles, judge_quiet, judge_squeezes
from tega.setup.calibration.sitting import Times, until_good

SQUEEZES = 3

_READ_S = 0.05
_SHOW_S = 0.1
_LEAST_SHARE, _ALL_SHARE = 0.5, 0.9
_LATE_S = 2.0

# What was photographed in the paper; names are free (emg.muscles).
_USUAL = ("ECR", "FCU", "FDS")
_MOVEMENTS = {
    "ECR": "bend the wrist back, fingers loose",
    "ECU": "bend the wrist back and towards the little finger",
    "ED": "stretch the fingers, wrist still",
    "FCR": "bend the wrist forward and towards the thumb",
    "FCU": "bend the wrist forward and towards the little finger",
    "FDP": "curl the fingertips hard, wrist still",
    "FDS": "curl the middle of the fingers, wrist still",
    "FPL": "bend the tip of the thumb",
}


def muscle_names(config: EmgConfig, channels: Sequence[str]) -> tuple[str, ...]:
    """Return the muscle that each channel sits on; settings that name any must name one per channel."""
    if not config.muscles:
        return _USUAL if len(channels) == len(_USUAL) else tuple(f"the muscle under {c}" for c in channels)
    if len(config.muscles) != len(channels):
        raise CalibrationError(
            f"emg.muscles names {len(config.muscles)}, the source has {len(channels)} channels",
            "name one muscle per channel",
        )
    return config.muscles


def collect(
    source: EmgSource,
    seconds: float,
    guide: Shows,
    prompt: str,
    *,
    names: Sequence[str],
    full: NDArray[np.float64] | None = None,
) -> list[EmgChunk]:
    """Collect samples for a while, showing them; a full bar is ``full``, (channels,), or the largest so far.

    Raises ``CalibrationError`` if less than half of the samples came.
    """
    chunks: list[EmgChunk] = []
    began_s, displayed_s, top = time.monotonic(), 0.0, np.full(len(names), 1e-9)
    n, expected = 0, seconds * (source.info.rate_hz or 0.0)
    # Samples that come late, on a busy machine or from a slow adapter, are waited for.
    while (gone_s := time.monotonic() - began_s) < seconds or (
        n < _ALL_SHARE * expected and gone_s < seconds + _LATE_S
    ):
        chunk = source.read(_READ_S)
        if chunk is not None:
            chunks.append(chunk)
            n += len(chunk.samples)
        if gone_s - displayed_s > _SHOW_S and chunks:
            displayed_s = gone_s
            # The mean distance from the mean over the last moments: enough for a bar.
            last = np.concatenate([c.samples for c in chunks[-20:]])
            now = np.abs(last - last.mean(axis=0)).mean(axis=0)
            top = np.maximum(top, now)
            shares = now / (top if full is None else np.maximum(full, 1e-9))
            bars = [
                Bar(n, float(np.clip(s, 0, 1)), f"{v:.3g}")
                for n, s, v in zip(names, shares, now, strict=True)
            ]
            guide.show(prompt, bars, max(0.0, seconds - gone_s))
    if n < _LEAST_SHARE * expected:
        raise CalibrationError(
            f"{n} samples came in {seconds:g} s, about {expected:.0f} were expected", "check power and cable"
        )
    return chunks


def drain(source: EmgSource) -> None:
    """Discard the samples that have piled up."""
    for _ in range(2000):
        if source.read(0.0) is None:
            return


class MuscleSteps:
    """Leads a person through the steps on one open source.

    ``received`` are the samples that the last step judged, of all its squeezes.
    """

    def __init__(self, source: EmgSource, chain: EmgMaxima, guide: Guide, times: Times) -> None:
        self._source, self._chain, self._guide, self._times = source, chain, guide, times
        self.received: list[EmgChunk] = []

    def _collect(
        self, seconds: float, prompt: str, full: NDArray[np.float64] | None = None
    ) -> list[EmgChunk]:
        return collect(self._source, seconds, self._guide, prompt, names=self._chain.channels, full=full)

    def rest(self) -> Quiet:
        """Measure the muscles at rest."""

        def attempt() -> Quiet:
            self._guide.ready("Let the arm lie, hand open, and do nothing")
            drain(self._source)
            self.received = self._collect(self._times.rest_s, "Rest")
            return judge_quiet(self.received, self._chain, limits=optional(self._source, "limits"))

        found, notes = until_good(self._guide, "rest", attempt, lambda q: q.notes)
        quiet = Quiet(offset=_rounded(found.offset), rest=_rounded(found.rest), notes=notes)
        self._guide.say(f"rest: {_list(self._chain.channels, quiet.rest)}", tone="good")
        return quiet

    def squeezes(self, quiet: Quiet, *, n: int = SQUEEZES) -> Maxima:
        """Take the maxima of ``n`` strong squeezes, with pauses."""
        guide, times = self._guide, self._times

        def attempt() -> Maxima:
            squeezes = []
            for k in range(n):
                if k and times.pause_s > 0:
                    self._collect(times.pause_s, "Pause: let go and breathe")
                which = f"Squeeze {k + 1} of {n}" if n > 1 else "Squeeze"
                guide.ready(f"{which}: a fist, as strong as you can, until the screen says stop")
                drain(self._source)
                squeezes.append(self._collect(times.squeeze_s, "SQUEEZE"))
                guide.say(f"{which.lower().partition(' of ')[0]}: let go")
            self.received = [chunk for chunks in squeezes for chunk in chunks]
            limits = optional(self._source, "limits")
            return judge_squeezes(squeezes, quiet.rest, self._chain, limits=limits)

        found, notes = until_good(
            guide, "squeezes", attempt, lambda m: m.notes, can_keep=lambda m: min((*m.live, *m.paper)) > 0
        )
        maxima = Maxima(live=_rounded(found.live), paper=_rounded(found.paper), notes=notes)
        guide.say(f"strong squeeze: {_list(self._chain.channels, maxima.live)}", tone="good")
        return maxima

    def muscles(
        self, names: Sequence[str], quiet: Quiet, maxima: Maxima
    ) -> tuple[tuple[tuple[float, ...], ...], tuple[str, ...]]:
        """Have each muscle work alone; return each channel's rise, a row a muscle, and the problems kept."""
        rest, full = np.array(quiet.rest), np.array(maxima.live)

        def attempt() -> tuple[NDArray[np.float64], tuple[str, ...]]:
            movements = []
            for name, muscle in zip(self._chain.channels, names, strict=True):
                subject = _MOVEMENTS.get(muscle, f"tense {muscle} alone")
                self._guide.ready(f"{name} sits on {muscle}: {subject}, about half as strong as you can")
                drain(self._source)
                movements.append(self._collect(self._times.movement_s, subject, full))
            return judge_muscles(movements, rest, full, self._chain)

        (drives, _), notes = until_good(self._guide, "muscles", attempt, lambda found: found[1])
        self._guide.say("each muscle raises its own channel" if not notes else "kept as it is", tone="good")
        return tuple(tuple(round(float(v), 3) for v in row) for row in drives), notes


def _rounded(values: Sequence[float]) -> tuple[float, ...]:
    return tuple(float(f"{v:.6g}") for v in values)


def _list(names: Sequence[str], values: Sequence[float]) -> str:
    return ", ".join(f"{n} {v:.3g}" for n, v in zip(names, values, strict=True))
