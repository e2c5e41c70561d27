"""Judge a column by its name and by its values: a muscle, a time, a counter, a label or another sensor."""

from __future__ import annotations

import re
from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.runtime.files.tables.timing import slope_of

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

Course = Literal["signal", "time", "counter", "label", "constant", "none"]
"""Course of a column's values: ``signal`` goes up and down, ``label`` keeps small whole numbers for long, ``none``
has too few numbers."""

FEWEST = 16
"""Rows without which values prove nothing."""
_FEWEST_LABELS = 200

# Seconds since 1970 in this range are a date between 2001 and 2096; the same in ms, µs and ns.
_UNIX_S = (1e9, 4e9)
# Microseconds since a board was switched on can be as large, and rise faster.
_LONGEST_STEP_S = 0.5


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
    "date datum clock seconds secs sec seconden microseconds micros milliseconds millis epoch unix elapsed utc "
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
    """Judge a column's name as it stands in a file, perhaps with its unit in brackets, after a comma or underscore.

    ``unit`` is given where the file has it elsewhere.

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
        return role
    is_time = (unit in SECONDS and alone in _MAY_BE_TIME) or _ALWAYS_TIME.intersection(plain)
    if is_time or alone in _ALONE_TIME - {"x"}:
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


def course_of(values: NDArray[np.float64]) -> Course:
    """Return the course of a column's first values, float64 (n,), NaN for a cell without a number.

    Example:
        >>> course_of(np.arange(100) * 0.004), course_of(np.arange(600) % 256.0), course_of(np.zeros(50))
        ('time', 'counter', 'constant')
    """
    values = values[np.isfinite(values)]
    if len(values) < FEWEST:
        return "none"
    steps = np.diff(values)
    if not steps.any():
        return "constant"
    moved = steps[steps != 0]
    step = float(np.median(moved))
    whole = bool((values == np.round(values)).all())
    small = whole and len(values) >= _FEWEST_LABELS and 0 <= values.min() <= values.max() < 100
    if small and len(moved) <= 0.01 * len(steps):
        return "label"
    return _rising(steps, moved, step, whole=whole) if step > 0 else "signal"


def _rising(steps: NDArray[np.float64], moved: NDArray[np.float64], step: float, *, whole: bool) -> Course:
    """Return the course of values that rise more often than they fall."""
    up = float((steps >= 0).mean())
    even = float((np.abs(moved - step) <= 0.1 * step).mean())
    if whole and step >= 1 and even >= 0.9 and len(moved) >= 0.9 * len(steps):
        return "counter"
    # A stamp for several samples that came at once stands still between its steps.
    few_back = up >= 0.98 and len(moved) >= max(FEWEST, len(steps) // 200)
    near = float(((moved > 0) & (moved < 10 * step)).mean())
    if few_back and (even >= 0.5 or near >= 0.95) and len(steps) >= 2 * FEWEST:
        return "time"
    return "time" if few_back and even >= 0.9 else "signal"


def unix_unit(values: NDArray[np.float64]) -> str:
    """Return the unit in which values are times since 1970: ``s``, ``ms``, ``us``, ``ns``; ``""`` if they are not."""
    values = values[np.isfinite(values)]
    middle, step = (float(np.median(values)), slope_of(values)) if len(values) else (0.0, None)
    for unit, scale in (("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)):
        if _UNIX_S[0] * scale <= middle <= _UNIX_S[1] * scale and step and step <= _LONGEST_STEP_S * scale:
            return unit
    return ""


def is_even(values: NDArray[np.float64]) -> bool:
    """Return whether nearly all steps of values are the same, as those of a time that each sample has for itself."""
    steps = np.diff(values[np.isfinite(values)])
    middle = float(np.median(steps)) if len(steps) else 0.0
    return middle > 0 and float((np.abs(steps - middle) <= 0.5 * middle).mean()) >= 0.9
