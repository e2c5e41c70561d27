"""Serve the page, and paint the newest moment of a run in the thread of a backlog that holds one."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Self

from tega.errors import InvalidValueError
from tega.loop.snapshot import Snapshot
from tega.records.bus import Backlog
from tega.runtime.lifecycle import require
from tega.ui.view.browser.controls import Controls
from tega.ui.view.run_state import NO_NEWS_S, RateMeter
from tega.ui.view.same_machine import LOOPBACK
from tega.ui.view.state import ViewState

if TYPE_CHECKING:
    from tega.records.bus import Bus
    from tega.ui.view.browser.page import Page

_PERIOD_S = 1 / 30
# The scene is painted every time, pictures, text and charts by turns: no moment costs much more than another.
N_TURNS = 3
# Without anyone at the page it is still kept fresh for the next who opens it.
_UNWATCHED_HZ = 2.0
_REST_SHARE = 4.0
_LAST_S = 0.1
# A painter that failed tries again after this long; the age of what is shown is updated this often.
_RETRY_S = 0.5
_REPORT_AGE_S = 1.0


class BrowserView:
    """A page that shows a run; gives up frames rather than keep the run waiting.

    Use as a context manager. :meth:`watch` subscribes to a run's moments, :meth:`offer` takes one from
    elsewhere. Both wait in a :class:`~tega.records.bus.Backlog` that holds the newest one only; its thread
    paints at most 30 times a second. A moment that a newer one replaces is never shown: dropped, not
    late.

    It serves this machine only, unless ``allow_remote`` lets ``host`` be an address that others can reach:
    anyone who has the full address can press the buttons. Where ``port`` is taken, the next free one is used;
    0 takes any. ``complete`` is called by the painting thread with a moment before it is painted; it adds
    slow parts, such as pictures that have to be read. A viewer's camera begins at ``eye_m`` and looks at
    ``at_m``; the page can look back ``kept_s``. Another host, or a port out of range, raises
    ``InvalidValueError``.

    ``n_painted`` counts the moments painted, of those offered. ``page`` is there from the first time that it
    is served. ``problem`` is the number of moments that could not be painted, and the last reason, ``""`` for
    none; the page shows it too.
    """

    def __init__(
        self,
        title: str = "TEGA",
        *,
        host: str = "127.0.0.1",
        port: int = 8080,
        controls: Controls | None = None,
        complete: Callable[[ViewState], ViewState] = lambda state: state,
        eye_m: tuple[float, float, float] = (0.92, 0.64, 0.48),
        at_m: tuple[float, float, float] = (-0.03, 0.07, 0.19),
        allow_remote: bool = False,
        kept_s: float = 60.0,
    ) -> None:
        if host not in LOOPBACK and not allow_remote:
            raise InvalidValueError(
                f"host = {host!r}: the view is served to this machine only",
                f"use {LOOPBACK[0]}, or allow_remote=True if everyone who has its address may press its buttons",
            )
        if not 0 <= port <= 65_535:
            raise InvalidValueError(f"port = {port}, expected 0 to 65535")
        self._title, self._host, self._port, self._allow_remote = title, host, port, allow_remote
        self._complete = complete
        self._looks: dict[str, Any] = {"eye_m": eye_m, "at_m": at_m, "kept_s": kept_s}
        self.controls = controls or Controls()
        self.n_painted = 0
        self._waiting = Backlog("browser-view", most=1, newest=True, idle=self._paint)
        self._over = threading.Event()
        self._server: Any = None
        self.page: Page
        self.problem = ""
        self._n_failures = 0
        self._reported_age_s = 0.0
        self._meter = RateMeter()
        self._newest: tuple[float, ViewState] | None = None
        self._state: ViewState | None = None
        self._turn = self._n_owed = 0
        self._wait_ms = self._painted_s = 0.0

    @property
    def url(self) -> str:
        """Address of the page, with the token that it needs; empty while closed."""
        return "" if self._server is None else str(self._server.url)

    @property
    def painting(self) -> bool:
        """Whether moments are being painted: the page is served."""
        return self._waiting.running

    @property
    def n_offered(self) -> int:
        """Moments offered."""
        return self._waiting.n_put

    @property
    def n_dropped(self) -> int:
        """Moments offered that were replaced by a newer one before they were painted."""
        return self._waiting.n_dropped

    def watch(self, bus: Bus) -> None:
        """Show the moments of a run from now on."""
        bus.subscribe(Snapshot, self._snapshot, name="page", backlog=self._waiting)

    def __enter__(self) -> Self:
        """Serve the page; needs viser."""
        require("viser", driver="page", extra="view")
        from tega.ui.view.browser.local import LocalServer
        from tega.ui.view.browser.page import Page

        how: dict[str, Any] = {"allow_remote": self._allow_remote, "try_motor": self.controls.try_motor}
        self._server = LocalServer(self._host, self._port, self._title, **how)
        self.page = Page(self._server, title=self._title, controls=self.controls, **self._looks)
        self._over.clear()
        self._waiting.start()
        return self

    def __exit__(self, *_error: object) -> None:
        """Stop serving; painting errors are in :attr:`problem`."""
        self._over.set()
        self._waiting.close()
        if self._server is not None:
            self._paint_last()
            self._server.stop()
        self._server = None

    def offer(self, state: ViewState) -> None:
        """Take a moment to be shown; returns at once."""
        self._waiting.put(BrowserView._paint, self, state)

    def _snapshot(self, snapshot: Snapshot) -> None:
        self._paint(ViewState(snapshot.t_ns, snapshot.view))

    def _paint(self, state: ViewState | None = None) -> None:
        """Paint a moment, or more of the last one, then rest; a failure is shown and retried."""
        if self._server is None:  # nothing is served yet, or any more
            return
        began_s, rest_s = time.monotonic(), 0.0
        try:
            period_s = _PERIOD_S
            if painted := self._paint_next(began_s, state):
                period_s = _PERIOD_S if self._server.get_clients() else 1 / _UNWATCHED_HZ
            else:
                self._report_age(began_s)
                painted = self.page.paint_past()  # also while the run stands still
            if painted:
                took_s = time.monotonic() - began_s
                # Where painting takes long the machine is busy: better fewer moments than the run's time.
                rest_s = max(period_s - took_s, _REST_SHARE * took_s)
        except BaseException as error:  # of native code, too; the run goes on, and so does the page
            self._fail(error)
            rest_s = _RETRY_S
        self._over.wait(rest_s)

    def _fail(self, error: BaseException) -> None:
        """Note the error, and still show the run's state, which needs none of the parts that can fail."""
        self._n_failures += 1
        self.problem = (
            f"{self._n_failures} moments could not be shown, at last: {type(error).__name__}: {error}"
        )
        if self._newest is not None:
            with contextlib.suppress(
                Exception
            ):  # the page itself is gone; the browser says that nothing comes
                self.page.paint_state(self._newest[1].loop, problem=self.problem)

    def _report_age(self, now_s: float) -> None:
        """Show the age of the newest moment, once a second, for pages opened only now."""
        if self._newest is None or now_s - self._reported_age_s < _REPORT_AGE_S:
            return
        offered_s, state = self._newest
        if now_s - offered_s < NO_NEWS_S:
            return
        self._reported_age_s = now_s
        with contextlib.suppress(Exception):  # as above
            self.page.paint_state(state.loop, age_s=now_s - offered_s, problem=self.problem)

    def _paint_last(self) -> None:
        """Paint the end of the run; the page stays open in the browser after the server is gone."""
        try:
            if (state := self._state) is None:
                return
            self.page.paint_last(state)
            self._server.flush()
            time.sleep(_LAST_S)  # what is flushed is sent by another thread
        except BaseException as error:
            self._fail(error)

    def _paint_next(self, now_s: float, given: ViewState | None) -> bool:
        """Paint a new moment, or more of the last one if no other follows; return whether anything was painted."""
        if given is not None:
            self._newest = now_s - self._waiting.waited_s, given
            self._wait_ms = self._waiting.waited_s * 1e3
            self._state = self._complete(given)
            self._meter.take(now_s, {**self._state.loop.counts, "page": self.n_painted})
            self._n_owed = N_TURNS
        elif self._n_owed == 0 or now_s - self._painted_s < 2 * _PERIOD_S:
            return False
        if self._state is not None:
            latency_ms = {**self._state.latency_ms, "to the page": self._wait_ms}
            self.page.paint(
                self._state, turn=self._turn, rates_hz=self._meter.rates_hz, latency_ms=latency_ms
            )
        self._turn = (self._turn + 1) % N_TURNS
        self._n_owed -= 1
        self._painted_s = now_s
        self.n_painted += given is not None
        return True
