"""Keep calibrations in one folder: a file for each person and device, and every baseline of a sensor.

::

    calibrations/
        gels/D20641/20261121-150405.png     every baseline taken of this sensor,
        gels/D20641/20261121-150405.toml    and its properties
        vests/127.0.0.1_15881/20261121-150405-motor07.toml   how long that motor takes to start
        people/p01/person.toml              which hand is the person's own: set once
        people/p01/touch-D20641.toml        one file per person and device, the newest
        people/p01/emg-ttyUSB0.toml
        people/p01/vest-127.0.0.1_15881.toml
        people/p01/arm-10.0.0.7_3810.toml   forward direction for that tracker
        people/p01/before/                  the files that those replaced, with their dates
        people/p01/practice/                scores, see tega_learn.logs
        people/p01/fitts/                   results of Fitts tests, see tega_practice.kept
        people/p01/vest-skill/              scores of vest tests, see tega_practice.kept
        people/p01/vest-dose.json           the vest's dose of the last day, see tega.loop.worn_vest
        people/p01/unfinished.json          a calibration that was interrupted, see tega.setup.calibration.sitting
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Literal, NamedTuple, TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.config.calibration.records import (
    ArmRecord,
    CalibrationRecord,
    EmgRecord,
    GelRecord,
    OnsetRecord,
    TouchRecord,
    VestCalibration,
    read_record,
    write_record,
)
from tega.devices.base import DeviceInfo
from tega.errors import CalibrationError, RecordingError
from tega.runtime.files.foreign_file import parse_toml, plain_name, read_words
from tega.runtime.files.toml_text import tree_text
from tega.runtime.files.whole_file import write_whole

Part = Literal["touch", "emg", "vest", "arm"]

OwnHand = Literal["left", "right"]

_FACTS = "person.toml"
_STAMP = "%Y%m%d-%H%M%S"
_Any = TypeVar("_Any", bound=CalibrationRecord)


def checked_person(person: str) -> str:
    """Return a person's code, which becomes a folder's name; ``UnsafeNameError`` if it cannot be one."""
    return plain_name(person, subject="person's code", source="calibration")


def device_name(info: DeviceInfo) -> str:
    """Return a device's serial number or its substitute, fit for a file's name."""
    return re.sub(r"[^A-Za-z0-9._-]+", "_", info.label).strip("._") or info.driver


def part_of(wanted: type[CalibrationRecord]) -> Part:
    """Return the part that a type of a person's records belongs to, as its format ends."""
    part: Part = wanted.__struct_config__.tag.removeprefix("tega-")  # type: ignore[union-attr,assignment]
    return part


class KeptGel(NamedTuple):
    """A baseline as it was kept."""

    record: GelRecord
    picture: Path


class PersonFacts(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Facts of a person on every device, ``person.toml``.

    ``hand`` is the one that steers and is felt: arm and vest follow it.
    """

    hand: OwnHand
    format: Literal["tega-person"] = "tega-person"
    version: Literal[1] = 1


class CalibrationFolder:
    """Reads and writes calibrations."""

    def __init__(self, path: Path) -> None:
        self.path = path

    # Fingertips, for every user.

    def gels(self, device: str) -> list[KeptGel]:
        """Return the baselines of a sensor, oldest first; one that cannot be read is left out."""
        kept = (
            (r, f.with_suffix(".png")) for r, f in _readable(self.path / "gels" / device, "*.toml", GelRecord)
        )
        found = [KeptGel(record, picture) for record, picture in kept if picture.is_file()]
        return sorted(found, key=lambda gel: gel.record.made)

    def keep_gel(self, record: GelRecord, picture: NDArray[np.uint8]) -> Path:
        """Keep a baseline and return its picture's path; needs OpenCV."""
        from tega.runtime.opencv import load_cv2

        _, png = load_cv2(record.driver).imencode(".png", picture)
        path = self.path / "gels" / record.device / f"{record.made.strftime(_STAMP)}.png"
        write_whole(path, bytes(png), sync=True)
        write_record(record, path.with_suffix(".toml"))
        return path

    # Vests, for every wearer.

    def keep_onset(self, record: OnsetRecord) -> Path:
        """Keep how long a motor takes to start, and return the file."""
        name = f"{record.made.strftime(_STAMP)}-motor{record.motor:02}.toml"
        path = self.path / "vests" / record.device / name
        write_record(record, path)
        return path

    def onsets(self, device: str) -> list[OnsetRecord]:
        """Return the newest measurement of each motor of a vest; one that cannot be read is left out."""
        found = _readable(self.path / "vests" / device, "*-motor*.toml", OnsetRecord)
        newest = {record.motor: record for record, _ in found if record.device == device}
        return [newest[motor] for motor in sorted(newest)]

    # People.

    def person(self, person: str) -> Path:
        """Return a person's folder."""
        return self.path / "people" / checked_person(person)

    def hand(self, person: str) -> OwnHand | None:
        """Return a person's hand, ``None`` if it is not set; ``CalibrationError`` if the file is damaged."""
        path = self.person(person) / _FACTS
        if not path.exists():
            return None
        try:
            return msgspec.convert(parse_toml(read_words(path)), PersonFacts).hand
        except (OSError, ValueError, RecordingError) as error:
            raise CalibrationError(
                f"{self.named(path)}: {error}", "delete it, and set the hand again with calibrate --hand"
            ) from error

    def keep_hand(self, person: str, hand: OwnHand) -> Path:
        """Keep the hand of a person, which is set once.

        Raises ``CalibrationError`` if the other hand is stored: existing calibrations were made with it.
        """
        path, kept = self.person(person) / _FACTS, self.hand(person)
        if kept not in {None, hand}:
            raise CalibrationError(
                f"{person}'s hand is kept as the {kept} one",
                f"was that wrong? delete {path}, set it again and calibrate again",
            )
        if kept is None:
            write_whole(path, tree_text(msgspec.to_builtins(PersonFacts(hand=hand))), sync=True)
        return path

    def file(self, person: str, part: Part, device: str) -> Path:
        """Return where a record is kept."""
        return self.person(person) / f"{part}-{device}.toml"

    def file_of(self, record: CalibrationRecord, person: str) -> Path:
        """Return where a person's record is kept."""
        return self.file(person, part_of(type(record)), record.device)

    def named(self, path: Path) -> str:
        """Return a file's name as seen from the folder."""
        return path.relative_to(self.path).as_posix() if path.is_relative_to(self.path) else path.name

    def keep(self, record: TouchRecord | EmgRecord | VestCalibration | ArmRecord) -> Path:
        """Keep a record; the one before goes into ``before/``."""
        path = self.file_of(record, record.person)
        if path.is_file():
            try:
                stamp = read_record(path, type(record)).made.strftime(_STAMP)
            except CalibrationError:
                stamp = "unreadable"
            write_whole(path.parent / "before" / f"{path.stem}.{stamp}.toml", path.read_bytes(), sync=True)
        write_record(record, path)
        return path

    def record(self, person: str, wanted: type[_Any], device: str) -> _Any | None:
        """Return a person's record of a device, or ``None`` where there is none.

        Raises ``CalibrationError`` if it is damaged, or was made for another person or device.
        """
        path = self.file(person, part_of(wanted), device)
        if not path.is_file():
            return None
        found = read_record(path, wanted)
        whose = getattr(found, "person", person)
        if whose != person or found.device != device:
            raise CalibrationError(
                f"{self.named(path)}: was made for {whose} on {found.device}, not for {person} on {device}",
                "calibrate; a copied file is not a calibration",
            )
        return found

    def others(self, person: str, part: Part, device: str) -> str:
        """List the persons or devices with records in place of the missing one."""
        mine = sorted(f.stem.removeprefix(f"{part}-") for f in self.person(person).glob(f"{part}-*.toml"))
        if mine:
            return f"{person} was calibrated on {', '.join(mine)}"
        theirs = sorted(f.parent.name for f in self.path.glob(f"people/*/{part}-{device}.toml"))
        if theirs:
            return f"there is one of {', '.join(theirs)}"
        return ""


def _readable(folder: Path, pattern: str, wanted: type[_Any]) -> Iterator[tuple[_Any, Path]]:
    """Yield the records in a folder that can be read, with their files, in the order of their names."""
    for file in sorted(folder.glob(pattern)):
        try:
            record = read_record(file, wanted)
        except CalibrationError:
            continue
        yield record, file
