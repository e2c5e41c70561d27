"""Run a session from its settings: create its clock and folder, open its parts, and run it."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from typing import Any

from tega.config import SessionConfig
from tega.loop.controls import Controls
from tega.loop.inbox.inputs import Prepared
from tega.loop.opening import Opening
from tega.loop.pacing import settled
from tega.loop.parts import Part
from tega.loop.prepare import Progress
from tega.records.bus import Bus
from tega.runtime.clock import Clock, ManualClock, SystemClock
from tega.runtime.threads import realtime, short_turns


def run_session(
    config: SessionConfig,
    *,
    clock: Clock | None = None,
    bus: Bus | None = None,
    controls: Controls | None = None,
    parts: Sequence[Part] = (),
    prepared: Prepared | None = None,
    progress: Progress = lambda _subject, _done, _total: None,
    settings: str = "SETTINGS.toml",
) -> dict[str, Any]:
    """Run a session from its settings.

    Args:
        config: The settings.
        clock: The session's clock; ``None`` for the one that its pace needs.
        bus: Bus of the run; subscribe to records, to :class:`~tega.loop.snapshot.Snapshot` for displays, and to
            :class:`~tega.records.display.Notice` for sentences to the person who runs the session.
        controls: Answers whether to stop, to begin, to vibrate; ``None`` for a run that ends with its sources.
        parts: Parts of the caller, which join after those of features.
        prepared: Inputs to use instead of the sources of the settings.
        progress: Reports preparation: ``progress(activity, done, total)``.
        settings: Name of the settings file in the commands that an error suggests.

    Returns:
        The summary, as it was written to ``summary.json`` where there is an output folder.

    Raises:
        TegaError: Settings, recordings, calibration or devices are at fault.
        KeyboardInterrupt: ``controls.stop`` asked for it before the loop had begun.
    """
    session = config.session
    if clock is None:
        clock = SystemClock() if session.pace == "real" else ManualClock()
    controls = Controls() if controls is None else controls
    with ExitStack() as stack:
        stack.enter_context(realtime(allowed=session.realtime))
        if isinstance(clock, SystemClock):
            stack.enter_context(short_turns())
            stack.enter_context(settled())
        opening = Opening(stack, config, sources=prepared is None)
        # Loaded while the devices open.
        from tega.loop.rig import open_rig
        from tega.loop.run import run_loop

        rig = open_rig(
            stack,
            config,
            Bus() if bus is None else bus,
            opening=opening,
            prepared=prepared,
            parts=parts,
            progress=progress,
            controls=controls,
            settings=settings,
        )
        return run_loop(stack, rig, clock=clock, controls=controls)
