"""Judge a column by its name: a muscle, a time, a counter, a label or another sensor."""

from __future__ import annotations

import re
from typing import Final, Literal, NamedTuple

Role = Literal["channel", "time", "counter", "label", "sensor", "text", "unknown"]
"""Content of a column; ``unknown`` may be a channel."""

_UNIT = re.compile(
    r"\s*[\[(]\s*([^\])]*?)\s*[\])]\s*$|\s*,\s*(s|ms|[uµμ]s|ns|V|[muµμ]V|g|N|Nm|%|Hz|deg(?:/s)?|°(?:/s)?)$",
    re.IGNORECASE,
)
_TAIL = re.compile(r"^(.*[a-z])_(s|sec|ms|us|µs|ns|n|nm|kg|v|mv|uv|µv)$", re.IGNORECASE)
# A longer name is none, and patterns take long to say so.
_LONGEST = 200
_WORDS = re.compile(r"[A-Z]+(?![a-zà-ÿ])|[A-Z]?[a-zà-ÿµ]+|\d+", re.UNICODE)


def _set(words: str) -> frozenset[str]:
    return frozenset(words.split())


SECONDS: Final = {
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds", "sek"), 1.0),
    **dict.fromkeys(("ms", "msec", "millis", "milliseconds"), 1e-3),
    **dict.fromkeys(("us", "µs", "μs", "usec", "micros", "microseconds"), 1e-6),
    **dict.fromkeys(("ns", "nanoseconds"), 1e-9),
    "min": 60.0,
}
"""Seconds of each unit of time."""

_TIME = _set(
    "time times timestamp timestamps timestep zeit zeitstempel uhrzeit temps tiempo tempo tijd tid datetime "
    "date datum clock seconds secs sec seconden microseconds milliseconds millis epoch unix elapsed utc "
    "localtime t ts"
)
_ALONE_TIME = _set("t ts x date clock tempo tid sec")
_COUNTER = _set(
    "index idx ix counter count cnt sample samples package packet packets seq sequence frame frames row rows "
    "no nr num number numbers n id unnamed scan line record records i stichprobe zähler messpunkt item nummer "
    "data emg block"
)
_COUNTER_CORE = _COUNTER - {"emg", "data"}
_LABEL = _set(
    "label labels class classes klasse stimulus restimulus stim repetition rerepetition reps gesture gestures "
    "movement movements exercise trigger triggers trig marker markers event events annotation annotations "
    "status target trial trials subject session participant comment comments note notes condition digital "
    "activity"
)
_ALONE_LABEL = _set("level rep task object phase state code y group user person day")
_SENSOR = _set(
    "acc accel acceleration accelerometer accelerator beschleunigung gyro gyroscope gyr mag magnetometer "
    "magneto imu quat quaternion roll pitch yaw orientation rotation euler force forces kraft fx fy fz mx my "
    "mz tx ty tz torque moment drehmoment load grf cop pressure druck angle angles winkel goniometer velocity "
    "temperature temp humidity hr ecg ekg eeg eog ppg eda gsr resp respiration spo2 fsr glove inclination "
    "other analog resistance battery batt rssi linear heartrate"
)
_ALONE_SENSOR = _set("grip x y z w qx qy qz qw ax ay az gx gy gz position pos heart weight dac adc")
_MUSCLE = _set("emg semg exg iemg hdemg myo muscle")

_FORCE_UNITS = _set("n nm n.m kg g m/s2 m/s^2 m/s² deg deg/s °/s rad rad/s dps ut µt °c")


_MAY_BE_TIME = _ALONE_TIME | _TIME | _COUNTER
_ALWAYS_TIME = _TIME - _ALONE_TIME


class Name(NamedTuple):
    """A column's name, judged; ``unit`` is ``""`` for none, ``role`` is the content according to the name."""

    text: str
    unit: str
    role: Role


def judged(raw: str, unit: str = "") -> Name:
    """Judge a column's name as it stands in a file.

    Args:
        raw: The name, perhaps with its unit in brackets, after a comma or an underscore.
        unit: The unit, where the file has it elsewhere.

    Example:
        >>> judged("Zeit [s]").role, judged("Package Num").role, judged("EMG_1 (uV)").role, judged("FCU").role
        ('time', 'counter', 'channel', 'unknown')
    """
    bare = text = raw[:_LONGEST].strip().strip("\"'").strip()
    if not unit and (found := _UNIT.search(text)) and found.start() > 0:
        unit, bare = (found[1] or found[2] or "").strip(), text[: found.start()]
    elif not unit and (found := _TAIL.match(text)):
        bare, unit = found[1], found[2]
    return Name(text, unit, _role(bare, unit.lower()))


def _role(text: str, unit: str) -> Role:
    words = [word.lower() for word in _WORDS.findall(text)]
    plain = [re.sub(r"(?<=...)[xyz]$", "", word) if word[:-1] in _SENSOR else word for word in words]
    numbered = any(word.isdigit() for word in plain)
    plain = [word for word in plain if not word.isdigit()]
    alone = plain[0] if len(set(plain)) == 1 else ""
    if numbered and len(alone) == 1:
        alone = ""  # T1 and X2 are as good names of muscles as any
    role: Role = "unknown"
    if not plain:
        role = "unknown"
    elif (
        (unit in SECONDS and alone in _MAY_BE_TIME)
        or _ALWAYS_TIME.intersection(plain)
        or alone in _ALONE_TIME - {"x"}
    ):
        role = "time"
    elif _COUNTER.issuperset(plain) and (len(plain) > 1 or alone) and _COUNTER_CORE.intersection(plain):
        role = "unknown" if _MUSCLE.intersection(plain) else "counter"
    elif _LABEL.intersection(plain) or alone in _ALONE_LABEL:
        role = "label"
    elif _SENSOR.intersection(plain) or alone in _ALONE_SENSOR or unit in _FORCE_UNITS:
        role = "sensor"
    elif _MUSCLE.intersection(plain) or any(word.startswith(("emg", "semg")) for word in plain):
        role = "channel"
    elif unit in SECONDS:
        role = "time"
    return role
