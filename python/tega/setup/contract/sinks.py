"""Check vests, hands that are steered, and hands that only take frames, against their contracts."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from tega.devices.base import SteeredHand
from tega.errors import InvalidValueError
from tega.haptics import vest_frame
from tega.setup.contract.rule import refuses, rule
from tega.wire import allegro_torque_frames


def check_hand(hand: SteeredHand) -> None:
    """Check a hand that closes its own loop.

    Raises:
        AssertionError: A rule is broken; the message names it.
    """
    with hand:
        for level in (1, 2, 5):
            hand.step(level)
            angles = hand.angles_rad
            rule(angles.dtype == np.float64 and angles.shape == (16,), "angles_rad is float64 (16,)")
            rule(bool(np.isfinite(angles).all()), "angles are finite")
        for level in (0, 6):
            refuses(
                partial(hand.step, level),
                InvalidValueError,
                "a level outside 1 to 5 raises InvalidValueError",
            )
        hand.step(2, 0.5)
        for added in (-0.1, 1.1, float("nan")):
            refuses(
                partial(hand.step, 2, added),
                InvalidValueError,
                "an addition outside 0 to 1 raises InvalidValueError",
            )
        rule(all(0 <= f.id <= 0x7FF for f in hand.limp()), "limp gives the frames that were sent")


def check_sink(sink: Any) -> None:
    """Check a vest, or a hand that only takes frames.

    Raises:
        AssertionError: A rule is broken; the message names it.
    """
    with sink:
        if sink.info.kind == "vest":
            frame = vest_frame([10, 20, 30, 40], [50, 60, 70, 80])
            sent = sink.write(0, frame)
            rule(sent.intensities.shape == frame.intensities.shape, "write returns the frame really sent")
            rule(bool((sent.intensities <= frame.intensities).all()), "a limit only ever lowers an intensity")
            sink.write(33_333_333, vest_frame([0] * 4, [0] * 4))
        else:
            frames = allegro_torque_frames(np.full(16, 0.01))
            sent_frames = list(sink.write(0, frames))
            rule(
                [f.id for f in sent_frames] == [f.id for f in frames], "write returns the frames really sent"
            )
            sink.write(3_000_000, allegro_torque_frames(np.zeros(16)))
