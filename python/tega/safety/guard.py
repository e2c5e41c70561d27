"""Watch a run from inside its loop: find lost, stale, slow or late streams, and decide the run's state."""

from __future__ import annotations

import math
import re
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, NamedTuple, Protocol

from tega.errors import ConfigError
from tega.safety.states import RunStates, SafetySection, State, Transition

# Looked at this often, and less where nothing is live; a loop that is late, always.
_POLL_NS = 10_000_000
_RECORDINGS_POLL_NS = 100_000_000
# Rates are counted over the last second, from half a second on.
_WINDOW_NS = 1_000_000_000
_FIRST_WINDOW_NS = 400_000_000
_COUNT_NS = 100_000_000
# Pictures of a finger older than this are not shown either; see tega.loop.touch.
_STALE_PICTURE_NS = 100_000_000
# The hand's most open pose.
_OPEN = 1
_CLOSED = 5
_KEPT_CHANGES = 1000
_NUMBERS = re.compile(r"[\d.]+")


class StreamReport(Protocol):
    """Report of a live stream: why its source went away, ``""`` while it is there, and channels without a vote."""

    lost: str
    faults: tuple[str, ...]


class Watched(NamedTuple):
    """A live stream that the run needs, ``emg`` or a finger.

    ``rate_hz`` is blocks or pictures a second, ``None`` if unknown; ``driver_faults`` are in words.
    """

    name: str
    kind: Literal["tactile", "emg"]
    rate_hz: float | None
    report: StreamReport
    driver_faults: Callable[[], Sequence[str]] = tuple


class Guard:
    """Decides the run's state, and with it the permissions of the loop.

    Args:
        streams: The live streams that are needed; recordings need no guard.
        vests: Functions by the name of each live vest; each returns whether the vest can be reached.
        calibration: Returns why the calibration cannot be used, ``""`` if it can.
        go: Whether an armed run may become active.
        program: Returns the level that a program sets in place of the muscles' own; ``None`` for none.
        alerts: Alerts that do not change the state, by name: each returns its text, ``""`` for none.
        needs: Further requirements, by name: each returns why it is missing, ``""`` if it is there.

    Raises:
        ConfigError: A stream has the name of something else that is watched.

    Attributes:
        observers: Called with every change of state, in the loop's thread.
        alert_observers: Called with every alert that begins, and with ``""`` for every one that ends.
        changes: The changes so far, the newest 1000.
        alerts: Current problems that do not change the state, by name.
    """

    def __init__(
        self,
        settings: SafetySection | None = None,
        *,
        streams: Sequence[Watched] = (),
        vests: Mapping[str, Callable[[], bool]] = {},
        calibration: Callable[[], str] = lambda: "",
        go: Callable[[], bool] = lambda: True,
        program: Callable[[], float | None] = lambda: None,
        alerts: Mapping[str, Callable[[], str]] = {},
        needs: Mapping[str, Callable[[], str]] = {},
    ) -> None:
        self._settings = settings or SafetySection()
        s = self._settings
        self._streams, self._vests = list(streams), dict(vests)
        self._calibration, self._go, self._program = calibration, go, program
        self._alerts, self._needs = dict(alerts), dict(needs)
        self._alerted: dict[str, str] = {}
        live = bool(streams or vests or needs)
        others = {*vests, *alerts, *needs}
        if taken := [stream.name for stream in streams if stream.name in others]:
            raise ConfigError(
                f"two things that are watched have the name {taken[0]!r}", "name the finger otherwise"
            )
        self.observers: list[Callable[[Transition], None]] = []
        self.alert_observers: list[Callable[[str, str], None]] = []
        self.changes: deque[Transition] = deque(maxlen=_KEPT_CHANGES)
        self.alerts: dict[str, str] = {}
        self._states = RunStates(
            settle_ns=round(s.settle_ms * 1e6) if live else 0,
            give_up_ns=round(s.hold_ms * 1e6) if s.then == "open" else None,
            on_change=self._changed,
        )
        self._late_ns = round(s.late_ms * 1e6)
        self._next_ns = 0
        self._check_ns = _POLL_NS if live else _RECORDINGS_POLL_NS
        self._level: float = _OPEN
        self._counted: deque[tuple[int, dict[str, int]]] = deque()
        self.n_held = 0
        """Hand ticks on which the level of the muscles was not passed on."""

    @property
    def state(self) -> State:
        """The state now."""
        return self._states.state

    @property
    def reason(self) -> str:
        """Reason of the state."""
        return self._states.reason

    @property
    def felt(self) -> bool:
        """Whether the vest may show touch."""
        return self._states.state in {"active", "hold"}

    def level(self, wanted: float) -> float:
        """Return the hand's level, 1 to 5: while active the wanted or a program's, in hold the last one, else open."""
        state = self._states.state
        if state == "active" and (program := self._program()) is not None:
            wanted = program
        wanted = _OPEN if math.isnan(wanted) else min(max(wanted, _OPEN), _CLOSED)
        if state == "active":
            self._level = wanted
        elif state != "hold":
            self._level = _OPEN
        self.n_held += self._level != wanted
        return self._level

    def alert(self, name: str, text: str) -> None:
        """Report a problem without changing the state; ``""`` clears it."""
        if text == self.alerts.get(name, ""):
            return
        # Numbers in it, such as how long a signal is missing, go on changing; that is no news.
        news = _NUMBERS.sub("", text) != _NUMBERS.sub("", self.alerts.get(name, ""))
        if text:
            self.alerts[name] = self._alerted[name] = text
        else:
            del self.alerts[name]
        if news:
            for observer in self.alert_observers:
                observer(name, text)

    def watch(self, name: str, problem: Callable[[], str]) -> None:
        """Alert by this name from now on whenever ``problem`` returns a text; it is called at every look."""
        self._alerts[name] = problem

    def due(self, t_ns: int, late_ns: int) -> bool:
        """Return whether the next look is due: soon after the last one, at once if the loop is late."""
        return t_ns >= self._next_ns or self._too_late(late_ns)

    def check(
        self,
        t_ns: int,
        *,
        late_ns: int,
        stamps: Mapping[str, int],
        counts: Mapping[str, int],
        unvoted: float | None = None,
        released: str = "",
    ) -> None:
        """Check everything that is watched.

        ``t_ns`` counts from the start of the session; ``late_ns`` is how late the loop is. ``stamps`` and
        ``counts``, by stream, are the time of the newest item and the items so far. ``unvoted`` is the level
        before, where no channel of the newest block had a vote; ``None`` where one had. ``released`` is why
        the dead-man does not count as held; ``""`` while it is, or where there is none.
        """
        late = self._too_late(late_ns)
        self._next_ns = t_ns + self._check_ns
        self._count(t_ns, counts)
        s = self._settings
        wrong: dict[str, str] = {}
        holding: dict[str, str] = {}
        if text := self._calibration():
            wrong["calibration"] = text
        for stream in self._streams:
            if text := self._missing(stream, t_ns, stamps.get(stream.name), good_emg=unvoted is None):
                wrong[stream.name] = text
                if stream.kind == "emg" or s.tactile_lost == "hold":
                    holding[stream.name] = text
            elif text := self._slow(stream):
                wrong[stream.name] = text
        for name, reached in self._vests.items():
            if not reached():
                wrong[name] = f"{name}: not reached, so touch is not felt"
                if s.vest_lost == "hold":
                    holding[name] = wrong[name]
        needed = {name: text for name, reports in self._needs.items() if (text := reports())}
        wrong |= needed
        holding |= needed
        if released:
            holding["dead_man"] = released
        holding |= {"loop": f"the loop was {late_ns / 1e6:.0f} ms late"} if late else {}
        for name in [*(stream.name for stream in self._streams), *self._vests, *self._needs]:
            self.alert(name, wrong.get(name, ""))
        for name, reports in self._alerts.items():
            self.alert(name, reports())
        if unvoted is not None and self.state == "active":  # else no level is passed on
            self.level(unvoted)
        self._states.check(t_ns, wrong=wrong, holding=holding, go=self._go())

    def stop(self, t_ns: int, reason: str) -> None:
        """End the run."""
        self._states.stop(t_ns, reason)

    def summary(self) -> dict[str, Any]:
        """Sum up: every change of state, hand ticks that were not the muscles' own, the last alert of each name."""
        return {
            "changes": [
                {"t_s": change.t_ns / 1e9, "state": change.state, "reason": change.reason}
                for change in self.changes
            ],
            "held_ticks": self.n_held,
            "alerts": list(self._alerted.values()),
        }

    def _too_late(self, late_ns: int) -> bool:
        # A run on recordings has nobody to be late for.
        return late_ns > self._late_ns and bool(self._streams or self._vests)

    def _changed(self, change: Transition) -> None:
        self.changes.append(change)
        for observer in self.observers:
            observer(change)

    def _missing(self, stream: Watched, t_ns: int, stamp_ns: int | None, *, good_emg: bool) -> str:
        name, lost = stream.name, stream.report.lost
        subject = "signal" if stream.kind == "emg" else "picture"
        if stamp_ns is None:
            return f"{name}: {lost or f'no {subject} yet'}"
        stale_ns = _STALE_PICTURE_NS
        if stream.kind == "emg":
            period_ns = 0 if stream.rate_hz is None else round(1e9 / stream.rate_hz)
            stale_ns = period_ns + round(self._settings.emg_lost_ms * 1e6)
        age_ns = t_ns - stamp_ns
        if age_ns > stale_ns:
            if lost:
                return f"{name}: lost: {lost}"
            why = "" if stream.kind == "emg" else "; ".join(stream.report.faults or stream.driver_faults())
            return f"{name}: no {subject} for {age_ns / 1e9:.1f} s" + (f": {why}" if why else "")
        if stream.kind == "emg" and not good_emg:
            why = "; ".join(stream.report.faults)
            return f"{name}: no channel can be believed" + (f": {why}" if why else "")
        return ""

    def _count(self, t_ns: int, counts: Mapping[str, int]) -> None:
        counted = self._counted
        if not counted or t_ns - counted[-1][0] >= _COUNT_NS:
            counted.append((t_ns, dict(counts)))
            while len(counted) > 2 and t_ns - counted[1][0] >= _WINDOW_NS:
                counted.popleft()

    def _slow(self, stream: Watched) -> str:
        """Return why a stream's rate does not do: too low, or not known yet; ``""`` if it does."""
        share = self._settings.lowest_rate_share
        if stream.rate_hz is None or share == 0:
            return ""
        (first_ns, first), (last_ns, last) = self._counted[0], self._counted[-1]
        n = last.get(stream.name, 0) - first.get(stream.name, 0)
        # Of a slow stream, such as blocks of EMG, the window has to hold a few.
        if last_ns - first_ns < max(_FIRST_WINDOW_NS, 4e9 / stream.rate_hz / 2):
            return f"{stream.name}: measuring its rate"
        rate_hz = n * 1e9 / (last_ns - first_ns)
        if rate_hz >= share * stream.rate_hz:
            return ""
        return f"{stream.name}: {rate_hz:.1f} a second come, {stream.rate_hz:g} are expected"
