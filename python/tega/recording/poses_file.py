"""Play a recorded path of a forearm as a tracker would give it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import msgspec
from msgspec.structs import astuple

from tega.arm.pose import StampedPose
from tega.arm.settings import MappingSettings
from tega.devices.base import DeviceInfo, Kind, Options
from tega.devices.tracker.sources import RecordedPoses, read_poses
from tega.errors import DeviceUnavailableError, RecordingError
from tega.runtime.files.foreign_file import reports_damage
from tega.runtime.lifecycle import Opened


class PosesFileOptions(Options, frozen=True, kw_only=True):
    """Settings of :class:`PosesFile`.

    Attributes:
        file: A CSV with the columns ``t_s,x_m,y_m,z_m,qx,qy,qz,qw`` and optionally ``valid``; or a session recorded
            with an arm, or one trial of it (``.mcap``), to play its forearm poses as they arrived.
        frame: Axes in which it was recorded; a session knows, and has to agree.
        delay_ms: The poses arrive so late.
    """

    file: Path
    frame: Literal["base", "openxr", "unity", "ros"] = "openxr"
    delay_ms: Annotated[float, msgspec.Meta(ge=0, le=10_000)] = 0.0


class PosesFile(Opened):
    """Plays a recording at its own times, from the first read after it was opened; once it has ended no pose comes."""

    kind: ClassVar[Kind] = "tracker"
    summary: ClassVar[str] = "a recorded path of a forearm (CSV, or a session)"
    options_type: ClassVar[type[Options]] = PosesFileOptions

    def __init__(self, options: PosesFileOptions) -> None:
        self._options = options
        self._poses: RecordedPoses | None = None
        self.frame: str = options.frame

    @property
    def info(self) -> DeviceInfo:
        """Description of the recording."""
        label, notes = self._options.file.name, ("the forearm's path is a recording",)
        return DeviceInfo(driver="poses-file", kind="tracker", label=label, live=True, unit="m", notes=notes)

    @property
    def problem(self) -> str:
        """Say that the recording is over, once it is; ``""`` before."""
        done = self._poses is not None and self._poses.done
        return f"poses-file: {self._options.file.name} has ended" if done else ""

    def open(self) -> None:
        """Read the file; ``RecordingError`` also for no poses in it, or a session in other axes."""
        if self._poses is None:
            self._poses = RecordedPoses(self._read_file(), delay_ns=round(self._options.delay_ms * 1e6))

    def _read_file(self) -> list[StampedPose]:
        file = self._options.file
        if file.suffix != ".mcap" and not file.is_dir():
            return read_poses(file)
        from tega.recording.mcap_folder import session_files

        mapping, poses = forearm(session_files(file)[0])
        if mapping.frame != self.frame:
            raise RecordingError(
                f"poses-file: {file.name} was recorded in the axes {mapping.frame!r}, not {self.frame!r}",
                f"set frame = {mapping.frame!r}, and arm.mapping.frame alike",
            )
        return poses

    def close(self) -> None:
        """Forget it."""
        self._poses = None

    def read(self, now_ns: int) -> Sequence[StampedPose]:
        """Return the poses that are due since the last call, from an open file."""
        if self._poses is None:
            raise DeviceUnavailableError("poses-file: it is not open", "use it in a with block")
        return self._poses.read(now_ns)


@reports_damage
def forearm(path: Path) -> tuple[MappingSettings, list[StampedPose]]:
    """Return how a recorded run turned forearm poses into the base's axes, and the poses as they came.

    ``RecordingError`` also where it has no tracked forearm.
    """
    from tega.recording.replay.feed import RecordFeed
    from tega.records import ArmTurn

    feed = RecordFeed(path)
    turns = feed.collect(ArmTurn)
    feed.read_rest()
    poses = [StampedPose(*astuple(pose)) for turn in turns for pose in turn.poses]
    if not poses:
        raise RecordingError(f"{path.name}: no forearm was tracked in it", "name a run with an [arm]")
    return feed.head.arm.mapping, poses
