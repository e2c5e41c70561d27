"""Exchange frames with an Allegro Hand, on the hand's own time: bus, limits, watchdog and guard in one loop.

:mod:`tega.devices.hand.hand_program` runs it as a program of its own, where no interpreter lock of the run's keeps it
waiting.
"""

from __future__ import annotations

import contextlib
import time
from typing import Final

from tega.devices.hand.allegro_options import AllegroOptions
from tega.devices.hand.guard_process import GuardProcess
from tega.devices.hand.hand_bus import HandBus, off_frames
from tega.devices.hand.hand_guard import guard_hand
from tega.devices.hand.hand_reports import HandNews, HandOrders, Notify
from tega.hand.link import HandLink, HandSpoken, HandState, Received
from tega.runtime.clock import Standstill
from tega.runtime.threads import run_realtime
from tega.wire import CanFrame

LEAVE_S: Final = 1.0
"""Letting go takes no longer, on the loop's side."""

# An adapter that was closed is opened again within a second.
CONFIRM_S = 3.0
"""For so long the hand is asked whether its motors are off."""

_STATE_S: Final = 0.02
_STILL_OFF_S: Final = 0.5
_REPORT_S: Final = 0.008


class HandLoop:
    """Steers one hand from its first request to its last SERVO OFF.

    ``notify`` is called after each answer to the hand, each change, and twenty times a second, in the loop's
    thread. With ``whole``, set before the loop runs, every exchange is reported with all received frames;
    else only those that sent something.
    """

    def __init__(self, options: AllegroOptions, orders: HandOrders, notify: Notify) -> None:
        o = options
        self._options, self._orders, self._notify, self.whole = o, orders, notify, False
        self._bus = HandBus(o.can_bus())
        self._off: list[CanFrame] = off_frames(o.device_id)
        self._link: HandLink
        self._guard: GuardProcess | None = None
        self._n_guarded = self._left_to = self._leave_ns = 0
        self._pushed, self._let_go, self._ready, self._died = False, True, False, ""
        self._spoken: list[HandSpoken] = []
        self._state: HandState | None = None
        self._state_s = self._reported_s = 0.0
        self._cpu_s = 0.0

    def warm_up(self) -> None:
        """Make ready and start the guard; the bus is not touched. ``ConfigError``: an unusable pose file."""
        o = self._options
        self._link = o.link()
        self._bus.load()
        if o.guard and o.torque:
            self._guard = guard_hand(self._bus.settings, self._off, device_id=o.device_id)

    def open(self) -> None:
        """Open the bus, after :meth:`warm_up`; nothing is sent yet."""
        try:
            self._bus.open()
        except BaseException:
            self.dismiss()
            raise

    @run_realtime("hand")
    def run(self) -> None:
        """Exchange frames until asked to stop; then release the hand, and leave whatever happens."""
        link, orders = self._link, self._orders
        standstill = Standstill(self._options.silent_after_ms * 1e-3)
        try:
            while not (link.released or (self._leave_ns and time.monotonic_ns() > self._leave_ns)):
                if orders.gone or (self._leave_ns and link.phase == "faulted"):
                    break
                if orders.still():
                    self._stand_by()
                frames = self._bus.receive(may_reopen=not orders.leaving.is_set())
                if standstill.pulse():
                    if standstill.slept_s:
                        self._died = f" (the computer slept for {standstill.slept_s:.0f} s)"
                        break
                    # They say nothing of the hand as it is now; without any the link takes it for silent.
                    self._bus.drain()
                    frames = []
                self._exchange(frames, standstill)
        # A panic of native code, too; raised by the next step, which can act on it.
        except BaseException as error:
            self._died = f" ({type(error).__name__}: {error})"
        finally:
            # Whatever was sent before: a hand that receives this is without force.
            last = link.abandon()
            self._note(HandSpoken(time.monotonic_ns(), 0, [], last, "abandon", self._bus.send(last)))
            self._ready = True
            self._flush(time.monotonic_ns(), ended=True)
            if self._pushed:
                with contextlib.suppress(Exception):
                    device_id = self._options.device_id
                    self._let_go = self._bus.switch_off(self._off, device_id=device_id, patience_s=CONFIRM_S)
            with contextlib.suppress(Exception):
                self._bus.drop()
            self.dismiss()
            self._flush(time.monotonic_ns(), ended=True)

    def _exchange(self, frames: list[Received], standstill: Standstill) -> None:
        """Answer the received frames, unless the answer is outdated before it is sent."""
        link, orders, t_ns = self._link, self._orders, time.monotonic_ns()
        self._cpu_s = time.thread_time()
        if orders.leaving.is_set() and not self._leave_ns:
            link.release(t_ns)
            self._note(HandSpoken(t_ns, 0, [], [], "release"))
            self._leave_ns = t_ns + round(LEAVE_S * 1e9)
        level, added = orders.requested
        before = link.phase
        out = link.exchange(frames, t_ns, level, added)
        pushes = link.phase in {"running", "releasing"}
        taken = self._bus.send(out, outdated=standstill.is_over if pushes else None) if out else []
        answers = len(taken) >= 4 and link.phase == "running"
        left_ns = time.monotonic_ns() if answers else 0
        if link.phase == "silent" != before:
            # Whoever else let go of the hand, as the guard does, has closed the adapter behind itself.
            self._bus.drop()
        if out or self.whole:
            self._note(HandSpoken(t_ns, level, frames, out, "exchange", taken, left_ns, added))
        if link.phase == "running" and self._options.torque:
            self._pushed, self._let_go = True, False
        self._ready = self._ready or link.phase in {"running", "faulted"}
        n_words, _ = orders.pulse()
        if self._guard is not None and self._ready and n_words != self._n_guarded:
            # It watches the run, not this loop alone.
            self._n_guarded = n_words
            self._guard.beat()
        if link.phase != before or t_ns * 1e-9 - self._reported_s > _REPORT_S:
            self._flush(t_ns)

    def _stand_by(self) -> None:
        """Let go of the hand and wait for a run that stands still."""
        device_id, guard = self._options.device_id, self._guard
        while self._pushed and self._orders.still():
            if self._bus.switch_off(self._off, device_id=device_id, patience_s=_STILL_OFF_S):
                break
            if guard is not None and not guard.problem:
                break  # it goes on trying
        self._bus.drop()  # the guard may need it
        self._orders.await_word()

    def dismiss(self) -> None:
        """Dismiss the process that guards the hand if the hand has confirmed that its motors are off."""
        guard = self._guard
        if self._let_go:
            if guard is not None:
                guard.dismiss()
        elif guard is not None:
            self._left_to = guard.leave_to_it()
            self._let_go = guard.confirmed

    def _note(self, exchange: HandSpoken) -> None:
        self._spoken.append(exchange if self.whole else exchange._replace(received=[]))

    def _flush(self, t_ns: int, *, ended: bool = False) -> None:
        """Report the exchanges since the last call, and the current state."""
        link, spoken = self._link, self._spoken
        self._spoken, self._reported_s = [], t_ns * 1e-9
        state = self._state
        if state is None or state.phase != link.phase or self._reported_s - self._state_s > _STATE_S or ended:
            state, self._state_s = link.state(t_ns), self._reported_s
            self._state = state
        guard = self._guard
        self._notify(
            spoken,
            HandNews(
                state=state,
                fault=link.fault,
                angles_rad=link.angles_rad,
                target_rad=link.target_rad,
                ready=self._ready,
                trouble=self._died or self._orders.reason or self._bus.trouble,
                guard_problem="" if guard is None else guard.problem,
                n_garbled=self._bus.n_garbled,
                n_unsent=self._bus.n_unsent,
                cpu_s=self._cpu_s,
                ended=ended,
                let_go=self._let_go,
                guard_pid=self._left_to or (0 if guard is None or guard.problem else guard.pid),
            ),
        )
