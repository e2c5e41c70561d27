"""Find which way the operator calls forward, and which way the robot's base points as the operator sees it.

Forward comes from two movements of the forearm, the second of which checks the first; the base's way from an answer, or
from a third movement.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Final

import numpy as np

from tega.arm.heading import ForearmSweep, ForwardCheck, check_forward, kept_yaw, yaw_from_sweep
from tega.devices.base import Tracker
from tega.errors import CalibrationError
from tega.runtime.guide import Bar, Guide, Undecided
from tega.setup.calibration.sitting import until_good

WAIT_S: Final = 30.0
"""Time to wait for a movement."""

_POLL_S: Final = 0.02
_FULL_M: Final = 0.2

_BASE_POINTS: Final = {"a": 0.0, "l": math.pi / 2, "t": math.pi, "r": -math.pi / 2}
_BASE_ANSWERS: Final = {
    "a": "away from you",
    "t": "towards you",
    "l": "to your left",
    "r": "to your right",
    "s": "another way, which you show by a movement",
}


def take_heading(tracker: Tracker, guide: Guide) -> tuple[float, ForwardCheck]:
    """Lead through both movements, again until the second comes out forward: a wrong heading is not kept.

    Return the heading of the operator's forward, as in ``arm.mapping.yaw_rad``, and the result of its check.
    """

    def attempt() -> tuple[float, ForwardCheck]:
        try:
            guide.ready(
                "Hold the forearm still where you work, facing the way you will look; then move it straight forward "
                "by 20 cm and stop"
            )
            found = watch_sweep(tracker, WAIT_S, yaw_rad=None, displayed=_displayed(guide))
            yaw_rad = kept_yaw(yaw_from_sweep(found.places, frame=tracker.frame))
            guide.say(f"forward is {math.degrees(yaw_rad):+.0f}° off the tracker's own")
            guide.ready("Go back and hold still; then move it forward once more: this is the check")
            again = watch_sweep(tracker, WAIT_S, yaw_rad=yaw_rad, displayed=_displayed(guide))
        except CalibrationError as error:
            return 0.0, ForwardCheck(ok=False, off_rad=0.0, words=_said(error))
        return yaw_rad, check_forward(again.places, frame=tracker.frame, yaw_rad=yaw_rad)

    # A heading that its own check says is wrong would lead the arm another way than the person means.
    taken, _ = until_good(
        guide,
        "forward",
        attempt,
        lambda taken: () if taken[1].ok else (taken[1].words,),
        can_keep=lambda _taken: False,
    )
    return taken


def take_base_yaw(tracker: Tracker, guide: Guide, *, yaw_rad: float, reported_rad: float) -> float:
    """Ask which way the robot's base points as the operator sees it, or measure it by a forearm's movement.

    Return it as in ``arm.mapping.base_yaw_rad``; ``reported_rad`` where there is no answer.
    """
    try:
        answer = guide.ask(
            "Seen from where you work, which way does the robot's base point, from its column to where its hand works?",
            _BASE_ANSWERS,
        )
    except Undecided:
        return reported_rad
    if answer in _BASE_POINTS:
        return kept_yaw(_BASE_POINTS[answer])

    def attempt() -> tuple[float, str]:
        guide.ready("Hold the forearm still; then move it by 20 cm the way the robot's base points, and stop")
        try:
            found = watch_sweep(tracker, WAIT_S, yaw_rad=yaw_rad, displayed=_displayed(guide))
            seen_rad = yaw_from_sweep(found.places, frame=tracker.frame) - yaw_rad
        except CalibrationError as error:
            return 0.0, _said(error)
        return kept_yaw(math.remainder(seen_rad, 2 * math.pi)), ""

    (base_yaw_rad, _), _ = until_good(
        guide, "base", attempt, lambda one: (one[1],) if one[1] else (), can_keep=lambda _one: False
    )
    guide.say(f"the base points {math.degrees(base_yaw_rad):+.0f}° to the left of your forward")
    return base_yaw_rad


def watch_sweep(
    tracker: Tracker,
    seconds: float,
    *,
    yaw_rad: float | None,
    displayed: Callable[[ForearmSweep, float], None],
) -> ForearmSweep:
    """Wait for a movement of the forearm that comes to rest; ``CalibrationError`` if there was none."""
    sweep = ForearmSweep(tracker.frame, yaw_rad=yaw_rad or 0.0)
    tracker.read(time.monotonic_ns())  # what came before is not of this movement
    end_s = time.monotonic() + seconds
    while not sweep.done and (left_s := end_s - time.monotonic()) > 0:
        for pose in tracker.read(time.monotonic_ns()):
            sweep.take(pose)
        displayed(sweep, left_s)
        time.sleep(_POLL_S)
    if sweep.done:
        return sweep
    if not sweep.places:
        raise CalibrationError(
            f"the forearm was not seen within {seconds:g} s",
            tracker.problem or "is it in the tracker's sight?",
        )
    gone_cm = 100 * float(np.linalg.norm(sweep.gone_m))
    raise CalibrationError(
        f"no movement that came to rest was seen within {seconds:g} s; the forearm is {gone_cm:.0f} cm from its start",
        "move it straight forward by 20 cm, then hold it still",
    )


def _displayed(guide: Guide) -> Callable[[ForearmSweep, float], None]:
    def show(sweep: ForearmSweep, left_s: float) -> None:
        gone_m = float(np.linalg.norm(sweep.gone_m))
        guide.show("FORWARD", [Bar("gone", min(1.0, gone_m / _FULL_M), f"{100 * gone_m:.0f} cm")], left_s)

    return show


def _said(error: CalibrationError) -> str:
    return f"{error.message}: {error.hint}" if error.hint else error.message
