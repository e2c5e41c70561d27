"""Compare decoders on one log: each is calibrated on one part in time and judged on another, never shuffled."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.emg import GraspIntent, InputKind, channel_maxima
from tega.errors import ConfigError, InvalidValueError, ShapeError
from tega.stages.base import MuscleSetup
from tega.stages.registry import stage_class
from tega_learn.block_features import as_samples
from tega_learn.learned import LearnedDecoder
from tega_learn.score import PERCENTILES, DecoderFigures, judge
from tega_learn.training import fit

LEARNED: Final[dict[str, Literal["ridge", "huber", "kernel"]]] = {
    "learned": "ridge",
    "learned-huber": "huber",
    "learned-kernel": "kernel",
}
"""Names under which models are fitted to the training part; every other name is an installed decoder's."""


class Log(NamedTuple):
    """EMG, ``(n, channels)``, beside the force or closure that was meant at each sample, ``(n,)``."""

    name: str
    samples: NDArray[np.float64]
    target: NDArray[np.float64]
    rate_hz: float
    kind: InputKind = "raw"

    @property
    def tau(self) -> int:
        """Samples in a block of 100 ms."""
        return max(4, round(0.1 * self.rate_hz))

    def part(self, first: float, last: float) -> Log:
        """Return a part in time, by shares of the length."""
        n = len(self.samples)
        span = slice(int(first * n), int(last * n))
        return self._replace(samples=self.samples[span], target=self.target[span])

    def columns(self, channels: Sequence[int]) -> Log:
        """Return the log with these channels alone, counted from 0."""
        return self._replace(samples=self.samples[:, list(channels)])


class DecoderReport(NamedTuple):
    """Closures and levels that a decoder returned for a log; every array is ``(k,)``.

    ``confidence`` is NaN where the decoder gives none; ``target`` is by the training part's full.
    """

    decoder: str
    closure: NDArray[np.float64]
    level: NDArray[np.float64]
    confidence: NDArray[np.float64]
    held: NDArray[np.bool_]
    target: NDArray[np.float64]
    figures: DecoderFigures


def two_halves(log: Log, *, swapped: bool = False) -> tuple[Log, Log]:
    """Return the half to train on and the half to judge: the first and the second, or the other way round."""
    first, second = log.part(0, 0.5), log.part(0.5, 1)
    return (second, first) if swapped else (first, second)


def compare(
    train: Log,
    judged: Log,
    decoders: Sequence[str],
    *,
    recalibrate_s: float = 0.0,
) -> list[DecoderReport]:
    """Calibrate decoders on one log and judge them on another, from a fresh start.

    ``decoders`` are names of :data:`LEARNED`, ``rules``, ``rules-paper`` or any installed decoder's. The first
    ``recalibrate_s`` of the judged log put maxima and models to the day, and are not judged. Logs that do not go
    together are refused.
    """
    for log in (train, judged):
        as_samples(log.samples, train.samples.shape[1])
        if log.target.shape != (len(log.samples),):
            raise ShapeError(
                f"{log.name}: {len(log.target)} targets for {len(log.samples)} samples", "one each is needed"
            )
    if train.rate_hz != judged.rate_hz or train.kind != judged.kind:
        raise InvalidValueError(
            f"{judged.name}: {judged.rate_hz:g} samples/s {judged.kind}, trained on {train.rate_hz:g} {train.kind}",
            "compare logs of one source",
        )
    tau, block_s = train.tau, train.tau / train.rate_hz
    full = float(np.percentile(train.target, 98))
    if not full > 0:
        raise InvalidValueError(
            f"{train.name}: its target is never above 0",
            "train on a part with effort in it; turn the sign of a force that is counted downwards",
        )
    today = None
    if recalibrate_s > 0:
        n_today = round(recalibrate_s * judged.rate_hz)
        if n_today >= len(judged.samples):
            raise InvalidValueError(
                f"{judged.name}: {recalibrate_s:g} s to recalibrate, and it is "
                f"{len(judged.samples) / judged.rate_hz:g} s long",
                "leave some of it to be judged",
            )
        today = judged._replace(samples=judged.samples[:n_today], target=judged.target[:n_today] / full)
        judged = judged._replace(samples=judged.samples[n_today:], target=judged.target[n_today:])
    scaled_on = train if today is None else today
    n = len(judged.samples) // tau
    wanted = np.clip(judged.target[: n * tau].reshape(n, tau).mean(axis=1) / full, 0, 1)
    paper = GraspIntent(
        train.rate_hz, _maxima(scaled_on, "paper"), tau=tau, kind=train.kind, preset="paper"
    ).process(judged.samples)
    found = []
    for name in decoders:
        closure, level, confidence, held = _run(name, train, today, judged)
        figures = judge(closure, level, wanted, block_s, paper=paper, confidence=confidence, held=held)
        found.append(DecoderReport(name, closure, level, confidence, held, wanted, figures))
    return found


def _maxima(log: Log, preset: Literal["paper", "live"]) -> NDArray[np.float64]:
    return channel_maxima(
        log.samples, log.rate_hz, tau=log.tau, kind=log.kind, percentile=PERCENTILES[preset]
    )


def _run(
    name: str, train: Log, today: Log | None, judged: Log
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    if name in LEARNED:
        decoder: LearnedDecoder = fit(
            train.samples,
            train.target,
            rate_hz=train.rate_hz,
            tau=train.tau,
            kind=train.kind,
            model=LEARNED[name],
        )
        if today is not None:
            decoder = decoder.recalibrated(today.samples, today.target)
        closure = decoder.process(judged.samples)
        return closure, decoder.levels.astype(float), decoder.confidence, decoder.held
    preset: Literal["paper", "live"] = "paper" if name == "rules-paper" else "live"
    kind: Any = stage_class("decoder", "rules" if name == "rules-paper" else name)
    setup = MuscleSetup(
        train.kind,
        train.rate_hz,
        train.tau,
        tuple(f"ch{c + 1}" for c in range(train.samples.shape[1])),
        tuple(float(m) for m in _maxima(today or train, preset)),
        preset,
    )
    stage = kind(setup, kind.options_type())
    times_ns = np.rint(np.arange(1, len(judged.samples) + 1) * 1e9 / judged.rate_hz).astype(np.int64)
    intents = stage.decode(np.ascontiguousarray(judged.samples, np.float64), times_ns)
    # One a block, the newest at its end: decoders may have a pace of their own.
    ends = times_ns[train.tau - 1 :: train.tau]
    at = np.searchsorted(np.array([intent.t_ns for intent in intents]), ends, side="right") - 1
    if not intents or at[0] < 0:
        raise ConfigError(
            f"decoder {name!r} says nothing in the first 100 ms", "it cannot be compared block by block"
        )
    newest = [intents[n] for n in at]
    closure = np.array([(i.level - 1) / 4 if i.closure is None else i.closure for i in newest])
    level = np.array([i.level if i.closure is None else np.floor(4 * i.closure + 1.5) for i in newest])
    sure = np.array([np.nan if i.confidence is None else i.confidence for i in newest])
    return closure, level, sure, np.array([i.confidence == 0 for i in newest])


def draw_decoders(parts: list[tuple[str, float, list[DecoderReport]]], file: Path) -> None:
    """Draw a picture, a row a decoder and a column a part: its title, block length in s, and decoders' results."""
    from tega.ui.view.figures import new_figure

    rows = max(len(reported) for _, _, reported in parts)
    figure = new_figure(figsize=(5.5 * len(parts), 1.5 * rows + 0.6))
    panels = figure.subplots(rows, len(parts), sharex="col", sharey=True, squeeze=False)
    for column, (title, block_s, reported) in enumerate(parts):
        for row, one in enumerate(reported):
            panel = panels[row, column]
            t_s = np.arange(1, len(one.closure) + 1) * block_s
            panel.fill_between(t_s, one.target, color="0.85", linewidth=0)
            panel.plot(t_s, one.closure, linewidth=1.0)
            panel.set_title(f"{one.decoder}: rank {one.figures.rank_correlation:.2f}", fontsize=8, loc="left")
            panel.tick_params(labelsize=7)
        panels[0, column].set_title(
            f"{title}\n{panels[0, column].get_title(loc='left')}", fontsize=8, loc="left"
        )
        panels[-1, column].set_xlabel("time (s)", fontsize=8)
    figure.supylabel("closure 0 to 1; grey: target", fontsize=8)
    figure.savefig(file)
