"""Add the reflex to the closure that the participant asks for, within bounds that no reflex can exceed.

The hand is sent both; its own limits come after them. The addition is 0 or more, so it never opens a hand that holds.
It is 0 as soon as the participant opens the hand, and is taken back when the participant loosens the grip.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from threading import Lock
from typing import Final, NamedTuple

from tega.config import ReflexSection, SessionConfig
from tega.config.choose import grip_reflex
from tega.devices.base import SteeredHand
from tega.loop.adapting import on_press
from tega.loop.hand import fresh_angles_rad, hand_closure
from tega.loop.snapshot import LoopView
from tega.records import Contact, Event, ReflexGrip
from tega.records.bus import Bus
from tega.stages.base import Reflex

REFLEX_SEAT: Final = "reflex"
# Up to here the person's own hand is as good as open: a decoder of shares seldom says exactly 1.
_OPEN, _CLOSED = 1.25, 5.0
# Who loosens the own grip by this much means to: an object that is let go of slips, and that is no cause. It is
# forgotten by a level a second; less is the noise and slack of muscles.
_LOOSENED, _FORGOTTEN_PER_S = 0.25, 1.0
# What is taken back, since harm is near or authority is gone, is taken back this fast, levels a second.
_BACK_LEVELS_PER_S: Final = 5.0
# A loop that stood still does not make up for it.
_LONGEST_STEP_S: Final = 0.05


class ReflexDial:
    """Holds the reflex's authority, 0 to 1, which settings, page and button set; for any thread."""

    def __init__(self, authority: float) -> None:
        self._lock = Lock()
        self._authority, self._off = authority, False

    @property
    def authority(self) -> float:
        """Share of the largest addition that the reflex may use now; 0 while the button has taken it away."""
        with self._lock:
            return 0.0 if self._off else self._authority

    @authority.setter
    def authority(self, wanted: float) -> None:
        if math.isfinite(wanted):
            with self._lock:
                self._authority, self._off = min(max(wanted, 0.0), 1.0), False

    def press(self) -> None:
        """Take the authority away, or give it back."""
        with self._lock:
            self._off = not self._off


class ReflexInputs(NamedTuple):
    """Circumstances of the reflex at a tick, which a replay takes from the recording.

    ``allowed`` is whether the run is active, ``measured`` the closure by the hand's joints, levels, ``None`` without.
    """

    authority: float
    allowed: bool
    measured: float | None


class ReflexArc:
    """Asks a reflex at every tick of the hand and adds its bounded wish to the participant's own closure.

    With authority A, bound B (levels) and wish w the addition a goes toward A · B · max(w, 0), up by
    ``rise_levels_per_s`` and down by ``fall_levels_per_s`` at most, or by 5 levels a second where w < 0,
    authority was lowered, the run is not active or the person loosens the own grip; own + a is 5 at most. It
    is asked for nothing and adds nothing with A = 0 and a = 0; a = 0 at once where the person opens the hand
    (own closure 1.25 or less). The target is 0 without a finger that touches, and for up to a second after
    the own closure has fallen by a quarter of a level or more.

    ``snapshot`` returns the circumstances of a tick from its time in nanoseconds; ``notify`` is called with every tick
    at which the reflex was asked or added something. ``added`` is the current addition, ``most_added`` the largest.
    """

    def __init__(
        self,
        reflex: Reflex,
        settings: ReflexSection,
        *,
        snapshot: Callable[[int], ReflexInputs],
        notify: Callable[[ReflexGrip], None] = lambda _reported: None,
    ) -> None:
        self.reflex = reflex
        self._s, self._snapshot, self._notify = settings, snapshot, notify
        self._authority = self.authority = 0.0
        self._t_ns: int | None = None
        self._firmest = 0.0
        self._events: list[Event] = []
        self.added = self.most_added = 0.0
        self.n_added = 0

    def on_event(self, event: Event) -> None:
        """Keep an event of touch for the next tick."""
        if self.reflex.wants_events:
            self._events.append(event)

    def step(self, t_ns: int, own: float, contacts: Callable[[], Mapping[str, Contact]]) -> float:
        """Return the addition of a tick; ``own`` is the person's closure, levels, ``contacts`` returns fresh ones."""
        now = self._snapshot(t_ns)
        authority = self.authority = now.authority
        if authority <= 0 and self.added <= 0:
            self._events.clear()
            self._authority, self._t_ns, self._firmest = 0.0, t_ns, own
            return 0.0
        dt_s = 0.0 if self._t_ns is None else min(max((t_ns - self._t_ns) / 1e9, 0.0), _LONGEST_STEP_S)
        fresh = contacts()
        events, self._events = tuple(self._events), []
        wish = _held(self.reflex.wish(t_ns, own, now.measured, fresh, events))
        holding = own > _OPEN and any(contact.in_contact for contact in fresh.values())
        self._firmest = max(own, self._firmest - _FORGOTTEN_PER_S * dt_s)
        held_back = not now.allowed or self._firmest - own >= _LOOSENED
        target = authority * self._s.most_levels * max(wish, 0.0) if holding and not held_back else 0.0
        back = wish < 0 or held_back or authority < self._authority
        fall = max(_BACK_LEVELS_PER_S, self._s.fall_levels_per_s) if back else self._s.fall_levels_per_s
        added = min(max(target, self.added - fall * dt_s), self.added + self._s.rise_levels_per_s * dt_s)
        if own <= _OPEN:
            added = 0.0
        self.added = min(max(added, 0.0), self._s.most_levels, _CLOSED - own)
        if self.added <= target:
            self._authority = authority
        self._t_ns = t_ns
        self.n_added += self.added > 0
        self.most_added = max(self.most_added, self.added)
        self._notify(
            ReflexGrip(
                t_ns=t_ns,
                own=own,
                added=self.added,
                authority=authority,
                allowed=now.allowed,
                measured=now.measured,
                wish=wish,
                cause=self.reflex.cause,
            )
        )
        return self.added

    def displayed(self, view: LoopView) -> LoopView:
        """Add the reflex's addition and its reason to a view of the loop."""
        text = f"authority {self.authority:.0%}"
        if self.added > 0:
            text = f"+{self.added:.2f} levels added, {text}"
            text += f" ({self.reflex.cause})" if self.reflex.cause else ""
        return view._replace(reflex=text)


def open_reflex(
    config: SessionConfig,
    bus: Bus,
    fingers: Iterable[str],
    *,
    active: Callable[[], bool],
    hand: SteeredHand | None,
    authority: Callable[[], float | None] = lambda: None,
) -> ReflexArc | None:
    """Make the reflex of a run, which publishes every addition; ``None`` where the settings name none.

    ``fingers`` have a sensor; ``hand`` is one that measures its joints. ``authority`` returns the page's choice at each
    tick; ``None`` for that of settings and button.
    """
    reflex, settings = grip_reflex(config.stages, config.session.preset, fingers), config.stages.reflex
    if reflex is None:
        return None
    dial, wanted = ReflexDial(settings.authority), authority()
    on_press(bus, REFLEX_SEAT, dial.press, name="reflex", vital=True)
    closure = hand_closure(config)

    def snapshot(_t_ns: int) -> ReflexInputs:
        nonlocal wanted
        if (now := authority()) != wanted and now is not None:
            wanted = dial.authority = now
        if (share := dial.authority) <= 0 and arc.added <= 0:
            return ReflexInputs(0.0, allowed=True, measured=None)
        angles_rad = None if hand is None else fresh_angles_rad(hand)
        measured = None if angles_rad is None else closure(angles_rad)
        return ReflexInputs(share, active(), measured)

    arc = ReflexArc(reflex, settings, snapshot=snapshot, notify=bus.publish)
    return arc


def _held(wish: float) -> float:
    """Return a wish, which may be anybody's, within its range."""
    return min(max(float(wish), -1.0), 1.0) if math.isfinite(wish) else 0.0
