"""Exchange signals and samples of a running trial between threads, and measure lift and drop by arm and fingertips."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Final, Literal, NamedTuple

import numpy as np

from tega.hand.mjcf import tip_heights_mm
from tega.hand.poses import ClosureScale
from tega.loop.snapshot import LoopView
from tega.records import MuscleCondition
from tega.runtime.clock import Clock
from tega.stages.events.settings import SETTINGS
from tega_study.attempt_rows import HandRow, TouchRow
from tega_study.coupling import TouchCourse

ARM: Final = "arm"
"""Source of events that were measured so."""

LOST_S: Final = 0.5
"""Time without any contact after which the object is no longer in the hand, seconds: light contacts flicker."""

IN_AIR_M: Final = 0.03
"""Height from which an object that leaves the hand is dropped and not put down, metres (as for a scene camera)."""


class LiftCheck(NamedTuple):
    """Height above the place where the object was grasped, 0 if nothing is held.

    ``dropped_s`` is when it left the hand in the air, at the reading that confirms it; else ``None``.
    """

    height_m: float
    dropped_s: float | None


class ArmLift:
    """Follows a held object. Its height is the arm's height less that at which it was grasped.

    The arm cannot detect whether the hand holds something. The fingertips do, and the joints if they are measured: a
    hand that lags behind its command presses on something.
    """

    def __init__(self) -> None:
        self._base_m: float | None = None
        self._held_s = 0.0

    def check(
        self,
        t_s: float,
        arm_m: float,
        *,
        touching: bool | None,
        level: float | None = None,
        closure: float | None = None,
    ) -> LiftCheck:
        """Take in one reading of hand and arm; ``t_s`` is never less than before.

        ``arm_m`` is the height of the arm's end. ``touching``: whether any fingertip is in contact, ``None``
        if none delivers frames now. ``level`` is the commanded closure level, ``closure`` the measured one.
        """
        lag = 0.0 if level is None or closure is None or level <= 1 else level - closure
        unknown = touching is None and self._base_m is not None
        if touching or unknown or lag > SETTINGS.pressed_levels:
            self._held_s = t_s
            self._base_m = arm_m if self._base_m is None else min(self._base_m, arm_m)
        if self._base_m is None:
            return LiftCheck(0.0, None)
        height_m = arm_m - self._base_m
        if t_s - self._held_s < LOST_S:
            return LiftCheck(height_m, None)
        self._base_m = None
        return LiftCheck(0.0, self._held_s if height_m >= IN_AIR_M else None)


SeenKind = Literal["height", "drop", "slip", "deformation", "mark"]


class TrialSeen(NamedTuple):
    """Height in metres (``value``), slip or other event, at ``t_s`` since the trial's start; ``mark`` is a pedal.

    ``source`` is ``auto`` if the bench knows it, ``arm`` if it was measured by arm and fingertips.
    """

    kind: SeenKind
    t_s: float
    value: float = 0.0
    source: str = "auto"


class Going:
    """Passes signals and data of one trial between bench and lead. The bench's methods return at once.

    ``feel``: whether the vest shows touch in this trial; ``own_time``: whether time is the bench's own
    (simulated), not the clock's; ``closure``: reads how closed the hand is off its joints; ``measure_lift``:
    whether to measure lift and drop by arm and fingertips.

    Attributes:
        state: A description of the preparation, then ``armed``, then ``active``.
        started_ns: When the trial began, on the session's clock; ``zero_ns`` when the bench's own count did.
        touch: Every new contact since the trial's start.
        hand: State of hand and arm at each look at the loop since then.
        condition: Condition of the muscles at each second of effort since then.
    """

    def __init__(
        self,
        clock: Clock,
        *,
        feel: bool,
        own_time: bool = False,
        closure: ClosureScale | None = None,
        measure_lift: bool = False,
    ) -> None:
        self._clock = clock
        self._lift = ArmLift() if measure_lift else None
        self._closure = closure
        self.hand: list[HandRow] = []
        self._feel = feel
        self._own_time = own_time
        self._go, self._over = threading.Event(), threading.Event()
        self._view_zero_ns = self._newest_ns = 0
        self._seen: deque[TrialSeen] = deque()
        self._rows: list[tuple[float, float, float, float]] = []
        self.touch: list[TouchRow] = []
        self._newest_touch: dict[str, int] = {}
        self._presses = 0
        self.condition: list[MuscleCondition] = []
        self.state, self.reason = "preparing", ""
        self.alerts: tuple[str, ...] = ()
        self.started_ns: int | None = None
        self.zero_ns: int | None = None

    # The bench's side.

    def preparing(self, subject: str, done: int, total: int) -> None:
        """Take in how preparation goes."""
        self.reason = f"{subject} {done} of {total}" if total else subject

    def notify(self, state: str, reason: str = "") -> None:
        """Take in the bench's state."""
        self.state, self.reason = state, reason

    def may_go(self) -> bool:
        """Return whether the countdown is over."""
        return self._go.is_set()

    def begin(self, at_ns: int) -> None:
        """Mark the trial's beginning, now; only the first call counts."""
        if self.started_ns is None:
            self._view_zero_ns = self._newest_ns = at_ns
            now_ns = self._clock.now_ns()
            self.zero_ns, self.started_ns = now_ns - at_ns, now_ns

    def view(self, view: LoopView) -> None:
        """Take in the loop's view, at every tick of the vest."""
        self.alerts = tuple(view.alerts)
        if view.state:
            self.notify(view.state, view.reason)
        pedal = view.inputs.get("marker")
        pressed, self._presses = self._presses, 0 if pedal is None else pedal.n_presses
        if self.started_ns is None or self._over.is_set():
            return
        t_s = (view.t_ns - self._view_zero_ns) / 1e9
        self._newest_ns = view.t_ns
        if self._presses > pressed:
            self._seen.append(TrialSeen("mark", t_s))
        for finger, contact in view.contacts.items():
            at_ns = contact.t_ns
            if self._newest_touch.get(finger) != at_ns >= self._view_zero_ns:
                self._newest_touch[finger] = at_ns
                since_s, places = (at_ns - self._view_zero_ns) / 1e9, contact.centroid_xy
                seen = int(contact.in_contact), contact.eda, contact.mass, contact.peak
                self.touch.append(TouchRow(since_s, finger, *seen, *places))
        row = self._hand_row(t_s, view)
        self.hand.append(row)
        fresh_ns = view.t_ns - round(SETTINGS.stale_s * 1e9)
        now = [contact.in_contact for contact in view.contacts.values() if contact.t_ns >= fresh_ns]
        self._measure(row, touching=any(now) if now else None)
        if view.intent is not None:
            touching = [contact for contact in view.felt.values() if contact.in_contact]
            cci = sum(contact.cci_norm for contact in touching) / max(len(touching), 1)
            eda = sum(contact.eda_norm for contact in touching) / max(len(touching), 1)
            self._rows.append((t_s, cci, eda, view.intent.level - 1.0))

    def _measure(self, row: HandRow, *, touching: bool | None) -> None:
        if self._lift is None or row.height_m is None:
            return
        height_m, dropped_s = self._lift.check(
            row.t_s, row.height_m, touching=touching, level=row.level, closure=row.closure
        )
        self._seen.append(TrialSeen("height", row.t_s, height_m, ARM))
        if dropped_s is not None:
            self._seen.append(TrialSeen("drop", dropped_s, source=ARM))

    def _hand_row(self, t_s: float, view: LoopView) -> HandRow:
        closure = tips_mm = None
        if self._closure is not None and view.angles_rad is not None:
            angles_rad = np.asarray(view.angles_rad)
            if np.isfinite(angles_rad).all():  # a hand that has reported none yet has NaN
                closure, tips_mm = self._closure(angles_rad), tip_heights_mm(angles_rad)
        level = None if view.intent is None else view.intent.level
        return HandRow(t_s, level, closure, view.arm_height_m, tips_mm)

    def observe(self, kind: SeenKind, t_ns: int, value: float = 0.0) -> None:
        """Take in something seen at a moment in the bench's own count of time, such as a height in metres."""
        if self.started_ns is not None:
            self._seen.append(TrialSeen(kind, (t_ns - self._view_zero_ns) / 1e9, value))

    def muscles(self, condition: MuscleCondition) -> None:
        """Take in the condition of the muscles, once a second of effort."""
        if self.started_ns is not None and not self._over.is_set():
            self.condition.append(condition)

    def over(self) -> bool:
        """Return whether the trial is over."""
        return self._over.is_set()

    def feel(self) -> bool:
        """Return whether the vest may show touch now; before and after the trial it shows nothing."""
        return self._feel and self.started_ns is not None and not self._over.is_set()

    # The lead's side.

    def go(self) -> None:
        """Let the trial begin."""
        self._go.set()

    def end(self) -> None:
        """End the trial."""
        self._over.set()

    def elapsed_s(self) -> float:
        """Return the time since the trial's start, seconds; 0 before."""
        if self.started_ns is None:
            return 0.0
        if self._own_time:
            return (self._newest_ns - self._view_zero_ns) / 1e9
        return (self._clock.now_ns() - self.started_ns) / 1e9

    def seen(self) -> list[TrialSeen]:
        """Return the events seen since the last call, in their order."""
        found = []
        while self._seen:
            found.append(self._seen.popleft())
        return found

    def course(self) -> TouchCourse:
        """Return touch and pose since the trial's start; times that do not rise by a millisecond are left out."""
        rows: list[tuple[float, float, float, float]] = []
        for row in list(self._rows):
            if not rows or row[0] - rows[-1][0] > 1e-3:
                rows.append(row)
        return TouchCourse(*np.array(rows, dtype=np.float64).reshape(-1, 4).T)


def in_thread(work: Callable[[], None]) -> tuple[threading.Thread, list[BaseException]]:
    """Start work in a thread; an exception that it raises is appended to the list."""
    raised: list[BaseException] = []

    def run() -> None:
        try:
            work()
        except BaseException as error:  # handed on by the lead
            raised.append(error)

    thread = threading.Thread(target=run, name="tega-trial", daemon=True)
    thread.start()
    return thread, raised
