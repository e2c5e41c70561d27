"""Tells slips by the slide of objects with a relief: a rule that was tried and is not in use.

Its weights were fitted on people 1000 to 1022 with a relief of 1 count; ``docs/evidence/shear.md`` says how it does,
and why it is not in use.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from tega.detect import DetectedEvent, Detector, ShearFrame
from tega.detect.detector import Rise, share_of
from tega.detect.settings import FEATURES, HAND_FEATURES, SETTINGS, Rule
from tega.detect.tracks import TwoMeans

__all__ = ["SLIDE_FEATURES", "SLIDE_RULE", "SlideDetector"]

SLIDE_FEATURES: Final = (
    *FEATURES,
    "across",
    "across_before",
    "across_thumb",
    "along",
    "along_thumb",
    "fastest",
    "seen",
)
"""What a slip is seen by where an object shows a relief: those of :data:`FEATURES` and, over the fingers that see it:

- its speed to the right in the picture, where an upright object in the hand slides down (sign times log of 1 +
  millimetres a second): the mean over the fingers but the thumb, that 0.15 s before, and the thumb's;
- likewise down the picture, of the fingers and of the thumb;
- the highest speed in any direction;
- share of the fingers in contact that see it.
"""

SLIDE_RULE: Final = Rule(
    -13.1197,
    (
        0.7166,  # fingers
        0.5413,  # mass
        -4.0227,  # mass_change
        0.8429,  # mass_trend
        0.5486,  # flow
        -0.0573,  # flow_trend
        -0.0242,  # mean_flow
        0.2113,  # peak
        -1.9852,  # peak_change
        -0.369,  # edge_change
        -1.2286,  # lost
        -1.7476,  # gained
        2.9334,  # across
        -0.4578,  # across_before
        1.2914,  # across_thumb
        0.4508,  # along
        0.3751,  # along_thumb
        0.4103,  # fastest
        1.5605,  # seen
    ),
    0.5,
    0.0,
)

_THUMB: Final = "thumb"
_MEANS_S: Final = (0.025, 0.15)
# A frame or two in which the slide is not found is no end of it.
_SEEN_S: Final = 0.06
# A hand that has come down by more than this over 0.35 s puts down what it holds, which may slide then.
_LOWERED_M: Final = 0.003


class _Slide:
    def __init__(self) -> None:
        self.x, self.y = TwoMeans(*_MEANS_S), TwoMeans(*_MEANS_S)
        self.seen_s = -math.inf

    def add(self, t_s: float, shear: ShearFrame) -> None:
        if t_s - self.seen_s > _MEANS_S[1]:
            self.x.forget()
            self.y.forget()
        self.x.add(t_s, shear.slide_x_mm_s)
        self.y.add(t_s, shear.slide_y_mm_s)
        self.seen_s = t_s


class SlideDetector(Detector):
    """Finds slips by the slide as well: in the place of shear, and beside hand and arm unless the hand comes down.

    Args:
        look_ahead_s: As of :class:`~tega.detect.Detector`.
    """

    def __init__(self, *, look_ahead_s: float = 0.0) -> None:
        super().__init__(look_ahead_s=look_ahead_s)
        self._slide: dict[str, _Slide] = {}
        self._rises[SLIDE_RULE] = Rise("slip", SLIDE_RULE, SETTINGS.rest_s, look_ahead_s)
        self._slip_s = -math.inf

    def shear(self, t_s: float, finger: str, shear: ShearFrame) -> None:
        """Take in the shear of a frame of a fingertip, and the slide where one is seen."""
        super().shear(t_s, finger, shear)
        if shear.slide_sure > 0:
            self._slide.setdefault(finger, _Slide()).add(t_s, shear)

    def slide_features(self, t_s: float) -> tuple[float, ...] | None:
        """Return :data:`SLIDE_FEATURES`; ``None`` where no finger sees a slide."""
        on = [finger for finger, one in self._quick.items() if one.touching]
        slides = {
            f: self._slide[f] for f in on if f in self._slide and t_s - self._slide[f].seen_s <= _SEEN_S
        }
        return (*self.features(t_s)[: len(FEATURES)], *_features(slides, len(on))) if slides else None

    def _slip(self, t_s: float) -> list[DetectedEvent]:
        self._remember(t_s)
        seen, slide = self.features(t_s), self.slide_features(t_s)
        by_hand = len(seen) == len(HAND_FEATURES)
        asked = [] if slide is not None and not by_hand else [(self._rule(), seen, self.may_slip)]
        if slide is not None:
            lowered = by_hand and self._height.change < -_LOWERED_M
            asked.append((SLIDE_RULE, slide, self.may_slip and not lowered))
        for rule, what, may in asked:
            share = share_of(rule, what) if self._settled(t_s) and may else 0.0
            found = self._rises[rule].add(t_s, share, void=not may)
            # Two rules tell one slip once.
            if found is not None and t_s - self._slip_s >= SETTINGS.rest_s:
                self._slip_s = t_s
                return [found]
        return []


def _features(slides: Mapping[str, _Slide], n_on: int) -> tuple[float, ...]:
    fingers = [one for finger, one in slides.items() if finger != _THUMB]
    n, thumb = max(len(fingers), 1), slides.get(_THUMB)
    return (
        _signed(sum(one.x.quick for one in fingers) / n),
        _signed(sum(one.x.slow for one in fingers) / n),
        0.0 if thumb is None else _signed(thumb.x.quick),
        _signed(sum(one.y.quick for one in fingers) / n),
        0.0 if thumb is None else _signed(thumb.y.quick),
        math.log1p(max(math.hypot(one.x.quick, one.y.quick) for one in slides.values())),
        len(slides) / n_on,
    )


def _signed(speed_mm_s: float) -> float:
    return math.copysign(math.log1p(abs(speed_mm_s)), speed_mm_s)
