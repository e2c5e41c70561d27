"""Make a person's lab, once for a seed and kept over trials: gels, electrodes and calibration.

Calibration is that of people. EMG maxima come from three strong squeezes through the real chain; touch maxima from
five presses on each fingertip, by the rule that a recording of presses is calibrated with.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.config import FINGERS
from tega.config.calibration import EmgMaxima, TouchMaxima
from tega.config.choose import block_s, finger_metric, muscle_decoder
from tega.errors import InvalidValueError
from tega.loop.inbox.frames import FrameMeter
from tega.loop.inbox.sources import SourceReport
from tega.loop.maxima import guided_maxima
from tega.runtime.device_items import TactileFrame
from tega.stages.base import Decoder, Metric
from tega_sim.conditions import ARMS
from tega_sim.filling import HOLD_S
from tega_sim.gel import Gel, ball, board
from tega_sim.operator import (
    Calibrated,
    ForearmEmg,
    Operator,
    Parameters,
    ScriptedOperator,
    calibrate,
    clear_skin,
    draw_person,
    load_parameters,
    people_digest,
)
from tega_sim.operator.motor import AWAY_M
from tega_sim.operator.scripted import COURSES
from tega_sim.plan import FULL_N, TrialPlan, loop_settings

EMG_HZ = 1000.0
"""Rate of the EMG."""

# The guided presses: a large marble and a flat board in turn, as firmly as the hand can. The marble is the most focal
# of what is grasped, the board the broadest, so that neither column of the vest is full for a whole hold.
PRESSES = 6
PRESS_FRAMES = 24
# Between two presses, longer than the gel needs to be distinguished from a touched one.
PAUSE_FRAMES = 90
FRAME_NS = round(1e9 / 60)
MARBLE_RADIUS_MM = 12.0
BASELINE_FRAMES = 30


class Lab:
    """Gels, electrodes and calibration of one person, which last longer than a trial.

    ``parameters`` of ``None`` are the package's own; ``settings`` are as in :class:`tega_sim.plan.TrialPlan`.
    ``baselines`` are the gels' untouched pictures, ``touch`` is what counts as full, by finger.
    """

    def __init__(
        self,
        seed: int,
        preset: Literal["paper", "live"],
        parameters: Parameters | None = None,
        *,
        settings: Sequence[str] = (),
    ) -> None:
        self._seed, self.preset = seed, preset
        self.config = loop_settings(preset, settings)
        self._parameters = parameters or load_parameters()
        self._someone = draw_person(seed, self._parameters)
        self.calibrated: Calibrated = calibrate(
            self._someone, seed=seed, rate_hz=EMG_HZ, preset=preset, tau_s=block_s(self.config)
        )
        self.gels: Mapping[str, Gel] = {
            finger: Gel(len(FINGERS) * seed + number, memory=True) for number, finger in enumerate(FINGERS)
        }
        self.baselines = {finger: _baseline(gel) for finger, gel in self.gels.items()}
        self.touch: Mapping[str, TouchMaxima] = {finger: self._press(finger) for finger in FINGERS}

    @property
    def people(self) -> str:
        """The first digits of the SHA-256 that identifies the people."""
        return people_digest(self._parameters.digest)[:16]

    def emg(self, lift: str) -> ForearmEmg:
        """Return the forearm's EMG for one lift, by its name: other lifts, other noise."""
        return ForearmEmg(self._someone, seed=self._seed, label=lift, rate_hz=EMG_HZ)

    def person(self, plan: TrialPlan) -> Operator | ScriptedOperator:
        """Return the plan's operator; one at a keyboard raises :class:`InvalidValueError`."""
        full_effort = self.calibrated.full_effort
        if plan.operator == "scripted":
            return ScriptedOperator(COURSES[plan.task], full_effort=full_effort)
        if plan.operator == "keyboard":
            raise InvalidValueError("the keyboard operator has no person", "give run_trial() a person")
        skin, someone, replace = ARMS[plan.condition].skin, self._someone, msgspec.structs.replace
        if plan.task == "fill":
            someone = replace(someone, forearm=replace(someone.forearm, hold_s=HOLD_S))
        return Operator(
            clear_skin(someone) if skin == "clear" else someone,
            seed=self._seed,
            feels=skin != "none",
            full_effort=full_effort,
            view=plan.view,
            away_m=AWAY_M if plan.task == "place" else 0.0,
        )

    def metric(self, finger: str) -> Metric:
        """Make the metric of a finger."""
        return finger_metric(self.config.stages, self.preset, finger, self.baselines[finger])

    @property
    def muscles(self) -> EmgMaxima:
        """The maxima of the muscles, and the conditions under which they are valid."""
        return EmgMaxima(
            kind="raw",
            rate_hz=EMG_HZ,
            tau=self.calibrated.tau,
            channels=("ECR", "FCU", "FDS"),
            maxima=tuple(float(maximum) for maximum in self.calibrated.maxima),
        )

    def decoder(self) -> Decoder:
        """Make the decoder of the muscles."""
        return muscle_decoder(self.config.stages, self.preset, self.muscles)

    def _press(self, finger: str) -> TouchMaxima:
        meter = FrameMeter(self.baselines[finger], self.metric(finger), SourceReport(), live=False)
        gel = self.gels[finger]
        gel.forget()
        contacts = []
        for number in range(PRESSES * (PRESS_FRAMES + PAUSE_FRAMES)):
            press, since = divmod(number, PRESS_FRAMES + PAUSE_FRAMES)
            share = math.sin(math.pi * (since + 0.5) / PRESS_FRAMES) if since < PRESS_FRAMES else 0.0
            force_n = FULL_N * share
            on = board(force_n=force_n) if press % 2 else ball(force_n=force_n, radius_mm=MARBLE_RADIUS_MM)
            image = gel.frame([on], number)
            contact = meter.take(TactileFrame(number, number * FRAME_NS, image, "simulated press"))
            if contact is not None:
                contacts.append(contact)
        return guided_maxima(contacts)


@lru_cache(maxsize=8)
def lab_of(seed: int, preset: Literal["paper", "live"], settings: tuple[str, ...]) -> Lab:
    """Return a person's lab, from memory where it was there just now."""
    return Lab(seed, preset, settings=settings)


def _baseline(gel: Gel) -> NDArray[np.uint8]:
    """Return the untouched gel's picture, as people record it: the mean of 30 frames. It cannot be written into."""
    frames = [gel.frame([], number).astype(np.uint16) for number in range(BASELINE_FRAMES)]
    mean: NDArray[np.uint8] = np.rint(np.mean(frames, axis=0)).astype(np.uint8)
    mean.flags.writeable = False
    return mean
