"""Keep a fingertip's picture at its firmest moment in a simulated trial, or find it in a recording, for Fig 3."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.config.choose import finger_metric, preset_metric
from tega.errors import MissingExtraError, RecordingError
from tega.records import Contact
from tega.runtime.files.foreign_file import read_foreign
from tega.stages.base import Metric, TouchMap
from tega.ui.view.state import TouchImage
from tega_study.plan import PlannedTrial
from tega_study.trials import Trial

Preset: TypeAlias = Literal["paper", "live"]

# So often a metric with a memory is shown one picture, until what it says of it no longer changes.
_SETTLED_FRAMES = 6
_FRAME_NS = 16_666_667


class FingerPicture(NamedTuple):
    """One fingertip, at the frame in which the sum of its touch map is largest.

    Attributes:
        baseline: The untouched gel, BGR, uint8 (H, W, 3).
        touch: The gel when touched most, with the contact and the map of the metric that the loop used.
        cci_max: CCI that counts as full; so does ``eda_max``, pixels. 0 where it is not known.
    """

    finger: str
    preset: Preset
    baseline: NDArray[np.uint8]
    touch: TouchImage
    cci_max: float
    eda_max: float


def picture_path(folder: Path, trial: Trial | PlannedTrial) -> Path:
    """Return where a simulated trial's picture is: ``pictures/<person>/<trial>.npz``."""
    return folder / "pictures" / trial.participant / f"{trial.id}.npz"


def write_touch_picture(path: Path, picture: FingerPicture) -> None:
    """Write a picture; equal pictures give equal bytes."""
    frame, contact, touch_map = picture.touch
    arrays: dict[str, Any] = {
        "finger": np.array(picture.finger),
        "preset": np.array(picture.preset),
        "baseline": picture.baseline,
        "frame": frame,
        "maxima": np.array([picture.cci_max, picture.eda_max]),
        "numbers": np.array([getattr(contact, name) for name in _NUMBERS]),
        "places": np.array([*contact.centroid_xy, *contact.peak_xy]),
        "in_contact": np.array(contact.in_contact),
    }
    if touch_map is not None:
        arrays |= {"height": touch_map.height, "unit": np.array(touch_map.unit), "mask": touch_map.mask}
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:
        np.savez_compressed(file, **arrays)


# Numbers of a contact in the order in which a picture's file has them.
_NUMBERS = ("mass", "spread", "threshold", "eda", "cci", "peak")


def _touch(file: Any, frame: NDArray[np.uint8]) -> TouchImage:
    """Return a frame with its measurements from the arrays of its file."""
    numbers: dict[str, Any] = dict(zip(_NUMBERS, (float(one) for one in file["numbers"]), strict=True))
    numbers["eda"] = int(numbers["eda"])
    x, y, peak_x, peak_y = (float(one) for one in file["places"])
    places: dict[str, Any] = {"centroid_xy": (x, y), "peak_xy": (int(peak_x), int(peak_y))}
    finger, touched = str(file["finger"]), bool(file["in_contact"])
    contact = Contact(finger=finger, t_ns=0, in_contact=touched, **places, **numbers)
    if "mask" not in file:
        return TouchImage(frame, contact)
    height, unit, mask = file["height"], str(file["unit"]), file["mask"]
    return TouchImage(frame, contact, TouchMap(height.astype(np.float32), unit, mask.astype(np.bool_)))


def _measured_now(frame: NDArray[np.uint8], baseline: NDArray[np.uint8], preset: Preset) -> TouchImage:
    """Measure a frame from an earlier version's file, which lacks the loop's measurements."""
    metric = preset_metric(preset, baseline)
    for k in range(_SETTLED_FRAMES):
        contact = metric.update(frame, k * _FRAME_NS)
    return TouchImage(frame, contact, metric.touch_map())


def read_touch_picture(path: Path) -> FingerPicture:
    """Read a picture; ``RecordingError`` if the file is missing or damaged."""
    try:
        with np.load(io.BytesIO(read_foreign(path, most_mib=64)), allow_pickle=False) as file:
            finger = str(file["finger"])
            preset: Any = str(file["preset"])
            baseline, frame = file["baseline"], file["frame"]
            cci_max, eda_max = (float(one) for one in file["maxima"])
            known = _touch(file, frame) if "numbers" in file else None
    except RecordingError:
        raise
    except Exception as error:  # a damaged archive raises what its decoder raises
        raise RecordingError(f"{path}: no picture of a finger: {error}", "restore it from a copy") from error
    if preset not in {"paper", "live"} or frame.dtype != np.uint8 or frame.shape != baseline.shape:
        raise RecordingError(
            f"{path}: preset {preset!r}, frame {frame.dtype} {frame.shape}, baseline {baseline.shape}",
            "restore it from a copy",
        )
    touch = _measured_now(frame, baseline, preset) if known is None else known
    return FingerPicture(finger, preset, baseline, touch, cci_max, eda_max)


def recorded_picture(folder: Path) -> FingerPicture | None:
    """Find the firmest contact in a trial's recording: the largest sum of the touch map.

    ``folder`` is the attempt's, ``recordings/p01/p01-t07-a1``. ``None`` where no finger touched anything, or
    nothing is recorded.
    """
    from tega.recording.mcap_reader import McapReader
    from tega.recording.replay.head import read_head
    from tega.records.schema import read

    files = sorted(folder.glob("*.mcap"))
    if not files:
        return None
    reader = McapReader(files[0])
    firmest: Contact | None = None
    for message in reader.messages(lambda topic: topic.endswith("/contact")):
        value = message.value
        if value is not None and value.in_contact and (firmest is None or value.mass > firmest.mass):
            firmest = read(Contact, value, finger=message.topic.split("/")[-2])
    if firmest is None:
        return None
    finger = firmest.finger
    head = read_head(reader)
    calibration, baseline = head.calibration, head.baselines[finger]
    maxima = calibration.touch(finger)
    metric = finger_metric(head.config.stages, calibration.preset, finger, baseline, maxima)
    frame = _follow(files[0], finger, metric, firmest.t_ns)
    if frame is None:
        return None
    touch = TouchImage(frame, firmest, metric.touch_map())
    full = (0.0, 0.0) if maxima is None else (maxima.cci_max or 0.0, maxima.eda_max or 0.0)
    return FingerPicture(finger, calibration.preset, baseline, touch, *full)


def _follow(path: Path, finger: str, metric: Metric, t_ns: int) -> NDArray[np.uint8] | None:
    """Show a metric a finger's pictures up to a time, and return the last; ``None`` where it is not recorded.

    A picture's numbers are written right behind it. Numbers are those recorded; the map of a recording with JPEG
    pictures is as near as these.
    """
    from tega.recording.mcap_reader import McapReader, read_picture
    from tega.recording.pictures import paired

    topics = {f"/tactile/{finger}/{what}" for what in ("image", "frame")}
    for message in paired(McapReader(path).messages(lambda topic: topic in topics)):
        if message.image is not None and (metric.memory or message.value.t_ns == t_ns):
            frame = read_picture(message.image)
            metric.loaded = getattr(message.value, "loaded", False)
            if getattr(message.value, "rezeroed", False):
                metric.rezero()
            metric.update(frame, message.value.t_ns)
            if message.value.t_ns >= t_ns:
                return frame if message.value.t_ns == t_ns else None
    return None


def pictures_of(
    folder: Path, trials: Sequence[Trial], objects: Sequence[str], condition: str
) -> dict[str, FingerPicture]:
    """Choose Fig 3's frames by trial id: the first person with any, the first trial of each object with a contact.

    ``condition`` is preferred; touch is measured in the others as well. Empty where nothing was kept or
    recorded, or the extra ``record`` is not installed.
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


class FingerRow(msgspec.Struct, frozen=True, kw_only=True):
    """One fingertip's contact; area (Eq 4) and peak in pixels.

    ``cci_norm`` and ``eda_norm`` are shares of the calibrated press, at most 1.
    """

    trial: str
    object: str
    condition: str
    finger: str
    preset: str
    cci: float
    eda: int
    cci_norm: float | None
    eda_norm: float | None
    peak_x: int
    peak_y: int


def finger_rows(pictures: Mapping[str, FingerPicture], trials: Sequence[Trial]) -> tuple[FingerRow, ...]:
    """Return the contacts that the loop measured in the pictures, by trial id."""
    of = {trial.id: trial for trial in trials}
    return tuple(
        FingerRow(
            trial=trial,
            object=of[trial].object,
            condition=of[trial].condition,
            finger=picture.finger,
            preset=picture.preset,
            cci=float(contact.cci),
            eda=int(contact.eda),
            cci_norm=_share(contact.cci, picture.cci_max),
            eda_norm=_share(contact.eda, picture.eda_max),
            peak_x=int(contact.peak_xy[0]),
            peak_y=int(contact.peak_xy[1]),
        )
        for trial, picture in pictures.items()
        for contact in (picture.touch.contact,)
    )


def _share(value: float, full: float) -> float | None:
    return min(float(value) / full, 1.0) if full > 0 else None
