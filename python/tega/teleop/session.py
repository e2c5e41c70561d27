"""Run a session from its settings: make its clock and its folder, open what it is made of, and run it."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

from tega.bus import Bus
from tega.clock import ManualClock, SystemClock
from tega.errors import ConfigError
from tega.teleop.gc_pause import settled
from tega.teleop.opening import Opening, reached
from tega.threads import realtime, short_turns

if TYPE_CHECKING:
    from tega.clock import Clock
    from tega.config import SessionConfig
    from tega.inbox.prepared import Prepared
    from tega.safety.states import Transition
    from tega.teleop.moment import LoopView
    from tega.teleop.motor_tests import MotorTests
    from tega.teleop.prepare import Progress


def run_session(
    config: SessionConfig,
    *,
    clock: Clock | None = None,
    observer: Callable[[LoopView], None] | None = None,
    progress: Progress = lambda _what, _done, _total: None,
    stop: Callable[[], bool] = lambda: False,
    on_prepared: Callable[[Prepared], Prepared] = lambda prepared: prepared,
    haptics: Callable[[], bool] = lambda: True,
    settings: str = "SETTINGS.toml",
    go: Callable[[], bool] = lambda: True,
    on_state: Callable[[Transition], None] = lambda _change: None,
    prepared: Prepared | None = None,
    tell: Callable[[str], None] = lambda _said: None,
    bus: Bus | None = None,
    motor_tests: MotorTests | None = None,
    shown: Callable[[LoopView], LoopView] = lambda view: view,
    authority: Callable[[], float | None] = lambda: None,
) -> dict[str, Any]:
    """Run a session from its settings.

    Args:
        config: The settings.
        clock: The session's clock; ``None`` for the one its pace asks for.
        observer: Called once per vest tick with what a display may show.
        progress: Told how preparation goes.
        stop: Asked all the time whether to end; whatever was sent to is then left silent.
        on_prepared: Given what the run starts with; returns what it is to start with.
        haptics: Asked at every vest tick; every motor rests while it says no.
        settings: How the settings file is named in the commands that an error suggests.
        go: Asked all the time whether an armed run may become active.
        on_state: Told of every change of the run's state, in the loop's thread.
        prepared: What to start with instead of the sources of the settings.
        tell: Told in a sentence where earlier results are kept, and what happens on the link to the other station; the
            latter in any thread.
        bus: Told of everything that comes in and goes out, as :mod:`tega.records`; give one with your own
            subscribers.
        motor_tests: Wishes to feel a motor of the vest, heard while the run is armed.
        shown: Completes each moment for a display with what the loop does not know.
        authority: Asked at each tick of the hand what authority a page gives the reflex, 0 to 1; ``None`` for what the
            settings and the button of ``input.reflex`` say.

    Returns:
        The summary, as it was written to ``summary.json`` where there is a folder for it.

    Raises:
        TegaError: Whatever is wrong with settings, recordings, calibration or devices.
        KeyboardInterrupt: ``stop`` said so before the loop had begun.
    """
    session, fingers = config.session, config.tactile.in_use()
    alone = config.net is None
    if not fingers and config.emg is None and config.arm is None and prepared is None and alone:
        raise ConfigError(
            "no input: neither a tactile source nor EMG is set, nor an arm",
            "set at least one, such as [tactile.thumb], [emg] or [arm]",
        )
    if clock is None:
        clock = SystemClock() if session.pace == "real" else ManualClock()
    if session.out_dir is not None:
        from tega.recording.folder import check_folder

        check_folder(session.out_dir)
    with ExitStack() as stack:
        stack.enter_context(realtime(allowed=session.realtime))
        if isinstance(clock, SystemClock):
            stack.enter_context(short_turns())
            stack.enter_context(settled())
        reached("settings read")
        opening = Opening(stack, config, sources=prepared is None)
        # Loaded while the devices open.
        from tega.teleop.motor_tests import MotorTests
        from tega.teleop.rig import open_rig
        from tega.teleop.run import run_loop

        rig = open_rig(
            stack,
            config,
            Bus() if bus is None else bus,
            opening=opening,
            prepared=prepared,
            on_prepared=on_prepared,
            progress=progress,
            stop=stop,
            settings=settings,
            go=go,
            on_state=on_state,
            tell=tell,
        )
        return run_loop(
            stack,
            rig,
            clock=clock,
            observer=observer,
            stop=stop,
            haptics=haptics,
            tests=motor_tests or MotorTests(),
            shown=shown,
            authority=authority,
        )
