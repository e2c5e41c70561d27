"""Take a person's baselines, thresholds and heading into the settings, before anything is opened."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import msgspec

from tega.config.calibration.folder import CalibrationFolder, device_name
from tega.config.calibration.records import ArmRecord, EmgRecord, TouchRecord, VestCalibration
from tega.config.calibration.wearing import site_motors
from tega.config.origins import LoadedConfig, SettingValue
from tega.config.person import live_info, tracker_info, whose
from tega.config.sections import SessionConfig
from tega.devices.base import DeviceInfo
from tega.errors import CalibrationError
from tega.haptics.motor_layout import SHIPPED

_MOTORS = 40


def with_person(loaded: LoadedConfig, *, given: set[str]) -> LoadedConfig:
    """Put a person's baselines and thresholds, with their origins, where the settings leave them open.

    A value that is set explicitly takes precedence. Nothing is opened: devices have names while closed.
    """
    config, values = loaded.config, dict(loaded.values)
    person, folder = whose(config.calibration)
    folder.person(person)  # a code that cannot be one is refused here
    live = config.session.preset == "live"
    found: dict[str, tuple[Any, str]] = {}

    def readable(wanted: type[Any], info: DeviceInfo | None) -> tuple[Any, str]:
        """Read a record and its name; ignore unusable ones, since the run reads them again and reports them."""
        try:
            record = None if info is None else folder.record(person, wanted, device_name(info))
        except CalibrationError as error:
            assert info is not None
            values[f"calibration.{info.kind}"] = SettingValue(error.message, "not used")
            return None, ""
        return record, "" if record is None else folder.named(folder.file_of(record, person))

    for finger, section in config.tactile.items():
        if (info := live_info(section, "tactile")) is None:
            continue
        if gels := folder.gels(device_name(info)):
            found[f"tactile.{finger}.baseline"] = (gels[-1].picture, folder.named(gels[-1].picture))
        record, name = readable(TouchRecord, info)
        if record is not None:
            maxima = record.live if live else record.paper
            for key in ("cci_max", "eda_max"):
                values[f"calibration.{finger}.{key}"] = SettingValue(getattr(maxima, key), name)
    emg, name = readable(EmgRecord, live_info(config.emg, "emg"))
    if emg is not None:
        values["calibration.emg.maxima"] = SettingValue(emg.live_max if live else emg.paper_max, name)
    vest, name = readable(VestCalibration, live_info(config.vest, "vest"))
    if vest is not None and live and vest.layout in {*SHIPPED, config.vest.layout}:
        threshold, step = felt_by(vest)
        found |= {"vest.threshold": (threshold, name), "vest.step": (step, name)}
    heading, name = readable(ArmRecord, tracker_info(config))
    if heading is not None:
        found |= {f"arm.mapping.{key}": (getattr(heading, key), name) for key in ("yaw_rad", "base_yaw_rad")}
    found |= _of_the_hand(config, folder, person)
    if getattr(config.stages.decoder.options, "person", "") is None:
        found["stages.decoder.options.person"] = (person, "calibration.person")  # another's model is refused
    for key, (value, name) in found.items():
        if key in given:
            values[key] = SettingValue(values[key].value, f"{values[key].origin} (wins over {name})")
        else:
            values[key] = SettingValue(value, name)
            config = _replaced(config, key.split("."), value)
    return LoadedConfig(config, values)


def _of_the_hand(config: SessionConfig, folder: CalibrationFolder, person: str) -> dict[str, tuple[Any, str]]:
    """Return the settings that follow from a person's hand: the tracked forearm and the thumb's side."""
    if (hand := folder.hand(person)) is None:
        return {}
    name = folder.named(folder.person(person) / "person.toml")
    found: dict[str, tuple[Any, str]] = {"vest.mirror": ("all" if hand == "left" else "none", name)}
    return found if config.arm is None else found | {"arm.mapping.forearm": (hand, name)}


def _replaced(table: Any, path: Sequence[str], value: Any) -> Any:
    name, *rest = path
    if isinstance(table, dict):
        return table | {name: _replaced(table[name], rest, value)}
    inner = _replaced(getattr(table, name), rest, value) if rest else value
    return msgspec.structs.replace(table, **{name: inner})


def felt_by(record: VestCalibration) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return threshold and step of each of the 40 motors, percent.

    A motor where nothing was felt, or none was asked about, has the middle of the others: one dead motor must not
    take the range of all. With nothing felt anywhere they are those of no calibration, 0 and 1.
    """
    thresholds = _each_motor(record, record.threshold_percent)
    steps = _each_motor(record, record.step_percent)
    return thresholds or (0.0,) * _MOTORS, steps or (1.0,) * _MOTORS


def _each_motor(record: VestCalibration, percent: tuple[float, ...]) -> tuple[float, ...] | None:
    known = sorted(p for p in percent if p > 0)
    if not known:
        return None
    values = [known[len(known) // 2]] * _MOTORS
    for site, p in zip(record.sites, percent, strict=True):
        for motor in site_motors(site, record.layout):
            if p > 0:
                values[motor] = p
    return tuple(values)
