"""Measure the length of an EMG block, and latency against smoothing.

The input is made: band-limited Gaussian noise whose amplitude follows a known drive, the usual model of surface EMG.
The truth is the drive itself.
"""

from __future__ import annotations

from functools import partial
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.emg import BlockMean, ButterworthLowpass, GraspIntent, channel_maxima
from tega_figures.bench.timing import take_turns, timing
from tega_figures.pareto.drawing import Choice, PricedVariant

__all__ = ["emg_block", "latency_and_smoothing"]

RATE_HZ: Final = 1000
CHANNELS: Final = 3
CUTOFF_HZ, ORDER, BLOCK_S = 50.0, 4, 0.1
MADE = (
    "The input is made: four minutes of three channels at 1 kHz, Gaussian noise of 20 to 350 Hz "
    "whose amplitude follows a drive "
    "that steps between rest and effort every 1.5 s on average, the usual model of surface EMG; the "
    "drive is the truth."
)

Array = NDArray[np.float64]


class Effort(NamedTuple):
    """Made EMG and what it was made from.

    Attributes:
        emg: Rectified, (n, channels), arbitrary units.
        drive: Amplitude, (n,), 0 to 1.
    """

    emg: Array
    drive: Array


def effort(seconds: float = 240.0, *, seed: int = 5) -> Effort:
    """Make EMG from a drive of steps, each a fifth of a second on the way."""
    rng = np.random.default_rng(seed)
    n = int(seconds * RATE_HZ)
    steps = rng.uniform(0.05, 1.0, n)
    held = np.maximum.accumulate(np.where(rng.random(n) < 1 / (1.5 * RATE_HZ), np.arange(n), 0))
    route = np.ones(RATE_HZ // 5) / (RATE_HZ // 5)
    drive = np.convolve(steps[held], route)[:n]
    spectrum = np.fft.rfft(rng.normal(size=(n, CHANNELS)), axis=0)
    hz = np.fft.rfftfreq(n, 1 / RATE_HZ)
    spectrum[(hz < 20) | (hz > 350)] = 0
    noise = np.fft.irfft(spectrum, n, axis=0)
    noise /= noise.std(axis=0)
    return Effort(np.abs(noise * drive[:, np.newaxis]), drive)


def _delay_ms(response: Array) -> float:
    """Return when a step response passes its half, between samples, milliseconds."""
    k = int(np.argmax(response >= 0.5))
    before = response[k - 1] if k else 0.0
    return float(1000 * (k - 1 + (0.5 - before) / (response[k] - before)) / RATE_HZ)


def _step_delay_ms(order: int, cutoff_hz: float) -> float:
    step = np.concatenate([np.zeros((1, 1)), np.ones((RATE_HZ, 1))])
    return _delay_ms(ButterworthLowpass(RATE_HZ, cutoff_hz, order, 1).process(step)[1:, 0])


def _ripple(envelope: Array, drive: Array, delay_ms: float) -> float:
    """Return how far an envelope lies from the drive as late as itself, root mean square over the drive's mean."""
    late = round(delay_ms * RATE_HZ / 1000)
    drive = np.concatenate([np.full(late, drive[0]), drive[: len(drive) - late]])
    envelope = envelope * (envelope @ drive) / (envelope @ envelope)
    return float(np.sqrt(np.mean((envelope - drive) ** 2)) / drive.mean())


def emg_block(*, budget_s: float) -> Choice:
    """Measure the length of a block of Eq 10."""
    made = effort()
    strongest = np.argsort(made.drive)[-2 * RATE_HZ :]
    second = np.ascontiguousarray(made.emg[:RATE_HZ])
    blocks_s = (0.02, 0.05, 0.1, 0.15, 0.2, 0.3)
    intents = {}
    for block_s in blocks_s:
        tau = round(block_s * RATE_HZ)
        maxima = channel_maxima(made.emg[np.sort(strongest)], rate_hz=RATE_HZ, tau=tau, kind="rectified")
        intents[block_s] = partial(
            GraspIntent, RATE_HZ, maxima, tau=tau, kind="rectified", preset="paper", order=ORDER
        )
    calls = {
        str(block_s): partial(_in_blocks, make(), second, round(block_s * RATE_HZ))
        for block_s, make in intents.items()
    }
    turns = take_turns(calls, budget_s=budget_s)
    variants = []
    for block_s, make in intents.items():
        tau = round(block_s * RATE_HZ)
        levels = make().process(made.emg)
        late = round(_step_delay_ms(ORDER, CUTOFF_HZ) * RATE_HZ / 1000)
        drive = (
            np.concatenate([np.zeros(late), made.drive])[: len(levels) * tau].reshape(-1, tau).mean(axis=1)
        )
        right = _levels_of(drive, levels)
        variants.append(
            PricedVariant(
                name=f"{1000 * block_s:.0f} ms",
                cost=1000 * block_s / 2 + _step_delay_ms(ORDER, CUTOFF_HZ),
                error=100 * float(np.mean(levels != right)),
                beside={
                    "µs for a second of EMG": timing(turns[str(block_s)]).median_us,
                    "level changes a second": float(np.mean(np.diff(levels) != 0)) / block_s,
                },
                default=block_s == BLOCK_S,
            )
        )
    return Choice(
        title="EMG: length of a block",
        setting="`decoder.options.tau_s`",
        cost="mean delay, ms",
        error="blocks with another level than the drive's, %",
        how=(
            f"{MADE} The levels are those of the printed law (preset `paper`, 50 Hz, order 4). The "
            "drive's level is what "
            "the same borders say of the drive's own mean over the block. Delay is half a block and "
            "that of the low-pass."
        ),
        why=(
            "100 ms gives two fifths fewer wrong levels than 20 ms and changes the level a sixth as "
            "often. Longer blocks gain a third at most, "
            "for two to three times the delay. Processor time decides nothing here."
        ),
        variants=variants,
    )


def _in_blocks(intent: GraspIntent, samples: Array, tau: int) -> None:
    for at in range(0, len(samples), tau):
        intent.process(samples[at : at + tau])


def _levels_of(drive: Array, levels: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the drive's levels by the borders that agree best with the levels told: one scale for all of them."""
    scales = np.linspace(0.5, 1.5, 101) * 4 / drive.max()
    reported = [np.clip(np.floor(drive * scale) + 1, 1, 5).astype(np.int64) for scale in scales]
    return max(reported, key=lambda by: int(np.sum(by == levels)))


def latency_and_smoothing(*, budget_s: float) -> Choice:  # noqa: ARG001  # nothing is timed: delay is the cost
    """Measure delay and ripple of low-passes and block means, together and alone."""
    made = effort()
    variants = []
    for cutoff_hz, block_s in (
        (2, 0.0), (5, 0.0), (10, 0.0), (20, 0.0), (50, 0.0),
        (5, 0.1), (10, 0.1), (50, 0.05), (50, 0.1), (50, 0.2), (50, 0.3),
    ):  # fmt: skip
        lowpass = partial(ButterworthLowpass, RATE_HZ, cutoff_hz, ORDER, 1)
        envelope = lowpass().process(made.emg[:, :1])
        delay = _step_delay_ms(ORDER, cutoff_hz)
        drive = made.drive
        if block_s:
            tau = round(block_s * RATE_HZ)
            envelope = BlockMean(tau, 1).process(envelope).repeat(tau, axis=0)
            # A block stands until the next one is whole: it is one block late on average.
            delay += 1000 * block_s
            envelope = np.concatenate([np.full((tau, 1), envelope[0, 0]), envelope])[: len(drive)]
        variants.append(
            PricedVariant(
                name=f"{cutoff_hz} Hz" + (f", {1000 * block_s:.0f} ms" if block_s else ""),
                cost=delay,
                error=100 * _ripple(envelope[:, 0], drive, delay),
                default=(cutoff_hz, block_s) == (CUTOFF_HZ, BLOCK_S),
            )
        )
    return Choice(
        title="EMG: latency against smoothing",
        setting="`cutoff_hz` of `tega.emg.GraspIntent`, `decoder.options.tau_s`",
        cost="delay, ms",
        error="ripple, % of the drive",
        how=(
            f"{MADE} Each variant is a low-pass of order 4, alone or with the mean of a block behind "
            "it; a block stands until the next one "
            "is whole. Ripple is how far the envelope lies from the drive, as late as the envelope; one channel."
        ),
        why=(
            "50 Hz are printed, with a block. A low-pass of 5 Hz alone is a little better in both, "
            "so the default is not on the front; blocks "
            "are kept, since Eq 10 has them, a calibration holds for its block, and levels, decoders "
            "and records count in blocks."
        ),
        variants=variants,
    )
