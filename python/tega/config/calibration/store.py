"""Read and write calibration files: TOML, readable by people, refused where they do not fit.

Example of a file::

    format = "tega-calibration"
    version = 1
    preset = "live"
    origin = "estimated from the whole input, so these results cannot be reproduced live"

    [tactile.thumb]
    cci_max = 1.31
    eda_max = 9120.0

    [emg]
    kind = "raw"
    rate_hz = 200.0
    tau = 20
    channels = ["ch3", "ch6", "ch8"]
    maxima = [58.1, 21.7, 19.3]
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Literal, TypeVar

import msgspec
import tomlkit

from tega.config.errors import explain
from tega.config.fingers import FingerName, in_order
from tega.errors import CalibrationError
from tega.runtime.files.foreign_file import parse_toml, read_words
from tega.runtime.files.toml_text import toml_hint, tree_item
from tega.runtime.files.whole_file import write_whole
from tega.tactile.tracker import DEPTH_LAW

_Positive = Annotated[float, msgspec.Meta(gt=0, le=sys.float_info.max)]


class TouchMaxima(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Maxima of one finger, and the fitted parameters of its gel.

    Attributes:
        cci_max: Largest CCI; ``None`` where no press was seen, which keeps the front column still.
        eda_max: Largest EDA in pixels; ``None`` if no press was seen, which keeps the back column still.
        noise_counts: Noise of the sensor's cells, blue, green, red, as :func:`tega.tactile.sensor_noise` measures it;
            ``None`` takes a DIGIT's.
        depth_gain: Depth by depth as the nominal light of a gel has it; ``None`` where no known press was taken.
        stiffness_n_mm3: Stiffness of the gel, newtons per cubic millimetre; ``None`` if no known press was taken.
        mm_per_px: Scale of a frame of 320 x 240 pixels; ``None`` if no known press was taken.
        depth_law: Version of the law that gain and stiffness were fitted to; earlier calibrations name none.
    """

    cci_max: _Positive | None = None
    eda_max: _Positive | None = None
    noise_counts: tuple[_Positive, _Positive, _Positive] | None = None
    depth_gain: _Positive | None = None
    stiffness_n_mm3: _Positive | None = None
    mm_per_px: _Positive | None = None
    depth_law: int | None = None

    @property
    def other_law(self) -> bool:
        """Whether gain or stiffness were fitted to another law of depth and force than this TEGA reads by."""
        fitted = self.depth_gain is not None or self.stiffness_n_mm3 is not None
        return fitted and self.depth_law != DEPTH_LAW

    def of_this_law(self) -> TouchMaxima:
        """Return the maxima without gain and stiffness where those belong to another law."""
        if not self.other_law:
            return self
        return msgspec.structs.replace(self, depth_gain=None, stiffness_n_mm3=None, depth_law=None)


def refused_law(finger: str, maxima: TouchMaxima | None, command: str) -> list[str]:
    """Say that a finger's gain and stiffness are not used, being of another law; nothing where they are of this one."""
    if maxima is None or not maxima.other_law:
        return []
    return [
        f"{finger}: depth and force were calibrated for law {maxima.depth_law or 0} of the touch reading, and this "
        f"TEGA reads by law {DEPTH_LAW}: they are nominal until the known ball is pressed again ({command} "
        "--known-ball MM NEWTON); all else of the calibration is used"
    ]


class EmgMaxima(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Maxima of the EMG channels, and the conditions under which they hold.

    Attributes:
        kind: ``raw``, ``rectified`` or ``envelope``.
        rate_hz: Samples per second.
        tau: Samples per block.
        channels: Names of the channels, in order.
        maxima: Largest block mean of each, in the source's unit.
    """

    kind: Literal["raw", "rectified", "envelope"]
    rate_hz: _Positive
    tau: Annotated[int, msgspec.Meta(ge=1)]
    channels: tuple[str, ...]
    maxima: tuple[_Positive, ...]


class Calibration(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A set of maxima.

    Attributes:
        preset: The preset they were taken with; the other one's readings have other scales.
        origin: How they came about.
        tactile: By finger; a finger that was not calibrated is missing.
        emg: Maxima of the muscle signal, if there is one.
        format: Always ``tega-calibration``.
        version: Version of the file format.
    """

    preset: Literal["paper", "live"]
    origin: str
    tactile: dict[FingerName, TouchMaxima] = msgspec.field(default_factory=dict)
    emg: EmgMaxima | None = None
    format: Literal["tega-calibration"] = "tega-calibration"
    version: Literal[1] = 1

    def touch(self, finger: str) -> TouchMaxima | None:
        """Return a finger's maxima; ``None`` if it was not calibrated."""
        return self.tactile.get(finger)

    def check_fits(self, *, preset: str, fingers: Iterable[str], emg: EmgMaxima | None, name: str) -> None:
        """Refuse a calibration for a run it was not made for, with what differs; ``name`` is for the error.

        ``emg`` are the run's conditions (its ``maxima`` do not matter), ``None`` without EMG.
        """
        hint = "calibrate again under the conditions of this run, or run under those of the calibration"
        if self.preset != preset:
            raise CalibrationError(f"{name}: made with preset {self.preset!r}, the run uses {preset!r}", hint)
        for finger in fingers:
            if finger not in self.tactile:
                raise CalibrationError(f"{name}: has no maxima for finger {finger!r}", hint)
        if emg is None:
            return
        if self.emg is None:
            raise CalibrationError(f"{name}: has no EMG maxima", hint)
        if len(self.emg.maxima) != len(self.emg.channels):
            raise CalibrationError(
                f"{name}: emg has {len(self.emg.channels)} channels and {len(self.emg.maxima)} maxima",
                "give one maximum per channel",
            )
        for subject in ("kind", "rate_hz", "tau", "channels"):
            mine, theirs = getattr(self.emg, subject), getattr(emg, subject)
            if mine != theirs:
                message = f"{name}: made for emg {subject} = {mine!r}, the run has {theirs!r}"
                raise CalibrationError(message, hint)


_Kind = TypeVar("_Kind", bound=msgspec.Struct)


def read_toml(path: Path) -> str:
    """Return the text of a calibration's file; ``CalibrationError`` if missing, too large or no text."""
    try:
        return read_words(path, error=CalibrationError)
    except OSError as error:
        message = f"{path.name}: cannot be read: {error.strerror or error}"
        raise CalibrationError(message, f"looked for {path}") from error
    except UnicodeDecodeError as error:
        raise CalibrationError(f"{path.name}: damaged: {error}", "calibrate again") from error


def parse(text: str, wanted: type[_Kind], name: str, *, version: int | None = None) -> _Kind:
    """Return the content of a calibration's file, TOML, as a type with a field ``version``.

    ``version`` is that of a file that names none; with ``None`` it has to name one. ``name`` is for errors,
    all of them ``CalibrationError``.
    """
    try:
        tree = parse_toml(text)
    except ValueError as error:
        raise CalibrationError(f"{name}: not valid TOML: {error}", toml_hint(text, error)) from error
    if (found := tree.get("version", version)) != 1:
        raise CalibrationError(
            f"{name}: version {found!r} of the format is not known here (1 is)",
            "use the TEGA that wrote it, or calibrate again",
        )
    try:
        return msgspec.convert(tree, wanted)
    except msgspec.ValidationError as error:
        explained = explain(error, tree, wanted, prefix="", origins={})
        message = explained.message.removeprefix("settings: ")
        raise CalibrationError(f"{name}: {message}", explained.hint or "calibrate again") from None


def load_calibration(path: Path) -> Calibration:
    """Read a calibration file; errors as of :func:`parse`."""
    return parse_calibration(read_toml(path), path.name)


def parse_calibration(text: str, name: str) -> Calibration:
    """Read a calibration from the text of its file; arguments and errors as of :func:`parse`."""
    return parse(text, Calibration, name, version=1)


def save_calibration(calibration: Calibration, path: Path) -> None:
    """Write a calibration file, or replace it; equal calibrations give equal bytes."""
    write_whole(path, calibration_text(calibration))


def calibration_text(calibration: Calibration) -> str:
    """Return the text that :func:`save_calibration` writes."""
    first = ("format", "version", "preset", "origin")
    fields = msgspec.to_builtins(calibration)
    fields["tactile"] = in_order(fields["tactile"])
    text = tree_item({name: fields[name] for name in (*first, *fields)})
    for finger, maxima in text["tactile"].items():
        if "cci_max" not in maxima and "eda_max" not in maxima:
            text["tactile"][finger].comment("no press was seen: this finger's columns stay still")
    return tomlkit.dumps(text)
