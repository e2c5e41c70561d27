"""How well levels can be held: a person's muscles and the real chain, nothing else."""

from __future__ import annotations

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.emg import GraspIntent, Preset
from tega_sim.operator.emg import ForearmEmg, calibrate
from tega_sim.operator.motor import MuscleMotor
from tega_sim.operator.person import PersonNumbers, stream

__all__ = ["hold_shares", "unsteady"]

_HOLD_S = 4.0
_RISE_BLOCKS = 10


def unsteady(person: PersonNumbers, *, aim_sd: float, gain_sd: float) -> PersonNumbers:
    """Return the person with other errors of aim and of the electrodes, and without slack and artefacts."""
    motor = msgspec.structs.replace(person.motor, aim_sd=aim_sd, aim_floor=0.2 * aim_sd, slack_per_s=0.0)
    emg = msgspec.structs.replace(person.emg, gain_sd=gain_sd, artefact_hz=0.0)
    return msgspec.structs.replace(person, motor=motor, emg=emg)


def hold_shares(person: PersonNumbers, *, preset: Preset, n_holds: int, seed: int = 0) -> NDArray[np.float64]:
    """Return the share of 100 ms blocks at the intended level, of holds of three seconds after the rise.

    float64 (5,), for the levels 1 to 5. ``preset`` is of the calibration and of the chain. Each of the
    ``n_holds`` of a level has a calibration of its own; ``seed`` is of the first, the others follow.
    """
    shares = np.zeros((n_holds, 5))
    for hold in range(n_holds):
        maxima, tau, full_effort = calibrate(person, seed=seed + hold, preset=preset)
        for level in range(1, 6):
            aim, sense = (
                stream(seed + hold, "hold", level, "aim"),
                stream(seed + hold, "hold", level, "sense"),
            )
            muscles = MuscleMotor(person.motor, full_effort=full_effort, aim=aim, sense=sense)
            muscles.command(level)
            course = [muscles.step(tick / 100, 0.01) for tick in range(round(100 * _HOLD_S))]
            intent = GraspIntent(1000, maxima, tau=tau, preset=preset)
            levels = intent.process(ForearmEmg(person, seed=seed + hold, label=level).course(course))
            shares[hold, level - 1] = np.mean(levels[_RISE_BLOCKS:] == level)
    mean: NDArray[np.float64] = shares.mean(axis=0)
    return mean
