"""List a person's recorded trials that count, and read their pictures for raters.

Pictures are those of the fingertips or, on the simulated bench, the object in words. Nothing else of a recording is
read: not the vest's commands nor whether it was on, not the settings, and no muscle signal, in which running motors
could be seen.
"""

from __future__ import annotations

import csv
import io
from bisect import bisect_right
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.config.fingers import in_order
from tega.errors import RecordingError, TegaError
from tega.loop.touch import STALE_NS
from tega.runtime.files.foreign_file import parse_json, read_foreign, read_words
from tega.runtime.lifecycle import require
from tega.runtime.words import number_text
from tega_study.attempt_rows import recording_folder
from tega_study.journal import attempts, events_path, read_events
from tega_study.plan import read_plan


class RecordedTrial(NamedTuple):
    """A trial with a recording, without its condition.

    ``trial``, its number in the plan, is hidden from raters. ``start_ns`` is on the session's clock,
    ``zero_ns`` the trial's start, counted from the recording's.
    """

    id: str
    trial: int
    attempt: int
    object: str
    start_ns: int
    length_ns: int
    zero_ns: int
    folder: Path


class _Facts(msgspec.Struct):
    """Content of ``trial.json`` that is used."""

    trial: str
    attempt: int
    zero_ns: int
    started_ns: int


def recorded_trials(folder: Path, participant: str) -> tuple[list[RecordedTrial], list[str]]:
    """Return a person's recorded trials that count, in the plan's order.

    Also the reasons why others have no usable recording, as far as known without reading it.
    """
    events = read_events(events_path(folder, participant))
    ended = {start.trial: (start, end) for start, end in attempts(events, with_data=True)}
    found: list[RecordedTrial] = []
    unseen: list[str] = []
    for trial in sorted(read_plan(folder).of(participant), key=lambda one: one.trial):
        if trial.trial not in ended:
            continue
        start, end = ended[trial.trial]
        where = recording_folder(folder, trial, start.attempt)
        try:
            zero_ns = _begins(where, trial.id, start.attempt, start.t_ns)
        except RecordingError as error:
            unseen.append(f"{trial.id}: {error.message}")
            continue
        key, length_ns = (trial.id, trial.trial, start.attempt), max(end.t_ns - start.t_ns, 1)
        found.append(RecordedTrial(*key, trial.object, start.t_ns, length_ns, zero_ns, where))
    return found, unseen


def _begins(where: Path, trial_id: str, attempt: int, start_ns: int) -> int:
    """Return where in its recording a trial begins, nanoseconds."""
    if not (path := where / "trial.json").exists():
        raise RecordingError("no recording" if not where.exists() else "trial.json is missing")
    try:
        facts = parse_json(read_foreign(path, most_mib=1), _Facts)
    except (msgspec.DecodeError, OSError) as error:
        raise RecordingError(f"trial.json is damaged: {error}") from error
    if (facts.trial, facts.attempt) != (trial_id, attempt):
        raise RecordingError(f"the recording is of another trial, {facts.trial} attempt {facts.attempt}")
    if facts.started_ns != start_ns:
        raise RecordingError("the recording is of another session, begun at another time")
    if not any(where.glob("*.mcap")) and not (where / "truth.csv").exists():
        unfinished = any(where.glob("*.part"))
        raise RecordingError("the recording was never finished" if unfinished else "no recording")
    return start_ns - facts.zero_ns


_APART_NS = 30_000_000
"""A clip shows no more pictures than that."""

_FAR_NS = 1_000_000_000
"""Further from where ``trial.json`` says it began, a recording is another one."""

_SHORT_NS = 500_000_000
"""So much of a trial's end a recording may lack: its last items are on their way when it ends."""


class _Strip(NamedTuple):
    t_ns: list[int]
    jpegs: list[bytes]


class _Truth(NamedTuple):
    """State of the object on the simulated bench, which has no pictures."""

    height_m: float
    slid_m: float
    pressed_in_m: float


class Reel:
    """A recording, ready to be looked at: pictures by finger, or the truth. Times count from the trial's start.

    ``boot_ns`` is the time of day at which the machine's clock was 0; ``None`` on the simulated bench.
    ``fingers`` has those with a picture, thumb first.
    """

    def __init__(
        self,
        strips: dict[str, _Strip],
        truth_t_ns: Sequence[int] = (),
        truth: Sequence[_Truth] = (),
        *,
        boot_ns: int | None = None,
    ) -> None:
        self.boot_ns = boot_ns
        self.fingers = list(in_order(strips))
        self._strips, self._truth_t_ns, self._truth = strips, truth_t_ns, truth
        self._decoded: dict[str, tuple[int, NDArray[np.uint8] | None]] = {}

    def picture(self, finger: str, at_ns: int) -> NDArray[np.uint8] | None:
        """Return a finger's newest picture at a moment, uint8 (H, W, 3), BGR; ``None`` without a fresh one."""
        strip = self._strips[finger]
        place = bisect_right(strip.t_ns, at_ns) - 1
        if place < 0 or at_ns - strip.t_ns[place] > STALE_NS:  # a picture that stands still would deceive
            return None
        if finger not in self._decoded or self._decoded[finger][0] != place:
            import cv2

            frame: Any = cv2.imdecode(np.frombuffer(strip.jpegs[place], np.uint8), cv2.IMREAD_COLOR)
            self._decoded[finger] = place, frame
        return self._decoded[finger][1]

    def lines(self, at_ns: int) -> list[str]:
        """Return the simulated bench's state of the object at a moment, in words."""
        if (place := bisect_right(self._truth_t_ns, at_ns)) == 0:
            return []
        truth = self._truth[place - 1]
        return [
            "pictures: none, simulated",
            f"height: {number_text(truth.height_m * 100, decimals=1)} cm",
            f"slid in the hand: {number_text(truth.slid_m * 1e3, decimals=1)} mm",
            f"pressed in: {number_text(truth.pressed_in_m * 1e3, decimals=1)} mm",
        ]


def read_reel(trial: RecordedTrial) -> Reel:
    """Read a trial's recording; ``RecordingError`` if it is damaged, unfinished, or not of this trial."""
    files = sorted(trial.folder.glob("*.mcap"))
    if len(files) > 1:
        raise RecordingError(f"{len(files)} recordings in one folder: {', '.join(f.name for f in files)}")
    return _of_devices(trial, files[0]) if files else _of_bench(trial)


def _of_devices(trial: RecordedTrial, path: Path) -> Reel:
    """Read an MCAP file once, from its beginning to its end."""
    from tega.recording.mcap_reader import McapReader, read_picture
    from tega.recording.pictures import paired

    cv2 = require("cv2", driver="recording", extra="record")
    reader = McapReader(path)
    strips: dict[str, _Strip] = {}
    newest_ns = 0
    try:
        for message in paired(
            reader.messages(lambda topic: topic.endswith(("/image", "/frame", "/hand/joints")))
        ):
            since_ns = message.log_ns - int(reader.metadata["tega"]["epoch_ns"]) - trial.zero_ns
            newest_ns = max(newest_ns, since_ns)
            if message.schema == "tega.Frame":
                strip = strips.setdefault(message.topic.split("/")[2], _Strip([], []))
                t_ns, picture = message.value.t_ns - trial.zero_ns, message.image
                if picture is None or (strip.t_ns and t_ns - strip.t_ns[-1] < _APART_NS):
                    continue
                if picture.schema == "foxglove.CompressedImage":
                    data = bytes(picture.value.data)
                else:  # of a lossless recording: raw they do not fit into memory
                    quality = [cv2.IMWRITE_JPEG_QUALITY, 95]
                    data = cv2.imencode(".jpg", read_picture(picture), quality)[1].tobytes()
                strip.t_ns.append(t_ns)
                strip.jpegs.append(data)
    except TegaError:
        raise
    except Exception as error:  # of a damaged file decoders raise what they like
        raise RecordingError(f"{path.name} is damaged: {type(error).__name__}: {error}") from error
    if reader.cut or "end" not in reader.metadata:
        raise RecordingError(f"{path.name} is damaged or was never finished")
    try:
        began_ns, epoch_ns = (int(reader.metadata["tega"][name]) for name in ("start_ns", "epoch_ns"))
    except (KeyError, ValueError) as error:
        raise RecordingError(f"{path.name} is damaged: {error}") from error
    if abs(began_ns - (trial.start_ns - trial.zero_ns)) > _FAR_NS:
        raise RecordingError(f"{path.name} is of another trial: it was begun at another time")
    _reaches(trial, newest_ns)
    return Reel(strips, boot_ns=epoch_ns - began_ns)


def _of_bench(trial: RecordedTrial) -> Reel:
    """Read the object's states that a simulated bench recorded; it has no frames."""
    truth_t_ns, truth = [], []
    try:
        text = read_words(trial.folder / "truth.csv", most_mib=256)
        for row in csv.DictReader(io.StringIO(text, newline="")):
            truth_t_ns.append(round(float(row["t_s"]) * 1e9))
            truth.append(_Truth(*(float(row[n]) for n in ("object_height_m", "slip_m", "deformation_m"))))
    except (OSError, ValueError, OverflowError, KeyError, TypeError, csv.Error) as error:
        raise RecordingError(f"truth.csv is damaged: {error}") from error
    _reaches(trial, truth_t_ns[-1] if truth_t_ns else 0)
    return Reel({}, truth_t_ns, truth)


def _reaches(trial: RecordedTrial, newest_ns: int) -> None:
    """Refuse a recording that ends before its trial."""
    if newest_ns < trial.length_ns - _SHORT_NS:
        raise RecordingError(
            f"the recording ends at {max(newest_ns, 0) / 1e9:.1f} s of {trial.length_ns / 1e9:.1f} s"
        )
