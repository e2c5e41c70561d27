"""A fingertip at its firmest moment in a trial, for Fig 3: kept by a simulated session, or found in a recording."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple, cast

import numpy as np

from tega.errors import MissingExtraError, RecordingError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tega.study.plan import PlannedTrial
    from tega.study.trials import Trial

__all__ = [
    "FingerPicture",
    "picture_path",
    "pictures_of",
    "read_touch_picture",
    "recorded_picture",
    "write_touch_picture",
]


class FingerPicture(NamedTuple):
    """One fingertip, at the frame of its largest contact area.

    Attributes:
        finger: Which.
        preset: Readings of the loop, which turn the picture into a pressure map.
        baseline: The untouched gel, BGR, uint8 (H, W, 3).
        frame: The gel when touched most, likewise.
        cci_max: CCI that counts as full; 0 where it is not known.
        eda_max: EDA that counts as full, pixels; likewise.
    """

    finger: str
    preset: Literal["paper", "live"]
    baseline: NDArray[np.uint8]
    frame: NDArray[np.uint8]
    cci_max: float
    eda_max: float


def picture_path(folder: Path, trial: Trial | PlannedTrial) -> Path:
    """Return where a simulated trial's picture is: ``pictures/<person>/<trial>.npz``."""
    return folder / "pictures" / trial.participant / f"{trial.id}.npz"


def write_touch_picture(path: Path, picture: FingerPicture) -> None:
    """Write a picture; equal pictures give equal bytes."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:
        np.savez_compressed(
            file,
            finger=np.array(picture.finger),
            preset=np.array(picture.preset),
            baseline=picture.baseline,
            frame=picture.frame,
            maxima=np.array([picture.cci_max, picture.eda_max]),
        )


def read_touch_picture(path: Path) -> FingerPicture:
    """Read a picture.

    Raises:
        RecordingError: The file is missing or damaged.
    """
    try:
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as file:
            finger, preset = str(file["finger"]), str(file["preset"])
            baseline, frame = file["baseline"], file["frame"]
            cci_max, eda_max = (float(one) for one in file["maxima"])
    except Exception as error:  # a damaged archive raises what its decoder raises
        raise RecordingError(f"{path}: no picture of a finger: {error}", "restore it from a copy") from error
    if preset not in {"paper", "live"} or frame.dtype != np.uint8 or frame.shape != baseline.shape:
        raise RecordingError(
            f"{path}: preset {preset!r}, frame {frame.dtype} {frame.shape}, baseline {baseline.shape}",
            "restore it from a copy",
        )
    readings = cast("Literal['paper', 'live']", preset)
    return FingerPicture(finger, readings, baseline, frame, cci_max, eda_max)


def recorded_picture(folder: Path) -> FingerPicture | None:
    """Find the frame with the largest contact area in a trial's recording.

    Args:
        folder: Of the attempt: ``recordings/p01/p01-t07-a1``.

    Returns:
        ``None`` where no finger touched anything, or nothing is recorded.

    Raises:
        RecordingError: The recording is damaged.
        MissingExtraError: A package of the extra ``record`` is not installed.
    """
    from tega.calibration.store import parse_calibration
    from tega.recording.mcap_reader import McapReader

    files = sorted(folder.glob("*.mcap"))
    if not files:
        return None
    reader = McapReader(files[0])
    firmest: tuple[int, str, int] | None = None
    for message in reader.messages(lambda topic: topic.endswith("/contact")):
        value = message.value
        if value is not None and value.in_contact and (firmest is None or value.eda > firmest[0]):
            firmest = value.eda, message.topic.split("/")[-2], value.t_ns
    if firmest is None:
        return None
    _, finger, t_ns = firmest
    calibration = parse_calibration(reader.files["calibration.toml"].decode(), files[0].name)
    baseline = np.load(io.BytesIO(reader.files[f"baseline-{finger}.npy"]), allow_pickle=False)
    frame = _frame_at(files[0], finger, t_ns)
    if frame is None:
        return None
    maxima = calibration.touch(finger)
    full = (0.0, 0.0) if maxima is None else (maxima.cci_max or 0.0, maxima.eda_max or 0.0)
    return FingerPicture(finger, calibration.preset, baseline, frame, *full)


def _frame_at(path: Path, finger: str, t_ns: int) -> NDArray[np.uint8] | None:
    """Return a finger's picture of a time; its numbers are written right behind it."""
    from tega.recording.mcap_reader import McapReader, read_picture

    image = f"/tactile/{finger}/image"
    newest = None
    for message in McapReader(path).messages(lambda topic: topic in {image, f"/tactile/{finger}/frame"}):
        if message.value is None:
            continue
        if message.topic == image:
            newest = message
        elif newest is not None and message.value.t_ns == t_ns:
            return read_picture(newest)
    return None


def pictures_of(
    folder: Path, trials: Sequence[Trial], objects: Sequence[str], condition: str
) -> dict[str, FingerPicture]:
    """Choose Fig 3's pictures: of the first person who has any, the first trial of each object with a contact.

    Args:
        folder: The study's folder.
        trials: Its trials.
        objects: In the order of the figure.
        condition: Preferred, the first of the study; touch is measured in the others as well.

    Returns:
        By trial id; empty where nothing was kept or recorded, or the extra ``record`` is not installed.
    """
    for person in dict.fromkeys(trial.participant for trial in trials):
        found = {}
        for name in objects:
            mine = [t for t in trials if t.counts and (t.participant, t.object) == (person, name)]
            for trial in sorted(mine, key=lambda one: one.condition != condition):
                picture = _picture_of(folder, trial)
                if picture is not None:
                    found[trial.id] = picture
                    break
        if found:
            return found
    return {}


def _picture_of(folder: Path, trial: Trial) -> FingerPicture | None:
    path = picture_path(folder, trial)
    if path.exists():
        return read_touch_picture(path)
    attempts = sorted((folder / "recordings" / trial.participant).glob(f"{trial.id}-a*"))
    try:
        return recorded_picture(attempts[-1]) if attempts else None
    except MissingExtraError:  # the numbers do not need it; the page then has no Fig 3
        return None
