"""Make the frames of sham vests, with no or wrong information: arms of a study beside on and off.

A person who gains from them gains from being made careful, not from information. Each turns the frame that the loop
made into the one that is worn.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Literal, TypeAlias, get_args

import numpy as np

from tega.errors import InvalidValueError
from tega.haptics import Layout, MotorLevels, vest_frame
from tega.runtime.words import nearest_hint
from tega_sim.operator.person import stream

ShamName = Literal[
    "informative", "off", "silent", "constant", "unrelated", "replayed", "permuted", "inverted", "half"
]

SHAMS: tuple[ShamName, ...] = get_args(ShamName)
"""Arms that :func:`sham_vest` knows; ``informative`` is the real vest."""

_FRAME_S = 1 / 30
_CONSTANT_PERCENT = 50.0
# Slow, as a grip changes: corner of the unrelated process, hertz.
_UNRELATED_HZ = 0.3


Sham: TypeAlias = Callable[[float, MotorLevels], MotorLevels | None]
"""Takes the time in seconds and the frame that was made; returns the one worn, or ``None`` for a vest that is off."""


def sham_vest(
    name: ShamName,
    *,
    seed: int = 0,
    layout: Layout = "x40",
    recorded: Sequence[tuple[float, MotorLevels]] = (),
) -> Sham:
    """Return an arm of the study.

    ``informative``: unchanged. ``off``: not worn. ``silent``: worn, all motors still. ``constant``: all at
    50 % from the start. ``unrelated``: front and back follow slow random processes, by the seed.
    ``replayed``: ``recorded``, times and frames of another trial in order, which must not be empty then.
    ``permuted``: finger columns exchanged, by the seed. ``inverted``: strong becomes weak wherever anything
    is felt. ``half``: half as strong, for a vest that is turned down. ``layout`` is that of the frames that
    are made here.
    """
    level = _CONSTANT_PERCENT if name == "constant" else 0.0
    still = vest_frame([level] * 4, [level] * 4, layout=layout)
    arms: dict[str, Callable[[], Sham]] = {
        "informative": lambda: lambda _t_s, frame: frame,
        "off": lambda: lambda _t_s, _frame: None,
        "silent": lambda: lambda _t_s, _frame: still,
        "constant": lambda: lambda _t_s, _frame: still,
        "unrelated": lambda: _Unrelated(seed, layout),
        "replayed": lambda: _replayed(recorded),
        "permuted": lambda: _Permuted(seed),
        "inverted": lambda: _inverted,
        "half": lambda: lambda _t_s, frame: MotorLevels(frame.layout, frame.intensities // 2),
    }
    if name not in arms:
        raise InvalidValueError(f"sham = {name!r} is not known", nearest_hint(name, SHAMS))
    return arms[name]()


class _Unrelated:
    """Front and back follow smooth noise that never saw the grip, spread over 0 to 100 %."""

    def __init__(self, seed: int, layout: Layout) -> None:
        self._rng, self._layout = stream(seed, "sham", "unrelated"), layout
        self._slow = self._rng.standard_normal(2)
        self._number = -1
        self._frame = vest_frame([0.0] * 4, [0.0] * 4, layout=layout)

    def __call__(self, t_s: float, _frame: MotorLevels) -> MotorLevels:
        keep = math.exp(-2 * math.pi * _UNRELATED_HZ * _FRAME_S)
        number = math.floor(t_s / _FRAME_S + 1e-6)
        while self._number < number:
            self._number += 1
            self._slow = keep * self._slow + math.sqrt(1 - keep * keep) * self._rng.standard_normal(2)
            front, back = (50 * math.erfc(-float(s) / math.sqrt(2)) for s in self._slow)
            self._frame = vest_frame([front] * 4, [back] * 4, layout=self._layout)
        return self._frame


def _replayed(recorded: Sequence[tuple[float, MotorLevels]]) -> Sham:
    if not recorded:
        raise InvalidValueError("recorded has no frame", "give the times and frames of another trial")
    times_s = np.array([t_s for t_s, _ in recorded])
    return lambda t_s, _frame: recorded[max(int(np.searchsorted(times_s, t_s, side="right")) - 1, 0)][1]


class _Permuted:
    """Columns exchanged so that no finger keeps its own; the same exchange on both panels."""

    def __init__(self, seed: int) -> None:
        rng = stream(seed, "sham", "permuted")
        order = rng.permutation(4)
        while np.any(order == np.arange(4)):
            order = rng.permutation(4)
        self._order = order
        self._last: tuple[MotorLevels, MotorLevels] | None = None

    def __call__(self, _t_s: float, frame: MotorLevels) -> MotorLevels:
        if self._last is None or self._last[0] is not frame:
            columns = frame.intensities.reshape(-1, 4)[:, self._order]
            self._last = frame, MotorLevels(frame.layout, np.ascontiguousarray(columns).reshape(-1))
        return self._last[1]


def _inverted(_t_s: float, frame: MotorLevels) -> MotorLevels:
    # One per cent is what the printed law shows where nothing is touched.
    displayed = np.where(frame.intensities > 1, 100 - frame.intensities, frame.intensities)
    return MotorLevels(frame.layout, displayed.astype(np.uint8))
