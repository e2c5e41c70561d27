"""Define what both stations share as an end of the link, and make the one that a session asks for."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

from tega.records import RunState
from tega.runtime.lifecycle import Opened
from tega_link.clock import PeerClock
from tega_link.link import Link
from tega_link.settings import NetSection, net_of

if TYPE_CHECKING:
    from tega.config import SessionConfig
    from tega.devices.base import Tracker
    from tega.loop.inbox.inputs import Inputs
    from tega.loop.inbox.prepared import Prepared
    from tega.loop.latency import LatencyTrace
    from tega.loop.moment import LoopView
    from tega.loop.sinks import Sinks
    from tega.records.bus import Bus
    from tega.runtime.wake import Bell
    from tega.safety.guard import Guard


_LEAVE_S = 2.0


class Station(Opened):
    """One end of the link in a session; the session asks it to put the other station's devices in place.

    Args:
        config: The session's settings; ``net`` is set.
        bus: Tells what passes in the session, and is told what comes over the link for a recording.
        tell: Told in a sentence what happens on the link.
    """

    tick_s = 0.05

    def __init__(self, config: SessionConfig, bus: Bus, tell: Callable[[str], None]) -> None:
        net = net_of(config)
        assert net is not None
        self.net: NetSection = net
        self._config, self._bus, self._tell = config, bus, tell
        bus.subscribe(RunState, self.changed, name="link")
        self._link = Link(self.net)
        self._lock = threading.Lock()
        self._clock = PeerClock()
        self._numbers: dict[str, int] = {}
        self._leaving = threading.Event()
        self._thread: threading.Thread | None = None
        self._error = ""
        self._start_ns: int | None = None
        self._view: LoopView | None = None

    # What a session asks for; each station overrides what it has something to say to.

    def prepared(self, prepared: Prepared) -> Prepared:
        """Return what the run starts with, and what comes over the link with it."""
        return prepared

    def sinks(self, sinks: Sinks) -> Sinks:
        """Return where the run writes to, and what is sent over the link with it."""
        return sinks

    def inputs(self, stack: ExitStack, inputs: Inputs) -> Inputs:  # noqa: ARG002  # the operator opens a tracker
        """Return what the operator holds, here or there."""
        return inputs

    @property
    def tracker(self) -> Tracker | None:
        """Tracker that leads the arm, where that comes over the link."""
        return None

    def missing(self) -> str:
        """Return why the run cannot go on, ``""`` if it can."""
        return ""

    def alert(self) -> str:
        """Return what is wrong at the other station, ``""`` for nothing."""
        return ""

    def unsent(self) -> str:
        """Return why messages are not sent, ``""`` while they are."""
        return self._link.problem

    def begin(
        self,
        prepared: Prepared,
        *,
        start_ns: int,
        bell: Bell | None,
        trace: LatencyTrace | None,
        guard: Guard,
    ) -> None:
        """Take note that the run begins."""
        raise NotImplementedError

    def changed(self, change: RunState) -> None:
        """Tell that the run's state has changed."""
        self._tell(f"{change.state}: {change.reason}")

    def seen(self, view: LoopView) -> None:
        """Take note of the newest moment of the run."""
        self._view = view

    def shown(self, view: LoopView) -> LoopView:
        """Complete a moment for a display."""
        return view._replace(link=self.words)

    @property
    def words(self) -> str:
        """State of the link, in one line."""
        raise NotImplementedError

    def summary(self) -> dict[str, Any]:
        """Return the link's part of a run's summary."""
        raise NotImplementedError

    def end(self) -> None:
        """Take no more part in the run, whose devices are about to be closed."""

    # The link.

    def close(self) -> None:
        """End the link."""
        self._leaving.set()
        if self._thread is not None:
            self._thread.join(_LEAVE_S)
            self._thread = None
        self._link.close()

    def _start(self) -> None:
        self._thread = threading.Thread(target=self._run, name="tega-net", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        next_s = time.monotonic()
        while not self._leaving.wait(max(0.0, next_s - time.monotonic())):
            next_s = max(next_s + self.tick_s, time.monotonic() - self.tick_s)
            try:
                self._turn(time.monotonic_ns())
            except (
                Exception
            ) as error:  # told as long as the run lasts; nothing more is sent, so the other side holds
                self._error = f"link: no longer served: {error}"
                self._tell(self._error)
                return

    def _turn(self, now_ns: int) -> None:
        raise NotImplementedError

    def _stamp(self, session: int, stream: str) -> dict[str, Any]:
        """Return what every message of a stream begins with."""
        number = self._numbers[stream] = self._numbers.get(stream, -1) + 1
        return {"session": session, "sequence": number, "sent_ns": time.monotonic_ns()}

    def _link_summary(self) -> dict[str, Any]:
        return {
            "station": self.net.station,
            "name": self.net.own_name,
            "keys": self.net.keys is not None,
            "clock": self._clock.summary(),
            "unsent": self._link.n_unsent,
        }
