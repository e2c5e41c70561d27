"""Run a session from a Python program, which receives moments and may send to vest, hand and arm.

The loop runs in a thread of its own, as ``tega-teleop run`` runs it: with the same limits, guard and watchdogs. The
program's frames, levels and poses lapse unless it sends new ones. Leaving the ``with`` block, in whatever way, ends the
run: the vest gets zeros, and the hand is let go.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterator
from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

import numpy as np
from numpy.typing import ArrayLike

from tega.config import SessionConfig, load_config
from tega.config.calibration import EmgMaxima
from tega.devices.at_exit import closes_on_exit, release
from tega.devices.base import DeviceInfo, EmgChunk, Tracker
from tega.errors import ConfigError, DeviceUnavailableError, InvalidValueError
from tega.haptics import MotorLevels
from tega.loop.controls import Controls, MotorTests
from tega.loop.inbox.inputs import Muscles, Prepared
from tega.loop.inbox.sources import SourceReport
from tega.loop.inbox.stream import LiveStream, PulledStream
from tega.loop.parts import Part, RunStart
from tega.loop.program_arm import Lapsing, ProgramArm
from tega.loop.session import run_session
from tega.loop.snapshot import LoopView, Snapshot
from tega.records import Intent, ProgramFrame
from tega.records.bus import Bus
from tega.records.display import Notice
from tega.runtime.clock import Clock, ManualClock, SystemClock
from tega.runtime.lifecycle import Elsewhere
from tega.safety.guard import Guard
from tega.safety.stop import Stop
from tega.wire.arrays import float_array

__all__ = ["ProgramArm", "ProgramHand", "ProgramSession", "ProgramVest", "session"]

_LOG = logging.getLogger(__name__)
_POLL_S: Final = 0.05
_PATIENCE_S: Final = 10.0


def session(
    settings: str | PathLike[str] | SessionConfig, *, sets: tuple[str, ...] = (), person: str | None = None
) -> ProgramSession:
    """Return a session of some settings, to be used in a ``with`` statement.

    Args:
        settings: Settings file, or settings that are loaded already.
        sets: Settings to override, such as ``"session.pace=fast"``.
        person: Person with the calibration to use.

    Raises:
        ConfigError: The settings are wrong.
    """
    if isinstance(settings, SessionConfig):
        if sets or person is not None:
            raise ConfigError("sets and person are for a settings file", "change the loaded settings instead")
        return ProgramSession(settings)
    if person is not None:
        sets = (*sets, f'calibration.person="{person}"')
    path = Path(settings)
    return ProgramSession(load_config(path, sets=sets).config, name=path.name)


class ProgramVest(MotorTests):
    """Vest of a session, as a program sends to it; frames pass the vest's limits and the wearer's daily dose."""

    def __init__(self, clock: Clock, *, driver: str | None) -> None:
        super().__init__()
        self._frame, self._driver = Lapsing(clock), driver
        self._layout = ""
        self._guard: Guard | None = None
        self._newest: tuple[int, ...] | None = None

    def join(self, run: RunStart) -> None:
        """Take note of the run's layout and guard."""
        self._layout, self._guard = run.layout, run.guard

    @property
    def layout(self) -> str:
        """Name of the layout."""
        return self._layout

    def send(self, intensities: ArrayLike | MotorLevels, *, for_s: float = 0.2) -> None:
        """Have the vest show a frame in the place of touch.

        Args:
            intensities: Percent, 0 to 100, one number for each motor of the layout.
            for_s: Time after which the frame lapses unless another was sent, above 0 to 10 s of the session.

        Raises:
            DeviceUnavailableError: The settings name no vest.
            InvalidValueError: A number is out of range or masked, the frame is of another layout, or the session has
                not begun.
            DtypeError: The intensities are not real numbers.
            ShapeError: There are not as many numbers as motors.
        """
        if self._driver is None:
            raise DeviceUnavailableError("the session has no vest", "set vest.driver")
        if not self._layout:
            raise InvalidValueError("the session has not begun", "use it in a with statement")
        if isinstance(intensities, MotorLevels):
            if intensities.layout != self._layout:
                raise InvalidValueError(f"frame of layout {intensities.layout}, not {self._layout}")
            numbers = intensities.intensities.astype(np.float64)
        else:
            numbers = float_array("intensities", intensities)
        if not bool(np.all((numbers >= 0) & (numbers <= 100))):
            raise InvalidValueError("intensities are out of range: 0 to 100 percent")
        self._frame.send(MotorLevels(self._layout, np.rint(numbers).astype(np.uint8)), for_s)

    @property
    def active(self) -> bool:
        """Whether frames are due: in a session with a vest, always."""
        return self._driver is not None

    def frame(self, t_ns: int, frame: MotorLevels) -> MotorLevels:
        """Return the frame of a tick: the program's while it stands and the run is active, else the loop's."""
        active = self._guard is not None and self._guard.state == "active"
        sent = self._frame.now() if active else None
        newest = () if sent is None else tuple(sent.intensities.tolist())
        if newest != self._newest:
            self._newest = newest
            self._bus.publish(ProgramFrame(t_ns=t_ns, intensities=newest))
        return super().frame(t_ns, frame if sent is None else sent)


class ProgramHand:
    """Hand of a session, as a program steers it; levels pass the guard and the hand's limits."""

    def __init__(self, clock: Clock, *, driver: str | None) -> None:
        self._level, self._driver = Lapsing(clock), driver

    def level(self, level: float, *, for_s: float = 0.5) -> None:
        """Have the hand close to a level in the place of the muscles'.

        Args:
            level: 1 (open) to 5 (closed), with fractions.
            for_s: Time after which the level lapses unless another was sent, above 0 to 10 s of the session. The
                muscles then steer again; without EMG the hand opens.

        Raises:
            DeviceUnavailableError: The settings name no hand.
            InvalidValueError: A number is out of range.
        """
        if self._driver is None:
            raise DeviceUnavailableError("the session has no hand", "set hand.driver")
        if not 1 <= level <= 5:
            raise InvalidValueError(f"level = {level} is out of range: 1 to 5")
        self._level.send(float(level), for_s)

    def requested(self) -> float | None:
        """Return the program's level; ``None`` while none stands."""
        level: float | None = self._level.now()
        return level


class _NoMuscles(Elsewhere):
    """EMG of a session with a hand that a program steers: it has no samples."""

    ended = True

    def __init__(self) -> None:
        super().__init__(DeviceInfo(driver="program", kind="emg", label="no EMG", live=False, unit="level"))

    def read(self, timeout_s: float) -> EmgChunk | None:  # noqa: ARG002  # as every source
        return None


class _ProgramPart(Part):
    brings_input = endless = True

    def __init__(
        self, config: SessionConfig, vest: ProgramVest, arm: ProgramArm, begun: Callable[[], None]
    ) -> None:
        self._config, self._vest, self._arm, self._begun = config, vest, arm, begun

    @property
    def tracker(self) -> Tracker | None:
        tracker: Any = self._arm.tracker
        return tracker  # type: ignore[no-any-return]

    def prepared(self, prepared: Prepared) -> Prepared:
        if prepared.muscles is not None or self._config.hand.driver is None:
            return prepared
        stream = PulledStream[Intent]([]) if prepared.fingers else LiveStream[Intent]()
        maxima = EmgMaxima(kind="envelope", rate_hz=10.0, tau=1, channels=("program",), maxima=(5.0,))
        source: Any = _NoMuscles()
        return prepared._replace(muscles=Muscles(source, maxima, None, SourceReport(), stream))

    def head(self, run: RunStart) -> None:
        self._vest.join(run)

    def begin(self, run: RunStart) -> None:  # noqa: ARG002  # the clock runs
        self._begun()


class ProgramSession:
    """Session that a program follows and may send to; use it in a ``with`` statement, once.

    Iterating yields moments, :class:`tega.loop.LoopView`: at real pace the newest one that the program has not
    received yet, else every one, and the run waits for the program. ``name`` is the settings file's, for messages.

    Attributes:
        config: The settings.
        vest: The vest, to send to.
        hand: The hand, to steer.
        arm: The arm, to lead.
        bus: Bus of the run, whose threads call the subscribers; subscribe before the ``with`` block.
        n_skipped: Moments that the program was too slow for.
        summary: Summary of the run, once it has ended; empty before.
    """

    def __init__(self, config: SessionConfig, *, name: str = "SETTINGS.toml") -> None:
        self.config, self._name = config, name
        self._waits = config.session.pace == "fast"
        self._clock: Clock = ManualClock() if self._waits else SystemClock()
        self.vest = ProgramVest(self._clock, driver=config.vest.driver)
        self.hand = ProgramHand(self._clock, driver=config.hand.driver)
        self.arm = ProgramArm(self._clock, config)
        self.bus = Bus()
        self.n_skipped = 0
        self.summary: dict[str, Any] = {}
        self._stop = Stop()
        self._change = threading.Condition()
        self._snapshot: LoopView | None = None
        self._n_given = self._n_requested = 0
        self._begun = self._over = False
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="tega-session", daemon=True)

    def __enter__(self) -> Self:
        """Open the devices and begin the run; ``TegaError`` also where the session has been used before."""
        if self._thread.ident is not None:
            raise InvalidValueError("the session has been used", "make another one with tega.session")
        closes_on_exit(self.close)
        try:
            self._thread.start()
            with self._change:
                while not (self._begun or self._over):
                    self._change.wait(_POLL_S)
        except BaseException:
            self.close()
            raise
        if not self._begun:
            self.close()
            self._raise()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the run: the vest gets zeros, the hand is let go; raise its error unless the program ended with one."""
        self.close()
        if error is None:
            self._raise()
        elif self._error is not None:
            error.add_note(f"the session ended with an error, too: {self._error}")

    def __iter__(self) -> Iterator[LoopView]:
        """Return the moments of the session."""
        return self

    def __next__(self) -> LoopView:
        """Wait for the next moment; ``TegaError`` if the run ended with an error, or has not begun."""
        if self._thread.ident is None:
            raise InvalidValueError("the session has not begun", "use it in a with statement")
        with self._change:
            self._n_requested += 1
            self._change.notify_all()
            while self._snapshot is None and not self._over:
                self._change.wait(_POLL_S)
            snapshot, self._snapshot = self._snapshot, None
        if snapshot is None:
            self._raise()
            raise StopIteration
        return snapshot

    @property
    def over(self) -> bool:
        """Whether the run has ended."""
        return self._over

    def close(self) -> None:
        """End the run and wait until the outputs are silent; an interrupt is raised after that."""
        self._stop.ask("the program has left the session")
        interrupted: BaseException | None = None
        until_s = time.monotonic() + _PATIENCE_S
        while self._thread.is_alive():
            try:
                self._thread.join(_POLL_S)
            except (KeyboardInterrupt, SystemExit) as error:
                if time.monotonic() > until_s:
                    raise
                interrupted = error
        release(self.close)
        if interrupted is not None:
            raise interrupted

    def _raise(self) -> None:
        error, self._error = self._error, None
        if error is not None:
            raise error

    def _run(self) -> None:
        bus = self.bus
        bus.subscribe(Snapshot, self._take, name="program", vital=self._waits)
        bus.subscribe(Notice, lambda notice: _LOG.info("%s", notice.text), name="program")
        try:
            self.summary = run_session(
                self.config,
                clock=self._clock,
                bus=bus,
                controls=Controls(stop=self._stop, level=self.hand.requested, motor_tests=self.vest),
                parts=[_ProgramPart(self.config, self.vest, self.arm, self._begin)],
                settings=self._name,
            )
        except KeyboardInterrupt:
            pass  # it was asked to stop before the loop had begun
        except BaseException as error:  # raised in the program's thread
            self._error = error
        finally:
            with self._change:
                self._over = True
                self._change.notify_all()

    def _begin(self) -> None:
        with self._change:
            self._begun = True
            self._change.notify_all()

    def _take(self, snapshot: Snapshot) -> None:
        """Take a moment in the loop's thread, which waits for the program only where time is not the world's."""
        with self._change:
            self.n_skipped += self._snapshot is not None
            self._snapshot = snapshot.view
            self._n_given += 1
            self._change.notify_all()
            while self._waits and self._n_requested <= self._n_given and not self._stop.requested:
                self._change.wait(_POLL_S)
