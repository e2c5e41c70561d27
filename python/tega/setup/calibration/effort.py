"""Measure muscles at rest and at work: offset, rest and maxima by channel, and each electrode's muscle.

Every number goes through the chain that a run uses (:func:`tega.emg.channel_maxima`), so a maximum has the same
meaning here and in a run. Values are in the source's unit.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.config.calibration import EmgMaxima
from tega.devices.base import EmgChunk
from tega.devices.emg.emg_health import EmgHealth, swapped_channels
from tega.emg import channel_maxima
from tega.errors import CalibrationError

LEAST_RATIO = 3.0
"""A maximum under so many times the rest has no room for five levels."""

# Squeezes as strong as the person can agree within a quarter; a much weaker one was half-hearted.
_AGREE = 0.6
# Not still: the noisiest tenth of a second of rest far above its middle.
_UNQUIET = 3.0
# The rise of a squeeze is not its strength.
_RISE_S = 0.5
# A channel that rises by less than this share of its maximum has not answered.
_ANSWER = 0.15


def _level(samples: NDArray[np.float64], chain: EmgMaxima, percentile: float) -> NDArray[np.float64]:
    """Return a percentile of the block means of each channel, (channels,); 0 where it never moves."""
    values = np.zeros(len(chain.channels))
    for k, column in enumerate(samples.T):
        try:
            values[k] = channel_maxima(
                column[np.isfinite(column)],
                chain.rate_hz,
                tau=chain.tau,
                kind=chain.kind,
                percentile=percentile,
            )[0]
        except CalibrationError:  # too short, or it does not move
            continue
    return values


def watch(
    chunks: Sequence[EmgChunk], chain: EmgMaxima, limits: tuple[float, float] | None
) -> tuple[str, ...]:
    """Return the problems of a stretch of signal, in the words of :mod:`tega.devices.emg.emg_health`.

    A problem is reported if it lasts for two half seconds and for half of the time since it was first detected: mains
    can be detected after two seconds only, and a jerk of the arm is no fault. Lost samples are reported above 5 %.
    """
    health, seen, n_checks = EmgHealth(chain.rate_hz, chain.channels, limits=limits), Counter[str](), 0
    first_seen: dict[str, int] = {}
    step = max(1, round(0.5 * chain.rate_hz))
    samples = np.concatenate([c.samples for c in chunks]) if chunks else np.empty((0, len(chain.channels)))
    first = chunks[0].first_index if chunks else 0
    for at in range(0, len(samples) - step + 1, step):
        part = chunks[0]._replace(first_index=first + at, samples=samples[at : at + step])
        health.take(part)
        seen.update(health.now)
        for text in health.now:
            first_seen.setdefault(text, n_checks)
        n_checks += 1
    least = min(2, n_checks)
    words = [text for text, n in seen.items() if n >= least and 2 * n >= n_checks - first_seen[text]]
    n_lost = sum(
        max(0, b.first_index - a.first_index - len(a.samples)) for a, b in itertools.pairwise(chunks)
    )
    if n_lost > 0.05 * (len(samples) + n_lost):
        words.insert(0, f"{n_lost} samples were lost: cable, battery, or radio out of reach")
    return tuple(words)


class Quiet(msgspec.Struct, frozen=True, kw_only=True):
    """Muscles at rest by channel: ``offset``, the mean of the samples, and ``rest``, the middle block mean.

    ``notes`` are the problems found, one sentence each; once they are kept, those with which they were.
    """

    offset: tuple[float, ...]
    rest: tuple[float, ...]
    notes: tuple[str, ...] = ()


def judge_quiet(
    chunks: Sequence[EmgChunk], chain: EmgMaxima, *, limits: tuple[float, float] | None = None
) -> Quiet:
    """Measure muscles at rest; ``CalibrationError`` if nothing came.

    What is wrong while a muscle works is wrong at rest too, but an envelope at rest may well stand still.
    """
    samples = joined(chunks)
    middle, top = _level(samples, chain, 50.0), _level(samples, chain, 95.0)
    problems = list(watch(chunks, chain, limits))
    for name, quiet, loud in zip(chain.channels, middle, top, strict=True):
        if loud > _UNQUIET * quiet > 0:
            problems.append(f"{name}: not at rest all the time: let the arm lie, hand open")
    offset: NDArray[np.float64] = np.nanmean(samples, axis=0)
    return Quiet(offset=tuple(offset.tolist()), rest=tuple(middle.tolist()), notes=tuple(problems))


class Maxima(msgspec.Struct, frozen=True, kw_only=True):
    """Maxima of the muscles in strong squeezes, by channel, with ``notes`` as those of :class:`Quiet`.

    ``paper`` is the largest block mean, ``live`` the 95th percentile of the block means.
    """

    live: tuple[float, ...]
    paper: tuple[float, ...]
    notes: tuple[str, ...] = ()


def judge_squeezes(
    squeezes: Sequence[Sequence[EmgChunk]],
    rest: Sequence[float],
    chain: EmgMaxima,
    *,
    limits: tuple[float, float] | None = None,
) -> Maxima:
    """Take the maxima of all strong squeezes together; ``CalibrationError`` if nothing came during one.

    The first half second of each is its rise and is left out. ``rest`` is that of the channels, (channels,);
    ``limits`` are the range of the converter.
    """
    steady = [joined(chunks)[_rise(chunks, chain) :] for chunks in squeezes]
    levels = np.array([_level(s, chain, 50.0) for s in steady])
    whole = np.concatenate(steady)
    paper, live = _level(whole, chain, 100.0), _level(whole, chain, 95.0)
    found = Counter(words for chunks in squeezes for words in set(watch(chunks, chain, limits)))
    problems = [words for words, n in found.items() if 2 * n >= len(squeezes)]
    for name, quiet, top in zip(chain.channels, rest, live, strict=True):
        if top <= 0:
            problems.append(f"{name}: no signal in any squeeze")
        elif top < LEAST_RATIO * quiet:
            problems.append(
                f"{name}: a strong squeeze is only {top / quiet:.1f} times its rest, {LEAST_RATIO:g} are needed: "
                "the electrode is off the muscle, or the rest was not one"
            )
    overall = (levels / np.maximum(levels.max(axis=0), 1e-12)).mean(axis=1)
    for k, share in enumerate(overall):
        if share < _AGREE * overall.max():
            problems.append(
                f"squeeze {k + 1} reached {share / overall.max():.0%} of the strongest: all as strong as you can"
            )
    return Maxima(live=tuple(live.tolist()), paper=tuple(paper.tolist()), notes=tuple(problems))


def judge_muscles(
    movements: Sequence[Sequence[EmgChunk]],
    rest: NDArray[np.float64],
    maxima: NDArray[np.float64],
    chain: EmgMaxima,
) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Return each channel's rise, as a share of its range, (muscles, channels), and the problems found.

    ``movements`` are taken while the muscle of each channel works alone, in the order of the channels.
    ``rest`` and ``maxima``, those of a strong squeeze, are (channels,). Raises ``CalibrationError`` if
    nothing came during one.
    """
    span = np.maximum(maxima - rest, 1e-12)
    drives = np.array([(_level(joined(m)[_rise(m, chain) :], chain, 50.0) - rest) / span for m in movements])
    problems = []
    if text := swapped_channels(np.maximum(drives, 0.0), chain.channels):
        problems.append(text)
    for k, name in enumerate(chain.channels):
        if drives[k].max() < _ANSWER:
            problems.append(
                f"{name}: no channel answered to its muscle: move harder, or the electrode is off it"
            )
    return drives, tuple(problems)


def _rise(chunks: Sequence[EmgChunk], chain: EmgMaxima) -> int:
    n = sum(len(c.samples) for c in chunks)
    return min(round(_RISE_S * chain.rate_hz), n // 4)


def joined(chunks: Sequence[EmgChunk]) -> NDArray[np.float64]:
    """Return the samples of some chunks, float64 (n, channels); ``CalibrationError`` if there are none."""
    if not sum(len(c.samples) for c in chunks):
        raise CalibrationError("no EMG sample came", "check power and cable")
    return np.concatenate([c.samples for c in chunks])
