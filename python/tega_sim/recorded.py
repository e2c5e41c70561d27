"""Record simulated lifts as a session that play, verify, inspect and export read: ``tega-teleop demo --record DIR``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec

from tega.config import FINGERS, RecordingSection, StagesSection
from tega.config.calibration.store import Calibration, FingerMaxima
from tega.haptics import Layout
from tega.loop.pacing import LoopReport
from tega.recording.session import Recording
from tega.records.bus import Bus
from tega.runtime.device_items import DeviceInfo
from tega_sim.gel import CAMERA_HZ
from tega_sim.lab import EMG_HZ, Lab
from tega_sim.plan import TrialResult

_NAME = "simulated"


class LiftRecorder:
    """Records each lift into a file of one session folder, made where it is missing.

    ``dir`` of ``settings`` does not count. Without ``real_time``, lifts do not keep to the machine's clock,
    and a lift waits for the disk. ``reported`` is the outcome of each file, in order. A folder that holds
    something else raises :class:`ConfigError`.
    """

    def __init__(
        self, folder: Path, settings: RecordingSection | None = None, *, real_time: bool = True
    ) -> None:
        self._folder, self._settings = folder, settings or RecordingSection()
        self._real_time = real_time
        self._recording: Recording | None = None
        self.reported: list[dict[str, Any]] = []

    def begin(self, lab: Lab, bus: Bus, *, stages: StagesSection, layout: Layout) -> None:
        """Begin the file of a lift; ``stages`` are its own, since its condition may have another mapping."""
        replace = msgspec.structs.replace
        config = replace(
            lab.config,
            session=replace(
                lab.config.session, pace="real" if self._real_time else "fast", out_dir=None, emulated=True
            ),
            stages=stages,
            recording=replace(self._settings, dir=self._folder.absolute()),
        )
        emg = lab.muscles
        sources = {
            finger: DeviceInfo(
                driver=_NAME, kind="tactile", label=f"{_NAME} {finger}", live=False, rate_hz=CAMERA_HZ
            )
            for finger in FINGERS
        }
        sources["emg"] = DeviceInfo(
            driver=_NAME,
            kind="emg",
            label=f"{_NAME} muscles",
            live=False,
            rate_hz=EMG_HZ,
            channels=emg.channels,
            unit="µV",
        )
        self._recording = Recording(config, self._folder, bus)
        self._recording.describe(
            config,
            calibration=Calibration(
                preset=lab.preset, origin=_NAME, tactile=FingerMaxima(**lab.touch), emg=emg
            ),
            calibration_name=_NAME,
            baselines=lab.baselines,
            sources=sources,
            facts={
                "layout": layout,
                "pace": "steady",
                "live_vest": "false",
                "steered": "true",  # on the angles of its joints, as a real one
                "observed": "true",
            },
        )
        self._recording.start(0, 0)

    def end(self, report: LoopReport, n_waits: int) -> None:
        """Note how the lift's loop ended, after how many deadlines."""
        if self._recording is not None:
            self._recording.ended(report, n_waits)

    def finish(self, result: TrialResult) -> None:
        """Finish the file of a lift, with its result."""
        recording, self._recording = self._recording, None
        if recording is not None:
            self.reported.append(recording.close(msgspec.to_builtins(result)))
