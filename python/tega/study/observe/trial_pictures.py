"""Read a trial's recording for a rater: fingertip pictures, their contacts, and the hand.

Nothing else of the recording is read: not what the vest was told nor whether it was on, not the settings, and no muscle
signal, in which motors that turn could be seen.
"""

from __future__ import annotations

import csv
import io
from bisect import bisect_right
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from tega.errors import RecordingError, TegaError
from tega.foreign_file import load_npy, read_words
from tega.hand import JOINT_NAMES
from tega.inbox.sources import metrics_of
from tega.records import Contact
from tega.records.schema import read
from tega.study.hand_rows import read_hand
from tega.tactile import ContactMetrics
from tega.teleop.moment import LoopView
from tega.teleop.touch import STALE_NS
from tega.view.state import TouchImage, ViewState

if TYPE_CHECKING:
    from tega.study.observe.recorded import RecordedTrial


_APART_NS = 30_000_000
"""The page shows no more pictures than that."""

_FAR_NS = 1_000_000_000
"""Further from where ``trial.json`` says it began, a recording is another one."""

_SHORT_NS = 500_000_000
"""So much of a trial's end a recording may lack: its last items are on their way when it ends."""


class _Strip:
    """A fingertip's pictures as JPEG, rising in time, and what the run measured in each, by its time."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        self.shape = shape
        self.metrics: dict[int, ContactMetrics] = {}
        self.t_ns: list[int] = []
        self.jpegs: list[bytes] = []


class ReelTruth(NamedTuple):
    """State of the object on the simulated bench, which has no pictures."""

    height_m: float
    slid_m: float
    pressed_in_m: float


class Reel:
    """A recording, ready to be looked at. Times count from the trial's start.

    Args:
        strips: Pictures by finger.
        hand_t_ns: Times of the hand's angles, rising.
        angles_rad: Its 16 joint angles at those times.
        truth_t_ns: Times of the object's truth, rising; none outside the simulated bench.
        truth: The object at those times.
    """

    def __init__(
        self,
        *,
        strips: dict[str, _Strip] | None = None,
        hand_t_ns: Sequence[int] = (),
        angles_rad: Sequence[Sequence[float]] = (),
        truth_t_ns: Sequence[int] = (),
        truth: Sequence[ReelTruth] = (),
    ) -> None:
        self._strips = strips or {}
        self._hand_t_ns, self._angles = hand_t_ns, angles_rad
        self._truth_t_ns, self._truth = truth_t_ns, truth
        self._decoded: dict[str, tuple[int, TouchImage]] = {}
        self._figure: Any = None

    def at(self, at_ns: int, rows: dict[str, str]) -> ViewState:
        """Return the pictures, the hand and the lines of text at a moment, for display.

        Args:
            at_ns: Since the trial's start, nanoseconds.
            rows: Lines of text to show with it.
        """
        shapes = poses = None
        if (place := bisect_right(self._hand_t_ns, at_ns)) > 0:
            if self._figure is None:
                from tega.view.browser.hand_figure import HandFigure

                self._figure = HandFigure()
            shapes, poses = self._figure.shapes, self._figure.poses(self._angles[place - 1])
        if (place := bisect_right(self._truth_t_ns, at_ns)) > 0:
            truth = self._truth[place - 1]
            rows = {
                **rows,
                "pictures": "none, simulated",
                "height": f"{truth.height_m * 100:.1f} cm",
                "slid in the hand": f"{truth.slid_m * 1e3:.1f} mm",
                "pressed in": f"{truth.pressed_in_m * 1e3:.1f} mm",
            }
        images = {finger: image for finger in self._strips if (image := self._image(finger, at_ns))}
        nothing = LoopView(
            t_ns=at_ns, contacts={}, felt=(), vest=None, block=None, angles_rad=None, counts={}
        )
        return ViewState(at_ns, nothing, images=images or None, shapes=shapes, poses=poses, rows=rows)

    def _image(self, finger: str, at_ns: int) -> TouchImage | None:
        strip = self._strips[finger]
        place = bisect_right(strip.t_ns, at_ns) - 1
        if place < 0 or at_ns - strip.t_ns[place] > STALE_NS:  # a picture that stands still would deceive
            return None
        if finger not in self._decoded or self._decoded[finger][0] != place:
            import cv2

            frame: Any = cv2.imdecode(np.frombuffer(strip.jpegs[place], np.uint8), cv2.IMREAD_COLOR)
            if frame is None or frame.shape != strip.shape:
                return None
            self._decoded[finger] = (
                place,
                TouchImage(frame, strip.metrics.get(strip.t_ns[place], ContactMetrics())),
            )
        return self._decoded[finger][1]


def read_reel(trial: RecordedTrial) -> Reel:
    """Read a trial's recording.

    Raises:
        RecordingError: It is damaged, unfinished, or not of this trial.
        MissingExtraError: A package of the extra ``record`` is not installed.
    """
    files = sorted(trial.folder.glob("*.mcap"))
    if len(files) > 1:
        raise RecordingError(f"{len(files)} recordings in one folder: {', '.join(f.name for f in files)}")
    return _of_devices(trial, files[0]) if files else _of_bench(trial)


def _of_devices(trial: RecordedTrial, path: Path) -> Reel:
    """Read an MCAP file once, from its beginning to its end."""
    from tega.lifecycle import require
    from tega.recording.mcap_reader import McapReader

    cv2 = require("cv2", driver="recording", extra="record")
    reader = McapReader(path, check_sums=True)
    strips: dict[str, _Strip] = {}
    hand_t_ns: list[int] = []
    angles: list[list[float]] = []
    pictures: dict[str, Any] = {}
    newest_ns = 0
    try:
        for message in reader.messages(
            lambda topic: topic.endswith(("/image", "/frame", "/contact", "/hand/joints"))
        ):
            since_ns = message.log_ns - int(reader.metadata["tega"]["epoch_ns"]) - trial.zero_ns
            newest_ns = max(newest_ns, since_ns)
            if message.schema in {"foxglove.RawImage", "foxglove.CompressedImage"}:
                pictures[message.topic.split("/")[2]] = message
            elif message.schema == "foxglove.JointStates":
                hand_t_ns.append(since_ns)
                angles.append(_angles(message.value))
            elif message.schema in {"tega.Frame", "tega.Contact"}:
                finger = message.topic.split("/")[2]
                if finger not in strips:
                    strips[finger] = _Strip(
                        load_npy(reader.files[f"baseline-{finger}.npy"], trial.folder.name).shape
                    )
                if message.schema == "tega.Contact":
                    contact = read(Contact, message.value, finger=finger)
                    strips[finger].metrics[contact.t_ns - trial.zero_ns] = metrics_of(contact)
                    continue
                _keep(strips[finger], message.value.t_ns - trial.zero_ns, pictures.pop(finger, None), cv2)
    except TegaError:
        raise
    except Exception as error:  # of a damaged file decoders raise what they like
        raise RecordingError(f"{path.name} is damaged: {type(error).__name__}: {error}") from error
    if reader.cut or "end" not in reader.metadata:
        raise RecordingError(f"{path.name} is damaged or was never finished")
    try:
        began_ns = int(reader.metadata["tega"]["start_ns"])
    except (KeyError, ValueError) as error:
        raise RecordingError(f"{path.name} is damaged: {error}") from error
    if abs(began_ns - (trial.start_ns - trial.zero_ns)) > _FAR_NS:
        raise RecordingError(f"{path.name} is of another trial: it was begun at another time")
    _reaches(trial, newest_ns)
    return Reel(strips=strips, hand_t_ns=hand_t_ns, angles_rad=angles)


def _angles(states: Any) -> list[float]:
    """Return the hand's angles.

    Raises:
        ValueError: They are not those of a hand.
    """
    angles = [float(joint.position) for joint in states.joints]
    if len(angles) != len(JOINT_NAMES):
        raise ValueError(f"{len(angles)} joints, expected {len(JOINT_NAMES)}")
    return angles


def _keep(strip: _Strip, t_ns: int, picture: Any, cv2: Any) -> None:
    """Keep a picture as it is recorded or, of a lossless recording, as JPEG: raw they don't fit into memory."""
    from tega.recording.mcap_reader import read_picture

    if picture is None or (strip.t_ns and t_ns - strip.t_ns[-1] < _APART_NS):
        return
    if picture.schema == "foxglove.CompressedImage":
        data = bytes(picture.value.data)
    else:
        data = cv2.imencode(".jpg", read_picture(picture), [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes()
    strip.t_ns.append(t_ns)
    strip.jpegs.append(data)


def _of_bench(trial: RecordedTrial) -> Reel:
    """Read what the simulated bench keeps, which has no pictures: the hand's closure, and the object's truth."""
    from tega.sim.world.poses import GRASP_POSES_RAD

    rows = read_hand(trial.folder / "hand.csv")
    closures = [(round(row.t_s * 1e9), row.closure) for row in rows if row.closure is not None]
    at = [closure for _, closure in closures]
    levels = np.arange(1.0, 6.0)
    angles = np.array([np.interp(at, levels, joint) for joint in GRASP_POSES_RAD.T]).T
    truth_t_ns, truth = [], []
    try:
        text = read_words(trial.folder / "truth.csv", most_mib=256)
        for row in csv.DictReader(io.StringIO(text, newline="")):
            truth_t_ns.append(round(float(row["t_s"]) * 1e9))
            numbers = (float(row[n]) for n in ("object_height_m", "slip_m", "deformation_m"))
            truth.append(ReelTruth(*numbers))
    except (OSError, ValueError, OverflowError, KeyError, TypeError, csv.Error) as error:
        raise RecordingError(f"truth.csv is damaged: {error}") from error
    _reaches(trial, truth_t_ns[-1] if truth_t_ns else 0)
    return Reel(
        hand_t_ns=[t_ns for t_ns, _ in closures],
        angles_rad=angles.tolist(),
        truth_t_ns=truth_t_ns,
        truth=truth,
    )


def _reaches(trial: RecordedTrial, newest_ns: int) -> None:
    """Refuse a recording that ends before its trial.

    Raises:
        RecordingError: It does.
    """
    if newest_ns < trial.length_ns - _SHORT_NS:
        raise RecordingError(
            f"the recording ends at {max(newest_ns, 0) / 1e9:.1f} s of {trial.length_ns / 1e9:.1f} s"
        )
