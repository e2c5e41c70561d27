"""Choose the content of the worn vest under each condition of a comparison, with its motors and skin.

``haptic`` shows the loop's frames, ``non-haptic`` nothing, ``event-gated`` pulses at contact, slip and release. The
person knows of the pulses.

The shams carry no information or wrong information (:func:`sham_vest`). Their person has the same instructions as in
the haptic arm, and the same random numbers in everything else: a benefit that a sham shows too comes of being made
careful, and not of the vest's information.

The positive controls show the truth, which no sensor has to measure: a person who gains nothing from them could not
have gained from a vest. ``oracle`` pulses at true slips, ``true-force`` shows the pads' true forces by the law of the
real vest, ``true-steps`` in equal steps of sensation (:mod:`tega.stages.equal_steps`), ``ideal-vest`` in proportion,
on a skin that misses nothing. From one to the next, ``ideal-vest``, ``true-force`` or ``true-steps``, and ``haptic``
with the same mapping add the real vest with its wearer's skin, and the real measurement from camera frames. The sham
of ``oracle`` is ``mistimed``: the pulses of another trial.

``reflex`` has no vest and a reflex that firms the grip (:mod:`tega.loop.reflex`), ``haptic-reflex`` both, with the
settings' reflex or, if they name none, ``grip``. The reflex has the authority of the settings or, if that is 0, full
authority: a reflex of the settings without authority acts in these arms alone. ``true-reflex`` is their positive
control: the same reflex receives the true speed of the slide.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final, Literal, NamedTuple, TypeAlias, get_args

import numpy as np

from tega.errors import InvalidValueError
from tega.haptics import Layout, MotorLevels, vest_frame
from tega.runtime.words import nearest_hint
from tega_sim.operator.person import stream

Condition = Literal[
    "haptic",
    "non-haptic",
    "silent",
    "constant",
    "unrelated",
    "replayed",
    "permuted",
    "inverted",
    "half",
    "unfelt",
    "event-gated",
    "oracle",
    "true-force",
    "true-steps",
    "ideal-vest",
    "mistimed",
    "reflex",
    "haptic-reflex",
    "true-reflex",
]

CONDITIONS: tuple[Condition, ...] = get_args(Condition)
"""Haptic, non-haptic, the sham arms, event-gated, the positive controls, and the arms with a reflex."""

Reports: TypeAlias = Literal[
    "touch", "events", "true slips", "true force", "true force, equal steps", "true force, linear"
]
"""Content of the vest's frames: the loop's measurements, or the truth of the simulated world."""

WornOn: TypeAlias = Literal["own", "clear", "none"]
"""Skin that the motors reach: the person's own, one that misses nothing, or none."""

ShamName = Literal[
    "informative", "off", "silent", "constant", "unrelated", "replayed", "permuted", "inverted", "half"
]
"""Changes of the frames before they are worn; ``informative`` is the real vest."""

_OF_FRAMES: Final = frozenset({"informative", "permuted", "inverted", "half"})
"""Shams that make the worn frame from the frame that the loop made."""

ReflexReports: TypeAlias = Literal["none", "touch", "true slips"]
"""Source of a reflex's slips: the loop's measurements, or the world's truth."""


class Arm(NamedTuple):
    """One condition of a comparison.

    ``reports`` is the content of the frames, ``sham`` what changes them before they are worn
    (:func:`sham_vest`), and ``reflex`` the source of a reflex's slips.
    """

    reports: Reports = "touch"
    sham: ShamName = "informative"
    skin: WornOn = "own"
    reflex: ReflexReports = "none"

    @property
    def pulses(self) -> bool:
        """Whether pulses announce events, which the person knows."""
        return self.reports in {"events", "true slips"}

    @property
    def hangs_on_pictures(self) -> bool:
        """Whether the worn frames, or the reflex, depend on the fingertips' camera frames."""
        return self.reflex == "touch" or (self.reports in {"touch", "events"} and self.sham in _OF_FRAMES)


ARMS: Final[dict[Condition, Arm]] = {
    "haptic": Arm(),
    "non-haptic": Arm(sham="off"),
    "silent": Arm(sham="silent"),
    "constant": Arm(sham="constant"),
    "unrelated": Arm(sham="unrelated"),
    "replayed": Arm(sham="replayed"),
    "permuted": Arm(sham="permuted"),
    "inverted": Arm(sham="inverted"),
    "half": Arm(sham="half"),
    "unfelt": Arm(skin="none"),
    "event-gated": Arm("events"),
    "oracle": Arm("true slips"),
    "true-force": Arm("true force"),
    "true-steps": Arm("true force, equal steps"),
    "ideal-vest": Arm("true force, linear", skin="clear"),
    "mistimed": Arm("true slips", sham="replayed"),
    "reflex": Arm(sham="off", reflex="touch"),
    "haptic-reflex": Arm(reflex="touch"),
    "true-reflex": Arm(sham="off", reflex="true slips"),
}
"""What each condition is."""

SESSION_CONDITIONS: tuple[Condition, ...] = tuple(name for name, arm in ARMS.items() if arm.skin == "own")
"""Those that one person can meet in one session: their own skin stays on."""

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
        raise InvalidValueError(f"sham = {name!r} is not known", nearest_hint(name, arms))
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
