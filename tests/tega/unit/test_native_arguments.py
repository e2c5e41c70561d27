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
from tega.hand import HandController
from tega.tactile import ContactGate, TrackedContact, contact_metrics

GEL = np.full((8, 10, 3), 90, np.uint8)
FORTY, LINE, ROWS = np.zeros(40, np.uint8), np.zeros(16), np.zeros((4, 3))
CORE = HandController()._native
LINK: dict[str, Any] = {"device_id": 0, "silent_after_ns": 1, "reconnects": 0}
LINKED = partial(_native.HandLink, CORE, left=False, torque=False, lowest_rate_hz=0.0)
VOTES: dict[str, Any] = dict.fromkeys(("hop", "stuck", "still", "mains", "back"), 20)
VOTED = partial(_native.ChannelVotes, 200.0, stuck_from=[0], mains_share=0.9, mains_rms=[1], lines_hz=[50])
SIGNAL = (np.full((400, 2), 0.5), 200)
STATUS = dict.fromkeys(("sequence", "link", "battery", "faults", "uptime_ms", "dropped"), 0)


def status_report(**status: Any) -> bytes:
    return wire.hid_status_report(wire.HidStatus(**status))


def replaced(call: Callable[..., Any], valid: dict[str, Any], name: str, n: Any) -> Any:
    return call(**valid | {name: n})


TAKES: dict[str, Callable[[Any], Any]] = {
    "min_pixels": lambda n: contact_metrics(GEL, GEL, gate=ContactGate(1.0, n)),
    "eda": lambda n: TrackedContact(True, n, *[0.0] * 6, (0.0, 0.0), None, *[0.0] * 6),
    "order": lambda n: emg.ButterworthLowpass(1000, order=n),
    "channels": lambda n: emg.ButterworthLowpass(1000, channels=n),
    "channels of blocks": lambda n: emg.BlockMean(20, n),
    "tau of blocks": emg.BlockMean,
    "tau": lambda n: emg.GraspIntent(1000, [1.0], tau=n),
    "order of intent": lambda n: emg.GraspIntent(1000, [1.0], tau=20, order=n),
    "intervals": lambda n: emg.GraspIntent(1000, [1.0], tau=20, intervals=n),
    "tau of maxima": lambda n: emg.channel_maxima(*SIGNAL, tau=n),
    "level": lambda n: emg.fuse_levels([1, n]),
    **{name: partial(replaced, VOTED, VOTES, name) for name in VOTES},
    **{name: partial(replaced, LINKED, LINK, name) for name in LINK},
    "t_ns": lambda n: LINKED(**LINK).exchange([], n, 1.0, 0.0),
    "t_ns of a release": LINKED(**LINK).release,
    "t_ns of heat": LINKED(**LINK).heat_share,
    "device_id of a step": lambda n: HandController().step_encoded(LINE, 1, device_id=n),
    "period_ns": lambda n: _native.bare_clock(n, 1),
    "n_ticks": lambda n: _native.bare_clock(1, n),
    "seed": lambda n: _native.Gel(n, spread=0.0, shape="flat", memory=False),
    "index": lambda n: _native.Gel(1, spread=0.0, shape="flat", memory=False).still(n),
    "first": lambda n: _native.mix_muscles(ROWS, (ROWS,) * 3, (1.0,) * 3, n, 4),
    "device_id of torques": lambda n: wire.allegro_torque_frames(LINE, device_id=n),
    "version": lambda n: wire.allegro_torque_frames(LINE, version=n),
    "period": wire.allegro_set_period,
    "gain": wire.CytonDecoder,
    "channels of Chords": wire.ChordsDecoder,
    "channels of SpikerBox": wire.SpikerDecoder,
    "channels of text": wire.AsciiEmgDecoder,
    "leading": lambda n: wire.AsciiEmgDecoder(3, leading=n),
    "ttl_ms": lambda n: wire.hid_motor_report(FORTY, sequence=0, ttl_ms=n),
    "sequence": lambda n: wire.hid_stop_report(sequence=n),
    **{name: partial(replaced, status_report, STATUS, name) for name in STATUS},
}


@pytest.mark.parametrize("take", TAKES.values(), ids=TAKES)
def test_no_whole_number_that_fits(take: Callable[[Any], Any]) -> None:
    for value in (2**70, -(2**70), 10**400, "3", b"3", 1.5, math.nan):
        with pytest.raises(
            (TegaError, TypeError), match=r"out of range|cannot be interpreted|expected whole"
        ):
            take(value)
