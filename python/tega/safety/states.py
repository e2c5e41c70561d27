"""Decide the state of a run, by a machine without a clock, a device or a thread, and define its table [safety].

=========  ===================================================  ======================================
state      hand and vest                                        left for
=========  ===================================================  ======================================
idle       the hand opens, the vest rests                       armed, when nothing keeps from arming
armed      likewise                                             active at the start; else back to idle
active     the muscles steer the hand, touch is felt            hold, when something is lost
hold       the hand keeps its level, touch is felt              active, when all is back; idle in the end
stopped    the hand is without force, the vest rests            never
=========  ===================================================  ======================================
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Annotated, Final, Literal, NamedTuple, get_args

import msgspec

_Ms = Annotated[float, msgspec.Meta(ge=0, le=600_000)]


class SafetySection(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Consequences of each hazard. It concerns live devices; recordings do not get lost.

    Attributes:
        emg_lost_ms: Without a block of EMG for so long beyond its time, the hand holds its level.
        hold_ms: So long it holds; then see ``then``.
        then: ``open`` opens the hand when the hold is over, ``keep`` holds until all devices are ready again.
        tactile_lost: ``silent`` goes on with the finger's column silent, ``hold`` holds the level as well.
        vest_lost: ``go-on`` goes on and warns, ``hold`` holds the level.
        late_ms: A loop later than this holds the level.
        settle_ms: So long nothing may be wrong before the run arms or goes on.
        lowest_rate_share: A stream has to come at this share of its rate before the run arms.
        latency_budget_ms: Limit of our own part of the latency from camera to vest, 99 frames of 100.
        joint_budget_ms: Time from a muscle's sample to the first motion of a joint; beyond it an alert names the stage.
    """

    emg_lost_ms: Annotated[float, msgspec.Meta(ge=20, le=5000)] = 150.0
    hold_ms: _Ms = 2000.0
    then: Literal["open", "keep"] = "open"
    tactile_lost: Literal["silent", "hold"] = "silent"
    vest_lost: Literal["go-on", "hold"] = "go-on"
    late_ms: Annotated[float, msgspec.Meta(ge=5, le=5000)] = 100.0
    settle_ms: _Ms = 200.0
    lowest_rate_share: Annotated[float, msgspec.Meta(ge=0, le=1)] = 0.5
    latency_budget_ms: Annotated[float, msgspec.Meta(gt=0, le=1000)] = 5.0
    joint_budget_ms: Annotated[float, msgspec.Meta(gt=0, le=5000)] = 300.0


State = Literal["idle", "armed", "active", "hold", "stopped"]

STATES: Final[tuple[State, ...]] = get_args(State)
"""All states, in the order in which a run without trouble goes through them."""


class Transition(NamedTuple):
    """A change of state; ``t_ns`` counts from the session's start, ``reason`` is for the experimenter."""

    t_ns: int
    state: State
    reason: str


class RunStates:
    """The state machine: takes the current problems, and returns the run's state.

    Args:
        settle_ns: So long nothing may be wrong before the run arms, or goes on after a hold.
        give_up_ns: After so long in hold the run falls back to idle; ``None`` to hold for ever.
        on_change: Called with every transition, in the caller's thread.

    Attributes:
        state: The state now.
        reason: Why it is so.
        since_ns: Since when.

    Example:
        >>> run = RunStates(settle_ns=0, give_up_ns=None)
        >>> run.check(0, wrong={"emg": "emg: no signal yet"}), run.check(1, wrong={}), run.reason
        ('idle', 'active', 'all devices ready')
    """

    def __init__(
        self,
        *,
        settle_ns: int,
        give_up_ns: int | None,
        on_change: Callable[[Transition], None] = lambda _change: None,
    ) -> None:
        self._settle_ns = settle_ns
        self._give_up_ns = give_up_ns
        self._on_change = on_change
        self._clear_ns: int | None = None
        self.state: State = "idle"
        self.reason = "not looked yet"
        self.since_ns = 0

    def check(
        self, t_ns: int, *, wrong: Mapping[str, str], holding: Mapping[str, str] = {}, go: bool = True
    ) -> State:
        """Update the state with the current problems; ``t_ns`` counts from the session's start, never back.

        ``wrong`` are reasons, by name, that keep the run from becoming active; ``holding`` those that keep an
        active run from going on, counted to ``wrong`` as well. ``go``: an armed run may become active.
        """
        every = {**wrong, **holding}
        if every:
            self._clear_ns = None
        elif self._clear_ns is None:
            self._clear_ns = t_ns
        clear = self._clear_ns is not None and t_ns - self._clear_ns >= self._settle_ns
        if self.state == "idle" and not clear and self.reason != (text := _text(every)):
            self.reason = text
        if self.state == "armed" and every:
            self._enter(t_ns, "idle", _text(every))
        elif self.state == "active" and holding:
            self._enter(t_ns, "hold", _text(holding))
        elif self.state == "hold" and not clear:
            if holding:
                self.reason = _text(holding)
            if self._give_up_ns is not None and t_ns - self.since_ns >= self._give_up_ns:
                self._enter(t_ns, "idle", f"{_text(every)}; held for {self._give_up_ns / 1e9:g} s")
        elif self.state == "hold":
            self._enter(t_ns, "active", "all devices ready again")
        if self.state == "idle" and clear:
            self._enter(t_ns, "armed", "all devices ready")
        if self.state == "armed" and go:
            self._enter(t_ns, "active", self.reason)
        return self.state

    def stop(self, t_ns: int, reason: str) -> None:
        """End the run, whatever its state; a second time changes nothing."""
        if self.state != "stopped":
            self._enter(t_ns, "stopped", reason)

    def _enter(self, t_ns: int, state: State, reason: str) -> None:
        self.state, self.reason, self.since_ns = state, reason, t_ns
        self._on_change(Transition(t_ns, state, reason))


def _text(wrong: Mapping[str, str]) -> str:
    return "; ".join(wrong.values()) or "confirming that all devices are stable"
