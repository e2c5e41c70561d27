"""Define a calibration's records, as TOML that people read: one a file, dated, units in the keys' names.

A record is written whole or not at all, and refused where its format or version is not known. Times are UTC.
"""

from __future__ import annotations

import math
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, ClassVar, Literal, TypeVar

import msgspec
import tomlkit

from tega.config.calibration.store import TouchMaxima, parse, read_toml
from tega.errors import CalibrationError
from tega.runtime.files.toml_text import toml_item, tree_item
from tega.runtime.files.whole_file import write_whole


class CalibrationRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Fields that every record begins with.

    ``device`` is a serial number or a substitute; ``notes`` are facts a reader has to know, a sentence each.
    ``comments`` say in the file what a field is, and its unit; what they leave open is among the attributes.
    """

    comments: ClassVar[dict[str, str]] = {}

    version: Literal[1] = 1
    device: str
    driver: str
    made: datetime
    notes: tuple[str, ...] = ()


class GelRecord(CalibrationRecord, frozen=True, kw_only=True, tag_field="format", tag="tega-gel"):
    """A baseline of a fingertip; the picture is the PNG of the same name.

    Attributes:
        noise_counts: Standard deviation of a pixel in time, blue, green, red.
        n_pictures: How many the baseline is the mean of.
        cell_noise_counts: Standard deviation of a cell's mean, blue, green, red; ``None`` in earlier records.
    """

    comments: ClassVar[dict[str, str]] = {
        "noise_counts": "blue, green, red, of 255",
        "shift_counts": "blue, green, red, since this sensor's first baseline",
        "dark_px": "pixels darker than in the first baseline",
        "wear_percent": "of the picture looks other than in the first baseline",
    }

    noise_counts: tuple[float, float, float]
    n_pictures: int
    shift_counts: tuple[float, float, float] = (0.0, 0.0, 0.0)
    dark_px: int = 0
    wear_percent: float = 0.0
    cell_noise_counts: tuple[float, float, float] | None = None


class TouchRecord(CalibrationRecord, frozen=True, kw_only=True, tag_field="format", tag="tega-touch"):
    """Maxima of one fingertip under both presets, as one person presses it.

    Attributes:
        baseline: The baseline's picture, from the calibrations' folder.
        baseline_made: When that was taken.
        width_px: Width of the frame.
        height_px: Height of the frame.
        n_presses: Firm presses, round and flat.
    """

    comments: ClassVar[dict[str, str]] = {
        "live": "99.5 percentile of the frames in contact; cci_max in counts per root pixel, eda_max in pixels, x 1.3",
        "paper": "likewise; cci_max in counts per pixel",
    }

    person: str
    finger: str
    baseline: str
    baseline_made: datetime
    width_px: int
    height_px: int
    n_presses: int
    live: TouchMaxima
    paper: TouchMaxima


class EmgRecord(CalibrationRecord, frozen=True, kw_only=True, tag_field="format", tag="tega-emg"):
    """Rest and full effort of each channel, and the conditions under which they hold.

    Attributes:
        lowpass_hz: Cutoff of the filter before the block mean; a record of another one is refused.
        settings: The driver's options that change the numbers, such as the gain.
        unit: Unit of the numbers below.
        live_max: 95th percentile of the block means of strong squeezes; the preset scales it by 0.8.
        refreshed: When rest and scale were last looked at; ``None`` for never.
    """

    comments: ClassVar[dict[str, str]] = {
        "offset": "mean of the samples at rest",
        "rest": "middle block mean at rest",
        "live_max": "95th percentile of the block means of strong squeezes",
        "paper_max": "their largest block mean",
        "answers": "one row a muscle: how much each channel rose, share of its range",
        "scale": "by which refreshes have multiplied the maxima in all",
    }

    person: str
    kind: Literal["raw", "rectified", "envelope"]
    rate_hz: float
    tau_samples: int
    lowpass_hz: float = 50.0
    settings: str = ""
    unit: str
    channels: tuple[str, ...]
    muscles: tuple[str, ...]
    offset: tuple[float, ...]
    rest: tuple[float, ...]
    live_max: tuple[float, ...]
    paper_max: tuple[float, ...]
    answers: tuple[tuple[float, ...], ...]
    refreshed: datetime | None = None
    scale: float = 1.0

    def __post_init__(self) -> None:
        """Refuse what a run cannot use: its filter has one cutoff."""
        if self.lowpass_hz != 50.0:
            raise ValueError(
                f"lowpass_hz = {self.lowpass_hz:g} Hz, where a run's filter has 50 Hz: calibrate again"
            )


class VestCalibration(CalibrationRecord, frozen=True, kw_only=True, tag_field="format", tag="tega-vest"):
    """Thresholds and steps that one person feels on a vest.

    Attributes:
        ceiling_percent: Nothing stronger was shown.
        sites: Columns (``f1`` to ``b4``) or motors (``m0`` to ``m39``), in the order of thresholds and steps.
        step_sites: Sites where the step was measured; the others of a face have the value measured there.
        named_right: Columns that were named correctly, out of ``named``.
    """

    comments: ClassVar[dict[str, str]] = {
        "sites": "f front, b back; columns from the wearer's left",
        "threshold_percent": "the lowest intensity felt at each; -1: none was",
        "step_percent": "the smallest increase noticed at each; -1: none was",
        "step_sites": "sites that were measured; the other sites of a face have the same values",
        "false_alarms": "times that nothing was felt to be something",
    }

    person: str
    layout: str
    ceiling_percent: int
    sites: tuple[str, ...]
    threshold_percent: tuple[float, ...]
    step_percent: tuple[float, ...]
    step_sites: tuple[str, ...] = ()
    named_right: int
    named: int
    false_alarms: int


class ArmRecord(CalibrationRecord, frozen=True, kw_only=True, tag_field="format", tag="tega-arm"):
    """Heading of a person's forward in the axes of a tracker, and of the robot's base as the person sees it.

    Attributes:
        frame: Axes of the tracker, a name of :data:`tega.arm.FRAMES`.
        base_yaw_rad: As in ``arm.mapping.base_yaw_rad``; earlier versions took 0 for granted.
    """

    comments: ClassVar[dict[str, str]] = {
        "yaw_rad": "as in arm.mapping.yaw_rad",
        "off_rad": "how far from forward the second movement came out, to the left",
        "base_yaw_rad": "as in arm.mapping.base_yaw_rad: 0 away from the person, 1.5708 to the left, 3.1415 towards",
    }

    person: str
    frame: str
    yaw_rad: Annotated[float, msgspec.Meta(ge=-math.pi, le=math.pi)]
    off_rad: float
    base_yaw_rad: Annotated[float, msgspec.Meta(ge=-math.pi, le=math.pi)] = 0.0


class OnsetRecord(CalibrationRecord, frozen=True, kw_only=True, tag_field="format", tag="tega-motor-onset"):
    """Time that one motor of a vest takes to start, measured with a microphone; not specific to a person.

    Attributes:
        percent: How hard it was driven.
        used: How many bursts count.
        spin_hz: Turns of the motor a second.
        clock: Source of the recording's time: ``clicks``; before version 0.3 also ``stamps`` or ``arrival``.
    """

    comments: ClassVar[dict[str, str]] = {
        "onset_ms": "from the frame's hand-over to the transport to the first vibration, middle of the bursts",
        "middle_half_ms": "half of the bursts lie between these",
        "half_strength_ms": "to half of the vibration's strength",
        "left_out": "bursts that do not count, and why",
        "clock": "how the recording was synchronized",
        "clock_uncertainty_ms": "all delays together may be off by that",
    }

    layout: str
    motor: int
    percent: int
    onset_ms: float
    middle_half_ms: tuple[float, float]
    worst_ms: float
    half_strength_ms: float
    bursts: int
    used: int
    left_out: tuple[str, ...] = ()
    spin_hz: float
    clock: str
    clock_uncertainty_ms: float


_Any = TypeVar("_Any", bound=CalibrationRecord)


def utc_now() -> datetime:
    """Return the time of day, whole seconds, UTC."""
    return datetime.now(UTC).replace(microsecond=0)


def read_record(path: Path, wanted: type[_Any]) -> _Any:
    """Read a record; ``CalibrationError`` if missing, damaged, of another kind or of an unknown version."""
    record = parse(read_toml(path), wanted, path.name)
    if not record.made.tzinfo:
        raise CalibrationError(f"{path.name}: made has no time zone", "write it as in 2026-11-21T15:04:05Z")
    return record


def write_record(record: CalibrationRecord, path: Path) -> None:
    """Write a record atomically; a reader sees either the old or the new file."""
    fields = {"format": record.__struct_config__.tag, "version": record.version}
    fields |= {name: getattr(record, name) for name in _FIRST if hasattr(record, name)}
    fields |= msgspec.structs.asdict(record)
    if not record.notes:
        del fields["notes"]
    text = tomlkit.document()
    for name, value in fields.items():
        if value is None:
            continue
        item = (
            tree_item(msgspec.structs.asdict(value))
            if isinstance(value, msgspec.Struct)
            else toml_item(value)
        )
        if name in record.comments:
            item.comment(record.comments[name])
        text.add(name, item)
    write_whole(path, tomlkit.dumps(text), sync=True)


_FIRST = ("person", "device", "driver", "made")
