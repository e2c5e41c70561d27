"""Measure how strong a squeeze is in a rest: the amplifier is opened for it, and nothing else is."""

from __future__ import annotations

from typing import Final

import numpy as np

from tega.config import SessionConfig
from tega.devices.base import optional
from tega.devices.registry import driver_class
from tega.errors import CalibrationError, ConfigError
from tega.loop.prepare import prepare
from tega.runtime.guide import Shows
from tega.setup.calibration.effort import Chain, judge_squeezes
from tega.setup.calibration.steps_emg import collect, drain
from tega_study.lead.rest_tasks import RestTask, RestTaskEnd, RunningTask

SQUEEZE_S: Final = 3.0
"""So long a squeeze lasts; its first half second is its rise and does not count."""
_READY_S: Final = 1.0


def squeeze_task(config: SessionConfig, *, settings: str) -> RestTask:
    """Return the task of a squeeze."""

    def run(running: RunningTask) -> RestTaskEnd:
        return measure_squeeze(config, running, settings=settings)

    return RestTask("g", "a squeeze against the first", "squeeze", run)


def measure_squeeze(config: SessionConfig, shows: Shows, *, settings: str) -> RestTaskEnd:
    """Have the person squeeze once.

    Returns:
        The mean over the channels of the amplitude as a share of the calibrated maximum, and the signal's problems.
        It is the muscles' electrical amplitude, not a force.

    Raises:
        ConfigError: The settings have no EMG.
        CalibrationError: There is no calibration for it, or too few samples came.
        DeviceUnavailableError: The amplifier is missing or went away.
    """
    if config.emg is None:
        raise ConfigError("a squeeze needs muscles: the settings have no [emg]", "set [emg]")
    with driver_class(config.emg.driver, "emg")(config.emg.options) as source:
        made = prepare(
            config, {}, source, progress=lambda *_: None, stop=lambda: False, settings=settings
        ).calibration.emg
        if made is None:
            raise CalibrationError(f"{settings}: has no EMG maxima", "calibrate")
        drain(source)
        collect(source, _READY_S, shows, "get ready to squeeze", names=made.channels)
        chunks = collect(source, SQUEEZE_S, shows, "SQUEEZE as strong as you can", names=made.channels)
        chain = Chain(made.rate_hz, made.tau, made.kind, made.channels)
        rest = np.zeros(len(made.channels))
        found = judge_squeezes([chunks], rest, chain, limits=optional(source, "limits"))
    tops = found.live if config.session.preset == "live" else found.paper
    return RestTaskEnd("; ".join(found.problems), float(np.mean(tops / np.array(made.maxima))))
