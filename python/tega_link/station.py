"""Define what both stations share as an end of the link, and make the one that a session asks for."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from typing import Any

from tega.config import SessionConfig
from tega.loop.parts import Part
from tega.loop.snapshot import LoopView, Snapshot
from tega.records import RunState
from tega.records.bus import Bus
from tega.records.display import Notice
from tega.runtime.lifecycle import Opened
from tega_link.clock import PeerClock
from tega_link.link import Link
from tega_link.settings import NetSection, net_of

_LEAVE_S = 2.0


class Station(Part, Opened):
    """One end of the link in a session: it puts the other station's devices in place."""

    endless = brings_input = True
    tick_s = 0.05

    def __init__(self, config: SessionConfig, bus: Bus, session: Callable[[], int]) -> None:
        net = net_of(config)
        assert net is not None
        self.net: NetSection = net
        self._config, self._bus, self._session_of = config, bus, session
        bus.subscribe(RunState, self.changed, name="link")
        bus.subscribe(Snapshot, self._seen, name="link")
        self._link = Link(self.net)
        self._lock = threading.Lock()
        self._clock = PeerClock()
        self._numbers: dict[str, int] = {}
        self._leaving = threading.Event()
        self._thread: threading.Thread | None = None
        self._error = ""
        self._start_ns: int | None = None
        self._view: LoopView | None = None

    def needs(self) -> Mapping[str, Callable[[], str]]:
        """Return the need of the other station."""
        return {"link": self.missing}

    def alerts(self) -> Mapping[str, Callable[[], str]]:
        """Return the alerts of the other station and of the link."""
        return {"station": self.alert, "sending": lambda: self._link.problem}

    def missing(self) -> str:
        """Return why the run cannot go on, ``""`` if it can."""
        return ""

    def alert(self) -> str:
        """Return the other station's problem, ``""`` for none."""
        return ""

    def changed(self, change: RunState) -> None:
        """Report that the run's state has changed."""
        self._notify(f"{change.state}: {change.reason}")

    def _notify(self, text: str) -> None:
        self._bus.publish(Notice(text=text))

    def _seen(self, snapshot: Snapshot) -> None:
        self._view = snapshot.view

    def displayed(self, view: LoopView) -> LoopView:
        """Complete a moment for a display."""
        return view._replace(link=self.words)

    @property
    def words(self) -> str:
        """State of the link, in one line."""
        raise NotImplementedError

    def summary(self) -> dict[str, Any]:
        """Return the link's entry of a run's summary."""
        return {"net": self._summary()}

    def _summary(self) -> dict[str, Any]:
        raise NotImplementedError

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
            except Exception as error:
                # Reported as long as the run lasts; nothing more is sent, so the other side holds.
                self._error = f"link: no longer served: {error}"
                self._notify(self._error)
                return

    def _turn(self, now_ns: int) -> None:
        raise NotImplementedError

    def _stamp(self, stream: str) -> dict[str, Any]:
        number = self._numbers[stream] = self._numbers.get(stream, -1) + 1
        return {"session": self._session_of(), "sequence": number, "sent_ns": time.monotonic_ns()}

    def _link_summary(self) -> dict[str, Any]:
        return {
            "station": self.net.station,
            "name": self.net.own_name,
            "keys": self.net.keys is not None,
            "clock": self._clock.summary(),
            "unsent": self._link.n_unsent,
        }
