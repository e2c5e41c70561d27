"""Make the contacts of the tasks, and the frames in which a mapping shows them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from tega.config.choose import Chosen
from tega.config.sections import StageConfig
from tega.haptics import FINGERS, FeltMap, MotorLevels
from tega.haptics.motor_layout import X40
from tega.records import Contact, Event
from tega.stages.base import VestSetup

from .skin import REFRESH_S

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tega_sim.operator.sections import VestSection


MAXIMA: Final = {finger: {"cci": 0.1, "eda": 8000.0} for finger in FINGERS}
_LEAD_S = 0.2


class Touch(NamedTuple):
    """How one finger touches: CCI and EDA as shares of their maxima, and how far down the picture its middle is."""

    cci: float
    eda: float
    down: float = 0.5


Scene = Callable[[float], Mapping[str, Touch]]
"""Touches of a time, seconds from the presentation's beginning; the fingers that are not named are free."""


class Stimulus(NamedTuple):
    """Contacts over a presentation.

    Attributes:
        scene: The touches.
        lasts_s: How long.
        slips_s: Times at which the index finger slips.
    """

    scene: Scene
    lasts_s: float = 1.5
    slips_s: tuple[float, ...] = ()


class ComparedMapping(NamedTuple):
    """A mapping as it is compared.

    Attributes:
        label: Name in table and picture.
        name: The stage.
        options: Its options.
        personal: Whether threshold and step of the person are measured and in use.
    """

    label: str
    name: str
    options: dict[str, Any]
    personal: bool = True


COMPARED: Final = (
    ComparedMapping("columns, nothing measured", "columns", {}, personal=False),
    ComparedMapping("columns", "columns", {}),
    ComparedMapping("equal-steps", "equal-steps", {}),
    ComparedMapping("equal-steps, slip row", "equal-steps", {"slip_row": "bottom"}),
    ComparedMapping("changes", "changes", {"law": "linear"}),
    ComparedMapping("changes, reminded 1 s in 4 s", "changes", {"law": "linear", "remind_every_s": 4.0}),
    ComparedMapping("changes, slip row", "changes", {"law": "linear", "slip_row": "bottom"}),
    ComparedMapping("place", "place", {"law": "linear"}),
    ComparedMapping("slip-row", "slip-row", {"law": "linear"}),
    ComparedMapping("pulses", "pulses", {}),
)


def felt_by(person: VestSection) -> FeltMap:
    """Return what calibration would find of a simulated person: the level felt by half of the looks, and their step."""
    threshold = 100 * person.threshold
    return FeltMap(threshold=threshold, step=min(person.weber * (threshold + 100) / 2, 100.0))


def frames(displayed: ComparedMapping, person: VestSection, stimulus: Stimulus) -> list[MotorLevels]:
    """Return the frames of a stimulus, one every ``REFRESH_S``, after a moment without touch.

    Events are told as the detector would: contact and release with the touch itself, slip at its time.
    """
    felt = felt_by(person) if displayed.personal else None
    chosen = Chosen("mapping", StageConfig(name=displayed.name, options=displayed.options), "live")
    mapping = chosen.make(VestSetup(X40, FINGERS, MAXIMA, felt))
    found = []
    touching: set[str] = set()
    for n in range(round((_LEAD_S + stimulus.lasts_s) / REFRESH_S)):
        t_ns = round(n * REFRESH_S * 1e9)
        at_s = n * REFRESH_S - _LEAD_S
        touches = stimulus.scene(at_s) if at_s >= -1e-9 else {}
        now = {finger for finger, touch in touches.items() if touch.eda > 0}
        events = [Event(t_ns=t_ns, finger=f, kind="contact", confidence=1.0) for f in sorted(now - touching)]
        events += [Event(t_ns=t_ns, finger=f, kind="release", confidence=1.0) for f in sorted(touching - now)]
        events += [
            Event(t_ns=t_ns, finger="index", kind="slip", confidence=1.0)
            for slip_s in stimulus.slips_s
            if at_s - REFRESH_S / 2 <= slip_s < at_s + REFRESH_S / 2
        ]
        touching = now
        contacts = {f: _contact(f, t_ns, touches.get(f, Touch(0, 0))) for f in FINGERS}
        levels = mapping.levels(t_ns, contacts, events if mapping.wants_events else ())
        frame = MotorLevels("x40", np.rint(np.clip(levels, 0, 100)).astype(np.uint8))
        found.append(frame if felt is None or mapping.evens_out else felt.apply(frame))
    return found


def steps(made: Sequence[MotorLevels]) -> NDArray[np.uint8]:
    """Return the steps that reach the motors, uint8 (frames, 40)."""
    return np.array([frame.levels for frame in made])


def _contact(finger: str, t_ns: int, touch: Touch) -> Contact:
    on = touch.eda > 0
    return Contact(
        finger=finger,
        t_ns=t_ns,
        in_contact=on,
        cci=0.1 * touch.cci if on else 0.0,
        eda=round(8000 * touch.eda) if on else 0,
        centroid_xy=(159.5, 239 * touch.down) if on else (math.nan, math.nan),
    )


def touch_of(finger: str, touch: Touch, *, from_s: float = 0.0, until_s: float = 1.0) -> Scene:
    """Return one even touch of a finger."""
    return lambda t_s: {finger: touch} if from_s - 1e-9 <= t_s < until_s - 1e-9 else {}


def _held(then: float) -> Scene:
    def scene(t_s: float) -> Mapping[str, Touch]:
        share = 0.6 if t_s < 1.5 - 1e-9 else then
        return {"index": Touch(share, share)}

    return scene


_FIRM = (0.4, 0.9)
_KINDS = ((1.0, 0.4), (0.4, 1.0))

TASKS: Final[dict[str, tuple[Stimulus, ...]]] = {
    "firmness": tuple(
        Stimulus(touch_of("index", Touch(share, share))) for share in np.linspace(0.125, 1, 8).tolist()
    ),
    "finger": tuple(Stimulus(touch_of(finger, Touch(0.6, 0.6))) for finger in FINGERS),
    "focal, broad": tuple(
        Stimulus(touch_of("index", Touch(*kind))) for kind in ((0.9, 0.3), (0.3, 0.9), (0.6, 0.6))
    ),
    "place": tuple(Stimulus(touch_of("index", Touch(0.6, 0.6, down))) for down in (0.1, 0.5, 0.9)),
    "slip": tuple(
        Stimulus(touch_of("index", Touch(0.6, 0.6), until_s=2.5), 2.5, slips) for slips in ((), (1.5,))
    ),
    "change": tuple(Stimulus(_held(then), 2.5) for then in (0.6, 0.75, 0.45)),
    "all": tuple(
        Stimulus(touch_of(finger, Touch(cci * firm, eda * firm)), slips_s=slips)
        for finger in FINGERS
        for firm in _FIRM
        for cci, eda in _KINDS
        for slips in ((), (0.5,))
    ),
}
"""What is presented in each task; every stimulus is equally likely."""


def firmness(share: float) -> Stimulus:
    """Return an even touch of a firmness, for difference thresholds."""
    return Stimulus(touch_of("index", Touch(share, share)))


def grasps(lasts_s: float) -> Stimulus:
    """Return grasps with all fingers, 15 s each and 5 s apart, each with two corrections of firmness and one slip."""

    def scene(t_s: float) -> Mapping[str, Touch]:
        into_s = t_s % 20.0
        if into_s >= 15:
            return {}
        share = 0.6 if into_s < 5 else 0.7 if into_s < 10 else 0.55
        return {finger: Touch(share, share) for finger in FINGERS}

    return Stimulus(scene, lasts_s, tuple(7.0 + 20 * n for n in range(int(lasts_s // 20))))


def holding(lasts_s: float) -> Stimulus:
    """Return one grasp with all fingers that is never let go."""
    return Stimulus(lambda _t_s: {finger: Touch(0.6, 0.6) for finger in FINGERS}, lasts_s)
