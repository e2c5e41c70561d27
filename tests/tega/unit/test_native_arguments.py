"""What is no whole number that fits is refused by name wherever the extension takes one."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest

from tega import _native, emg, wire
from tega.errors import TegaError
from tega.hand import CLOSURE_POSES_RAD, HandController
from tega.tactile import ContactGate, TrackedContact, contact_metrics

GEL, FORTY, LINE = np.full((8, 10, 3), 90, np.uint8), np.zeros(40, np.uint8), np.zeros(16)
LINK: Any = partial(_native.HandLink, HandController()._native, left=False, torque=False, lowest_rate_hz=0.0)
VOTES: Any = partial(
    _native.ChannelVotes, 200.0, stuck_from=[0], mains_share=0.9, mains_rms=[1], lines_hz=[50]
)
GELS: Any = partial(_native.Gel, spread=0.0, shape="flat", memory=False)
STATUS = ["sequence", "link", "battery", "faults", "uptime_ms", "dropped"]

# Calls, and the names of their whole numbers with valid ones.
TAKES: list[tuple[Callable[..., Any], dict[str, int]]] = [
    (lambda n: contact_metrics(GEL, GEL, gate=ContactGate(1.0, n)), {"n": 1}),
    (lambda n: TrackedContact(True, n, *[0.0] * 6, (0.0, 0.0), None, *[0.0] * 6), {"n": 1}),
    (partial(emg.ButterworthLowpass, 1000), {"order": 4, "channels": 3}),
    (emg.BlockMean, {"tau": 20, "channels": 3}),
    (partial(emg.GraspIntent, 1000, [1.0]), {"tau": 20, "order": 4, "intervals": 4}),
    (partial(emg.channel_maxima, np.full((400, 2), 0.5), 200, kind="envelope"), {"tau": 20}),
    (lambda n: emg.fuse_levels([1, n]), {"n": 1}),
    (VOTES, dict.fromkeys(("hop", "stuck", "still", "mains", "back"), 20)),
    (LINK, {"device_id": 0, "silent_after_ns": 1, "reconnects": 0}),
    (lambda n: LINK(device_id=0, silent_after_ns=1, reconnects=0).exchange([], n, 1.0, 0.0), {"n": 1}),
    (partial(HandController().step_encoded, CLOSURE_POSES_RAD[0], 1), {"device_id": 0}),
    (lambda n, k: GELS(n).still(k), {"n": 1, "k": 1}),
    (partial(wire.allegro_torque_frames, LINE), {"device_id": 0, "version": 4}),
    (wire.CytonDecoder, {"gain": 24}),
    (wire.ChordsDecoder, {"channels": 3}),
    (wire.SpikerDecoder, {"channels": 3}),
    (wire.AsciiEmgDecoder, {"channels": 3, "leading": 0}),
    (partial(wire.hid_motor_report, FORTY), {"sequence": 0, "ttl_ms": 1}),
    (lambda **status: wire.hid_status_report(wire.HidStatus(**status)), dict.fromkeys(STATUS, 0)),
]


@pytest.mark.parametrize(("call", "valid"), TAKES)
def test_no_whole_number_that_fits(call: Callable[..., Any], valid: dict[str, int]) -> None:
    call(**valid)
    for name in valid:
        for value in (2**70, -(2**70), 10**400, "3", b"3", 1.5, math.nan):
            with pytest.raises((TegaError, TypeError), match=r"out of range|interpreted|expected whole"):
                call(**valid | {name: value})
