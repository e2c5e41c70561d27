"""Turn forearm poses into one target for the arm, at whatever rate it is asked."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tega.arm.frames import Clutch, PoseFilter, ToBase
from tega.arm.gate import ArmWatch, Level, PoseGate, Trouble, malformed
from tega.arm.motion import Follower
from tega.arm.pose import ArmCommand, ArmState, Pose, StampedPose
from tega.arm.rotation import unit
from tega.arm.settings import ArmSettings, checked
from tega.arm.workspace import Workspace, clipped

_AGAIN = "; let the clutch go and press it again"


class ArmChain:
    """Gate, axes, filter, clutch, workspace, clip, limits, watchdogs; no clock, no thread, no device.

    The operator engages by pressing the clutch with the dead-man switch held; the target then follows the
    forearm. :attr:`ArmCommand.state` and ``reason`` give the state and its cause. The target never leaves box
    and cone and never exceeds the limits of speed and acceleration, for any input. ``doubt`` is why poses
    that come are not believed now; ``""`` while they are, and where none come. A setting out of its range
    raises ``InvalidValueError``.
    """

    def __init__(self, settings: ArmSettings | None = None) -> None:
        self._s = s = checked(settings or ArmSettings())
        self._gate, self._filter, self._watch = PoseGate(s.gate), PoseFilter(s.filter), ArmWatch(s.watchdog)
        self._to_base, self._clutch = ToBase(s.mapping), Clutch(s.mapping)
        self._workspace = Workspace(s.limits)
        self._state: ArmState = "idle"
        self._reason = "the operator has not taken hold yet"
        self._now_ns: int | None = None
        self._unfiltered: tuple[int, Pose] | None = None
        self._hand: Pose | None = None
        self._measured: Pose | None = None
        self._follower: Follower | None = None
        self._rest: Pose | None = None
        self._engagements = 0
        self._was_open = False  # the clutch was seen open since it was last lost
        self._attached = False  # an operator has taken hold and not let go since
        self.doubt = ""

    def step(
        self,
        now_ns: int,
        poses: Sequence[StampedPose] = (),
        *,
        clutch: bool,
        dead_man: bool,
        measured: StampedPose | None = None,
    ) -> ArmCommand:
        """Process new inputs, and return the command to the arm.

        ``now_ns`` is on the clock of the stamps; time that goes back lets the arm go. ``poses`` are the
        forearm's since the last call, in the tracker's axes, oldest first. ``measured`` is a new measured
        pose of the hand, base's axes, if there is one.
        """
        dt_s = 0.0 if self._now_ns is None else (now_ns - self._now_ns) / 1e9
        if dt_s < 0:
            self._start_over("the clock went back")
            dt_s = 0.0
        self._now_ns = now_ns
        self._observe_arm(now_ns, measured)
        before = self._observe_poses(now_ns, poses)
        trouble = self._watch.trouble(now_ns, 1e3 * dt_s)
        doubt = max(before, self._watch.with_poses(now_ns), key=lambda t: t.level)
        self.doubt = "" if doubt.silent else doubt.reason
        if self._attached and before.level > trouble.level and before.level == Level.LOSE:
            trouble = before
        self._was_open |= not clutch
        if self._state in {"following", "holding"}:
            self._go_on(trouble, clutch=clutch, dead_man=dead_man)
        elif self._state == "idle":
            self._wait(trouble, clutch=clutch, dead_man=dead_man)
        if self._follower is not None and dt_s > 0:
            self._move(self._follower, now_ns, dt_s)
        return self._command(now_ns)

    def stop(self, reason: str) -> None:
        """Let the arm go: the driver ends with damping. Only :meth:`clear` leads on."""
        self._state, self._reason, self._follower = "stopped", reason, None

    def clear(self) -> None:
        """Go back to idle, once a person has seen that it is safe; the next target begins at the measured pose."""
        if self._state == "stopped":
            self._state, self._reason = "idle", "the operator has not taken hold yet"
            self._attached = self._was_open = False

    def _start_over(self, reason: str) -> None:
        """Forget everything that hangs on the clock."""
        self._gate, self._unfiltered, self._measured = PoseGate(self._s.gate), None, None
        self._filter.forget()
        self._watch.forget()
        if self._state in {"following", "holding"}:
            self._lose(reason)

    def _observe_arm(self, now_ns: int, measured: StampedPose | None) -> None:
        if measured is None or malformed(measured, self._s.gate):
            return
        if measured.t_ns <= now_ns + self._s.gate.ahead_ms * 1e6:
            self._watch.arm(measured.t_ns)
            self._measured = Pose(
                np.array(measured.position_m, np.float64),
                unit(np.array(measured.quaternion_xyzw, np.float64)),
            )

    def _observe_poses(self, now_ns: int, poses: Sequence[StampedPose]) -> Trouble:
        """Process poses; return the trouble with them so far."""
        before = self._watch.with_poses(now_ns)
        if before.level >= Level.LOSE:  # the next pose may be anywhere, and has to be taken hold of
            self._gate.forget()
            self._filter.forget()
            self._watch.forget_jumps()
        for pose in poses:
            refusal = self._gate.refusal(pose, now_ns)
            if refusal:
                self._watch.refused(now_ns, refusal)
            else:
                self._watch.believed(pose.t_ns)
                self._unfiltered = pose.t_ns, self._to_base(pose)
                self._hand = self._filter.step(*self._unfiltered)
        return before

    def _go_on(self, trouble: Trouble, *, clutch: bool, dead_man: bool) -> None:
        if trouble.level == Level.STOP:
            self.stop(trouble.reason)
        elif not clutch:
            self._let_go("idle", "the clutch is open")
            self._attached = False
        elif trouble.level == Level.LOSE:
            self._lose(trouble.reason)
        elif trouble.level == Level.HOLD:
            self._let_go("holding", trouble.reason, at_measured=trouble.silent)
        elif not dead_man:
            self._let_go("holding", "the dead-man switch is released")
        elif self._state == "holding":
            self._take_hold()

    def _wait(self, trouble: Trouble, *, clutch: bool, dead_man: bool) -> None:
        if not clutch:
            self._attached = False
        if self._attached and trouble.level == Level.STOP:
            self.stop(trouble.reason)
        elif not clutch:
            self._reason = trouble.reason or "the clutch is open"
        elif not self._was_open:
            if not self._reason.endswith(_AGAIN):
                self._reason = "the clutch was pressed from the start" + _AGAIN
        elif trouble.level:
            self._reason = trouble.reason
        elif not dead_man:
            self._reason = "hold the dead-man switch"
        else:
            self._take_hold()

    def _take_hold(self) -> None:
        assert self._unfiltered is not None  # no trouble: both were received
        assert self._measured is not None
        if self._follower is None:
            outside = self._workspace.outside(self._measured)
            if outside:
                self._reason = f"{outside}; guide it back"
                return
            self._follower = Follower(self._s.limits, self._workspace, self._measured)
        # What the filter still owes of motion before is not part of what follows.
        self._filter.forget()
        self._hand = self._filter.step(*self._unfiltered)
        # From where it will be at rest: a target that is still braking does not turn round.
        absolute = self._s.mapping.absolute
        self._clutch.latch(self._hand, self._hand if absolute else self._follower.resting())
        self._state, self._reason = "following", "the arm follows the forearm"
        self._engagements += 1
        self._attached, self._was_open = True, False

    def _let_go(self, state: ArmState, reason: str, *, at_measured: bool = False) -> None:
        """Bring the target to rest: where braking ends, or at the measured pose."""
        if self._state == "following" and self._follower is not None:
            rest = self._follower.resting()
            if at_measured and self._measured is not None:
                rest = self._workspace.inside(self._measured)
            self._rest = rest
        self._state, self._reason = state, reason

    def _lose(self, reason: str) -> None:
        self._let_go("idle", reason + _AGAIN)
        self._was_open = False

    def _move(self, follower: Follower, now_ns: int, dt_s: float) -> None:
        if 1e3 * dt_s > self._s.watchdog.late_ms:
            follower.brake(dt_s)
            return
        measured = self._measured if self._watch.arm_is_fresh(now_ns) else None
        following = self._state == "following"
        if following:
            assert self._hand is not None
            requested = self._clutch.goal(self._hand)
            goal = self._workspace.inside(requested)
            if goal is not requested and not self._s.mapping.absolute:
                self._clutch.shed(requested, goal)
        else:
            goal = self._rest or follower.resting()
        if measured is not None:
            near = clipped(goal, measured, self._s.limits)
            goal = goal if near is goal else self._workspace.inside(near)
        follower.step(goal, dt_s, measured)

    def _command(self, now_ns: int) -> ArmCommand:
        f = self._follower
        return ArmCommand(
            now_ns,
            self._state,
            self._reason,
            None if f is None else f.pose,
            np.zeros(3) if f is None else f.velocity_m_s,
            np.zeros(3) if f is None else f.velocity_rad_s,
            self._engagements,
        )


class Turn(NamedTuple):
    """Inputs of one turn of the loop that steers an arm.

    Attributes:
        t_ns: When, on the clock of the stamps.
        poses: Forearm poses since the last turn, in the tracker's axes.
        may_move: Whether the run lets the arm move.
        measured: New measured pose of the hand, if there is one.
        stopped: Why the arm is to stop now; ``""`` if it is not to.
        cleared: Whether a person has allowed it to go on.
    """

    t_ns: int
    poses: tuple[StampedPose, ...] = ()
    clutch: bool = False
    dead_man: bool = False
    may_move: bool = False
    measured: StampedPose | None = None
    stopped: str = ""
    cleared: bool = False


def lead(chain: ArmChain, turn: Turn) -> ArmCommand:
    """Give a chain the inputs of one turn: all that a run does with the chain is here."""
    if turn.stopped:
        chain.stop(turn.stopped)
    elif turn.cleared:
        chain.clear()
    command = chain.step(
        turn.t_ns,
        turn.poses,
        clutch=turn.clutch,
        dead_man=turn.dead_man and turn.may_move,
        measured=turn.measured,
    )
    if command.state == "holding" and turn.dead_man and not turn.may_move:
        command = command._replace(reason="the run is not active")
    return command
