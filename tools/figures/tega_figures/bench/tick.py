"""A whole tick, stage by stage: four frames and one EMG block in, a vest packet and CAN bytes out.

The stages are those of the dual loop, called as it calls them; devices, threads, recording and pacing are left out.
"""

from __future__ import annotations

import time
from functools import cache
from itertools import pairwise
from typing import Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.config.calibration import TouchMaxima
from tega.emg import GraspIntent
from tega.hand import ModelledHand
from tega.haptics import FINGERS
from tega.loop.touch import TouchLoop
from tega.stages.metrics import contact_record
from tega.tactile import read_contact
from tega.wire import allegro_torque_frames, x40_ble_frame
from tega_figures.bench.timing import Timing, in_turns
from tega_sim.gel import Gel, ball

__all__ = ["STAGES", "Tick", "TickRow", "time_ticks"]

STAGES = ("read", "map", "vest frame", "vest packet", "emg", "hand step", "can encode")
# 10 ms of three channels at 1 kHz.
EMG_RATE_HZ, EMG_ROWS = 1000.0, 10
# Pictures a finger, so that no two ticks in a row show the same one.
PICTURES = 4


class TickRow(msgspec.Struct, frozen=True, kw_only=True):
    """What a tick takes.

    ``reading`` is the touch preset; ``n_in_contact`` the fingers that are pressed, the others are read as
    well; ``stages_us`` the median of each stage.
    """

    reading: str
    n_in_contact: int
    stages_us: dict[str, float]
    total: Timing


@cache
def _pictures(seed: int, *, pressed: bool) -> tuple[list[NDArray[np.uint8]], NDArray[np.uint8]]:
    gel = Gel(seed)
    press = [ball(force_n=2.5)] if pressed else []
    return [gel.frame(press, n) for n in range(PICTURES)], gel.still()


class Tick:
    """Everything one tick needs, ready to run again and again.

    ``reading`` is the touch preset; ``n_in_contact`` of four fingers are pressed; ``seed`` is of all data.
    """

    def __init__(self, reading: Literal["paper", "live"], n_in_contact: int, *, seed: int = 5) -> None:
        self._reading = reading
        self._fingers = [_pictures(seed + k, pressed=k < n_in_contact) for k in range(len(FINGERS))]
        maxima = {finger: TouchMaxima(cci_max=1.0, eda_max=20_000.0) for finger in FINGERS}
        self._touch = TouchLoop(maxima, layout="x40")
        rng = np.random.default_rng(seed)
        self._samples = 2048 + 300 * rng.standard_normal((PICTURES, EMG_ROWS, 3))
        self._intent = GraspIntent(EMG_RATE_HZ, [300.0, 300.0, 300.0], tau=EMG_ROWS, preset=reading)
        self._hand = ModelledHand()
        self._number = 0

    def run(self) -> tuple[tuple[int, ...], bytes, bytes]:
        """Run one tick; return nanoseconds of each stage, the vest's packet, and the CAN frames' data."""
        clock = time.perf_counter_ns
        self._number += 1
        now = self._number % PICTURES
        t_ns = self._number * 10_000_000
        started = clock()
        contacts = [
            contact_record(finger, t_ns, read_contact(images[now], still, reading=self._reading))
            for finger, (images, still) in zip(FINGERS, self._fingers, strict=True)
        ]
        read = clock()
        for contact in contacts:
            self._touch.update(contact.finger, contact)
        mapped = clock()
        frame = self._touch.frame(t_ns)
        framed = clock()
        packet = x40_ble_frame(frame.x40())
        displayed = clock()
        level = int(self._intent.process(self._samples[now])[-1])
        filtered = clock()
        _, torques = self._hand.step(level)
        stepped = clock()
        data = b"".join(can.data for can in allegro_torque_frames(torques))
        ended = clock()
        marks = (started, read, mapped, framed, displayed, filtered, stepped, ended)
        stages = tuple(later - sooner for sooner, later in pairwise(marks))
        return stages, packet, data


def time_ticks(*, budget_s: float) -> list[TickRow]:
    """Time ticks with none to four fingers in contact, under both presets, in turns, for about ``budget_s``.

    One row a preset and number of fingers.
    """
    presets: tuple[Literal["paper", "live"], ...] = ("live", "paper")
    ticks: dict[tuple[str, int], Tick] = {
        (preset, n): Tick(preset, n) for preset in presets for n in range(len(FINGERS) + 1)
    }
    measured = in_turns(ticks, lambda tick: tick.run()[0], budget_s=budget_s)
    return [_row(reading, n, np.concatenate(turns) / 1000.0) for (reading, n), turns in measured.items()]


def _row(reading: str, n_in_contact: int, times_us: NDArray[np.float64]) -> TickRow:
    totals = times_us.sum(axis=1)
    return TickRow(
        reading=reading,
        n_in_contact=n_in_contact,
        stages_us={name: float(np.median(us)) for name, us in zip(STAGES, times_us.T, strict=True)},
        total=Timing(
            median_us=float(np.median(totals)), p99_us=float(np.percentile(totals, 99)), n_calls=len(totals)
        ),
    )
