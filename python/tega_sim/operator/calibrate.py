"""Calibrate the person by the code that calibrates people, and find the effort that the maxima stand for."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.emg import GraspIntent, Preset, channel_maxima
from tega_sim.operator.emg import ForearmEmg
from tega_sim.operator.emg_noise import TICK_HZ
from tega_sim.operator.person import PersonNumbers

_SQUEEZE_S = 3.0
_PAUSE_S = 2.0
_SQUEEZES = 3
# The rise of a squeeze, left out where its steady part is looked at.
_RISE_S = 0.5


class Calibrated(NamedTuple):
    """Maxima of a simulated person's muscles, and the effort that these stand for.

    Attributes:
        maxima: For :class:`tega.emg.GraspIntent`, µV, float64 (3,).
        tau: Samples per block that they hold for.
        full_effort: Excitation at which the channels' means are at the maxima in use, for
            :class:`tega_sim.operator.Operator`: what practice with the level on show teaches.
    """

    maxima: NDArray[np.float64]
    tau: int
    full_effort: float


def calibrate(
    person: PersonNumbers, *, seed: int, rate_hz: float = 1000.0, tau_s: float = 0.1, preset: Preset = "live"
) -> Calibrated:
    """Take the maxima of three strong squeezes through the real chain, in blocks of ``tau_s``.

    ``preset`` picks the percentile that is used: the largest block for ``paper``, the 95th for ``live``.
    """
    effort, tau = person.motor.calibration_effort, round(tau_s * rate_hz)
    forearm = ForearmEmg(person, seed=seed, label="calibration", rate_hz=rate_hz, settled=True)
    squeeze = effort * np.minimum(np.arange(round(_SQUEEZE_S * TICK_HZ)) / (_RISE_S * TICK_HZ), 1.0)
    pause = np.zeros(round(_PAUSE_S * TICK_HZ))
    course = np.concatenate([pause, *[np.concatenate([squeeze, pause])] * _SQUEEZES])
    samples = forearm.course(course)
    percentile = 100.0 if preset == "paper" else 95.0
    maxima = channel_maxima(samples, rate_hz, tau=tau, percentile=percentile)
    ticks = (np.arange(len(samples)) * (TICK_HZ / rate_hz)).astype(np.int64)
    steady = samples[course[ticks] >= effort]
    means = channel_maxima(steady, rate_hz, tau=tau, percentile=50.0)
    in_use = GraspIntent(rate_hz, maxima, tau=tau, preset=preset).maxima
    return Calibrated(maxima, tau, effort * float(np.mean(in_use / means)))
