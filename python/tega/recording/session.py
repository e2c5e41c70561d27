"""The recording of one run: folder, recorder and tap, put together."""

from __future__ import annotations

import json
import logging
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from tega.recording.mcap_folder import SessionFolder
from tega.recording.mcap_recorder import McapRecorder
from tega.recording.tap import SessionTap

if TYPE_CHECKING:
    from pathlib import Path

    from tega.clock import Clock
    from tega.config import SessionConfig
    from tega.devices.base import VestSink
    from tega.safety.guard import Guard
    from tega.teleop.arm import Steering
    from tega.teleop.keepalive import KeepAlive
    from tega.teleop.latency import LatencyTrace
    from tega.teleop.loop_report import LoopReport
    from tega.teleop.prepare import Prepared
    from tega.teleop.run import LoopParts

__all__ = ["Recording"]

_LOG = logging.getLogger(__name__)


class Recording:
    """Records one run; make it before the devices are opened, so that what is missing is told first.

    Args:
        config: The settings; their ``recording.dir`` is the session's folder.
        folder: That folder.

    Raises:
        MissingExtraError: A package of the extra ``record`` is not installed.
        ConfigError: The folder holds something else.
    """

    def __init__(self, config: SessionConfig, folder: Path) -> None:
        self.folder = SessionFolder(folder)
        for recovered in self.folder.recovered:
            _LOG.warning(
                "recording: %s was not finished; recovered %d messages",
                recovered.path.name,
                recovered.n_messages,
            )
        self.recorder = McapRecorder(self.folder, config.recording, wait=config.session.pace == "fast")
        self.tap = SessionTap(self.recorder, config)
        self._begun = False

    def watch(self, prepared: Prepared) -> Prepared:
        """Return what a run starts with, with sources that are recorded as they are read."""
        return self.tap.watch(prepared)

    def vest(self, vest: VestSink) -> VestSink:
        """Return a vest whose frames are recorded as it says they were sent."""
        tapped: VestSink = self.tap.vest(vest)
        return tapped

    def listen(self, driver: object) -> None:
        """Hear what a hand's driver exchanges with it, from its opening on."""
        self.tap.listen(driver)

    def begin(
        self,
        parts: LoopParts,
        clock: Clock,
        *,
        layout: str,
        pace: str,
        kept: Sequence[KeepAlive],
        steered: bool,
        observed: bool,
    ) -> tuple[LoopParts, int]:
        """Begin, and return the loop's parts with a recorder between them, and the start of the session."""
        tap = self.tap
        pacer = tap.pacer(clock, parts.pacer.bell)
        hand = tap.hand(parts.hand)
        tap.head(
            layout=layout,
            pace=pace,
            live_vest=bool(kept),
            in_steps=any(vest.in_steps for vest in kept),
            steered=steered,
            observed=observed,
        )
        start_ns = pacer.start()
        tap.begin(start_ns)
        self._begun = True
        parts = parts._replace(
            pacer=pacer,
            hand=hand,
            vests=[*parts.vests, tap.write_vest()],
            hands=[*parts.hands, tap.write_hand()],
            recorder=tap.recorder(parts.recorder),
            haptics=tap.haptics(parts.haptics),
            inputs=tap.inputs(parts.inputs),
        )
        return parts, start_ns

    def lead(self, steering: Steering) -> None:
        """Take note of an arm, before the recording begins."""
        self.tap.lead(steering.infos)

    def follow_arm(self, steering: Steering) -> None:
        """Record every turn of what leads the arm; once the recording has begun."""
        steering.observers.append(self.tap.arm())

    def follow(self, guard: Guard, trace: LatencyTrace | None) -> None:
        """Record the run's states, what is wrong, and the way of every picture and block through the loop."""
        guard.observers.append(self.tap.state)
        guard.alert_observers.append(self.tap.alert)
        if trace is not None:
            trace.observers.append(self.tap.latency)
            if trace.motor is not None:
                self.recorder.value(0, trace.motor.stage, trace.motor.ms)

    def problem(self) -> str:
        """Return why no more is recorded, or how much was not; ``""`` while all is well."""
        if self.recorder.state == "stopped":
            return f"recording: stopped: {self.recorder.reason}"
        n_dropped = sum(self.recorder.dropped.values())
        return f"recording: {n_dropped} records dropped, the disk does not keep up" if n_dropped else ""

    def ended(self, report: LoopReport) -> None:
        """Record how the loop ended."""
        self.tap.end(report)

    def finish(self, summary: Mapping[str, Any]) -> dict[str, Any]:
        """Finish the file, and return what became of it."""
        return self.recorder.finish(json.dumps(summary, ensure_ascii=False).encode())

    def abandon(self) -> None:
        """Take away the file of a run that never began."""
        if not self._begun:
            self.recorder.abandon()
