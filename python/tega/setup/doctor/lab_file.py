"""Write a settings file with the connected devices filled in and comments on the rest; read the udev rules."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

import tomlkit

from tega.config import FINGERS
from tega.devices import Found
from tega.runtime.files.toml_text import toml_item, toml_value, tree_text
from tega.setup.doctor.bench import DriverProbe

_HEAD = """\
# A session on real devices. Lines that begin with # are switched off; take the # away to switch one on.
# Check it:            tega-teleop config check {name}
# Try the devices:     tega-teleop doctor {name}
# Run it:              tega-teleop run {name}
# Relative paths are relative to this file. Every key: docs/config.md

[session]
preset = "live"               # paper: the printed law; live: for people
out_dir = "results"           # where the tables go
"""

_EMULATED = """\
emulated = true               # in a study: a rehearsal only
"""

_CALIBRATION = """
# What counts as full effort and full touch, for one person and these devices. A run on live devices needs it.
{off}[calibration]
{off}file = {file}
"""

_NO_FINGER = """
# {table:<28}  # no sensor was found for it
# driver = "digit"                # docs/device-digit.md
# options = {{ serial = "D00000" }}   # the number printed on the sensor; source = "/dev/video0" for any camera
"""

_NO_EMG = """
# [emg]                           # no amplifier was found
# driver = "cyton"                # cyton, chords, spiker, serial-emg and others: docs/device-emg.md
# kind = "raw"                    # type of signal: raw, rectified, envelope
# options = { port = "/dev/ttyUSB0" }
"""

_NO_VEST = """
[vest]
layout = "x40"                # paper32, x40, x16
# driver = "bhaptics-player"      # no vest was found; without a driver the frames are only recorded
# options = { host = "127.0.0.1", limit = 60 }   # limit: the highest percent ever sent
# threshold = 15                  # the least percent that this person feels: docs/device-vest.md
"""

_NO_HAND = """
[hand]
# driver = "allegro"              # no CAN bus was found; without a driver the frames are only recorded
# options = { interface = "socketcan", channel = "can0", side = "right", torque_share = 0.3 }
"""

_NO_MOTION = """
# [input.motion]                  # no SpaceMouse was found: six axes for the arm, docs/device-inputs.md
# driver = "spacemouse"
"""

_NO_PEDAL = """
# [input.dead_man]                # no pedal that is known was found; any other, or a button of the SpaceMouse
# driver = "pedal"
# options = { vendor_id = 0x05f3, product_id = 0x00ff, report = "joystick", silent_after_ms = 5000 }   # lsusb
"""

_ARM = """
{off}[arm]                           # robot arm (not auto-detected): docs/arm.md
{off}driver = "{driver}"{gap}# franky, bench-arm, simulated-arm: docs/device-arm.md
{options}
# [arm.tracker]                   # what sees the forearm; without it [input.motion], a SpaceMouse, leads
# driver = "hololens"             # or "openxr", options = {{ source = "grip" }}: docs/device-tracker.md
# options = {{ host = "192.168.1.20" }}

{off}[arm.mapping]
{off}frame = "base"                  # axes of what leads: base for a SpaceMouse, openxr for a headset
# yaw_rad = 0.0                   # where forward is in the tracker's axes, from the calibration of the yaw
# base_yaw_rad = 0.0              # which way the base points for the operator: 0 away, 1.57 left, 3.1415 towards

{off}[arm.limits]
{off}speed_m_s = 0.25

# [input.clutch]                  # none: the dead-man, without which no arm is led, is the clutch too
# driver = "spacemouse"
# button = "right"

# [input.recover]                 # pressed with the dead-man let go: the arm may go on after a fault
# driver = "spacemouse"
# button = "left"
"""
_FRANKY = 'options = { host = "172.16.0.2", robot = "panda" }   # or fr3; tega-teleop doctor checks it\n'

# What a driver cannot find out by itself, and where to start.
_MORE: Mapping[str, Mapping[str, tuple[Any, str]]] = {
    "serial-emg": {
        "rate_hz": (500.0, "lines a second that the board prints; measured, and refused if it is not so"),
        "columns": (3, "numbers on a line"),
        "bits": (10, "of the board's converter: 10, 12, 14; so that saturation is seen"),
    },
    "bhaptics-player": {"limit": (60, "the highest percent ever sent; raise it when all is well")},
    "bhaptics-ble": {"limit": (60, "the highest percent ever sent; raise it when all is well")},
    "hid-vest": {"limit": (60, "the highest percent ever sent; raise it when all is well")},
    "pedal": {
        "silent_after_ms": (
            5000,
            "100 where it repeats itself while held; else it has to be pressed again this often",
        )
    },
    "allegro": {
        "side": ("right", "right or left; the other one is refused"),
        "torque_share": (0.3, "share of the torque limits; raise it when all is well"),
    },
}


def lab_settings(
    looked: Mapping[str, DriverProbe],
    *,
    name: str,
    emulated: bool = False,
    calibration: Path | None = None,
    baselines: Mapping[str, Path] | None = None,
    arm: str | dict[str, Any] | None = None,
) -> str:
    """Return the text of a settings file, TOML that ``tega-teleop config check`` accepts.

    ``looked`` comes from :func:`tega.setup.doctor.probe_drivers`; ``name`` is the file's, for the commands in
    it. If ``emulated``, it says so. ``calibration`` and ``baselines``, pictures of the untouched gels by
    finger, are relative to the file. ``arm`` is the name of a driver to switch on, or its whole table;
    ``None`` leaves the arm's table as a comment.
    """
    file = toml_value(str(calibration or "calibration.toml"))
    text = (
        _HEAD.format(name=name)
        + (_EMULATED if emulated else "")
        + _CALIBRATION.format(off="" if calibration else "# ", file=file)
    )
    sensors = _found(looked, "tactile")
    if sensors:
        text += "\n# Which sensor is on which finger is a guess, in the order of their numbers: touch each and swap.\n"
    for finger, sensor in zip(FINGERS, [*sensors[: len(FINGERS)], *[None] * len(FINGERS)], strict=False):
        if sensor is None:
            text += _NO_FINGER.format(table=f"[tactile.{finger}]")
            continue
        picture = (baselines or {}).get(finger)
        untouched = _line("baseline", str(picture or f"{finger}.png"), "picture of the untouched gel")
        text += _section(f"tactile.{finger}", sensor, untouched if picture else f"# {untouched}")
    text += _left_over(sensors[len(FINGERS) :])
    kind = 'kind = "raw"                  # type of signal: raw, rectified, envelope\n'
    layout = 'layout = "x40"                # paper32, x40, x16\n'
    for table, found, more, absent in (
        ("emg", _found(looked, "emg"), kind, _NO_EMG),
        ("vest", _found(looked, "vest"), layout, _NO_VEST),
        ("hand", _found(looked, "hand"), "", _NO_HAND),
        ("input.motion", _found(looked, "input", "spacemouse"), "", _NO_MOTION),
        ("input.dead_man", _found(looked, "input", "pedal"), "", _NO_PEDAL),
    ):
        text += _section(table, found[0], more) if found else absent
        text += _left_over(found[1:])
    others = [one for one in _found(looked, "input") if one.driver not in {"spacemouse", "pedal"}]
    return text + _left_over(others) + _arm(arm)


def _arm(driver: str | dict[str, Any] | None) -> str:
    """Return the arm's tables, switched off where no driver is named."""
    if isinstance(driver, dict):
        return "\n" + tree_text({"arm": driver})
    off, name = ("# ", "franky") if driver is None else ("", driver)
    options = f"{off}{_FRANKY}" if name == "franky" else ""
    gap = " " * max(1, 34 - len(f'{off}driver = "{name}"'))
    return _ARM.format(off=off, driver=name, gap=gap, options=options)


def _found(looked: Mapping[str, DriverProbe], kind: str, driver: str | None = None) -> list[Found]:
    """Return the devices found of a kind, for one driver or any; the likelier and usable ones first."""
    found = [
        (there.likelihood, one) for there in looked.values() if there.kind == kind for one in there.found
    ]
    found.sort(key=lambda pair: (bool(pair[1].problem), -pair[0], not pair[1].options))
    return [one for _, one in found if driver in {None, one.driver}]


def _section(table: str, found: Found, more: str) -> str:
    text = "\n" + _comment(f"{found.label}{f': {found.note}' if found.note else ''}")
    if found.problem:
        text += _comment(f"Not usable yet: {found.problem}. {found.hint}")
    text += f"[{table}]\n{_line('driver', found.driver)}{more}"
    extra = {
        key: reported for key, reported in _MORE.get(found.driver, {}).items() if key not in found.options
    }
    if found.options or extra:
        text += f"\n[{table}.options]\n" + "".join(_line(key, value) for key, value in found.options.items())
        text += "".join(_line(key, value, reported) for key, (value, reported) in extra.items())
    return text


def _line(key: str, value: Any, reported: str = "") -> str:
    """Return a key's line with its comment, in a column of its own."""
    item = toml_item(value)
    if reported:
        item.comment(reported).trivia.comment_ws = " " * max(2, 27 - len(key) - len(item.as_string()))
    return tomlkit.dumps({key: item})


def _left_over(found: Iterable[Found]) -> str:
    """List the other devices found, as comments to choose from."""
    return "".join(
        _comment(
            f"also found: {one.label}: driver = {toml_value(one.driver)}, options = {toml_value(one.options)}"
        )
        for one in found
    )


def _comment(text: str) -> str:
    """Return a text as comment lines; a device's own name may contain any character."""
    lines = ("".join(c if c.isprintable() else " " for c in line) for line in text.splitlines())
    return "".join(f"# {line}".rstrip() + "\n" for line in lines)


def udev_rules() -> str:
    """Return the text of the rules' file, its installation in the first lines."""
    return files("tega.setup.doctor").joinpath("70-tega.rules").read_text(encoding="utf-8")
