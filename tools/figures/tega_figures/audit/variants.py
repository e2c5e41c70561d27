"""Choose what an audit compares: named readings, or one setting swept over a range of values.

A variant is a whole set of settings, so that what an audit computes is what a run with these settings computes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from copy import deepcopy
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple

from tega.config import SessionConfig, check_tree, override_recorded
from tega.errors import ConfigError

Kind = Literal["touch", "emg", "vest"]

_TABLE: Final[dict[Kind, str]] = {"touch": "metric", "emg": "decoder", "vest": "mapping"}
_MOST_VALUES = 200


def _reading(**options: Any) -> dict[str, Any]:
    return {"name": "reading", "options": options}


def _rules(**options: Any) -> dict[str, Any]:
    return {"name": "rules", "options": options}


def _columns(**options: Any) -> dict[str, Any]:
    return {"name": "columns", "options": options}


READINGS: Final[dict[Kind, dict[str, dict[str, Any]]]] = {
    "touch": {
        "D1 print, signed": _reading(threshold="D1"),
        "D2 print, rectified": _reading(threshold="D2"),
        "print, absolute": _reading(threshold="D1", difference="absolute"),
        "print, σ of intensity": _reading(threshold="D1", difference="absolute", spread="intensity"),
        "D4 masked, σ of intensity": _reading(threshold="D4"),
        "D5 masked, 0.44 of centre": _reading(threshold="D5"),
        "D6 masked, noise floor": _reading(threshold="D6"),
        "D7 masked, 10 % of peak": _reading(threshold="D7"),
        "D8 masked, half of peak": _reading(threshold="D8"),
        "paper (D3)": {"name": "paper"},
        "live": {"name": "live"},
    },
    "emg": {
        "print": _rules(preset="paper"),
        "print, five equal": _rules(preset="paper", intervals=5),
        "print, mean rounded": _rules(preset="paper", fusion="round"),
        "print, median": _rules(preset="paper", fusion="median"),
        "print, 5 Hz": _rules(preset="paper", cutoff_hz=5.0),
        "print, τ 50 ms": _rules(preset="paper", tau_s=0.05),
        "print, τ 200 ms": _rules(preset="paper", tau_s=0.2),
        "live": _rules(preset="live"),
    },
    "vest": {
        "print": _columns(),
        "saturating": _columns(saturate=True),
        "linear": _columns(law="linear", saturate=True),
        "10 % at rest": _columns(end_value=0.1),
        "faces exchanged": _columns(front="eda", back="cci"),
        "pulses": {"name": "pulses"},
    },
}
"""Stages that are compared where nothing else is asked for, by what they read: the table that chooses each."""


class Variant(NamedTuple):
    """One way to read a recording.

    ``name`` is for tables; ``value`` is the setting's in a sweep, ``None`` of a named reading.
    """

    name: str
    config: SessionConfig
    value: Any = None


class SettingSweep(NamedTuple):
    """One setting and the values that it takes in turn, as for ``--set KEY=VALUE``."""

    key: str
    values: tuple[str, ...]

    @property
    def numbers(self) -> tuple[float, ...] | None:
        """The values as numbers; ``None`` where one is a word."""
        try:
            return tuple(float(value) for value in self.values)
        except ValueError:
            return None


def kind_of(key: str) -> Kind:
    """Return the kind of stage that a setting has an effect on first.

    One without effect on what an audit compares raises :class:`ConfigError`.
    """
    if key.startswith("stages.metric."):
        return "touch"
    if key.startswith("stages.decoder."):
        return "emg"
    if key.startswith(("stages.mapping.", "vest.")):
        return "vest"
    raise ConfigError(
        f"{key}: an audit compares stages, which it is no setting of",
        "sweep stages.metric.*, stages.decoder.*, stages.mapping.* or vest.*, such as stages.metric.options.factor",
    )


def parse_sweep(text: str) -> SettingSweep:
    """Read ``KEY=FROM:TO:STEP`` or ``KEY=VALUE,VALUE,...``.

    Args:
        text: As given on a command line; FROM and TO are both among the values where STEP divides the way.

    Raises:
        ConfigError: It has another form, no value, or more than 200.

    Example:
        >>> parse_sweep("stages.metric.options.factor=0.5:1.25:0.25").values
        ('0.5', '0.75', '1', '1.25')
    """
    key, equals, message = text.partition("=")
    example = "write --sweep stages.metric.options.factor=0.5:2.5:0.25 or =0.5,1.28,2.5"
    if not equals or not key.strip() or not message.strip():
        raise ConfigError(f"--sweep {text!r}: not of the form KEY=FROM:TO:STEP", example)
    kind_of(key.strip())
    parts = message.split(":")
    if len(parts) == 3:
        try:
            first, last, step = (Decimal(part.strip()) for part in parts)
        except InvalidOperation:
            raise ConfigError(f"--sweep {text!r}: {message} are not three numbers", example) from None
        if not all(number.is_finite() for number in (first, last, step)) or step <= 0 or last < first:
            raise ConfigError(
                f"--sweep {text!r}: the step has to lead from {parts[0]} to {parts[1]}", example
            )
        n = (
            math.floor((last - first) / step) + 1
            if (last - first) / step < _MOST_VALUES
            else _MOST_VALUES + 1
        )
        values = tuple(f"{(first + k * step).normalize():f}" for k in range(min(n, _MOST_VALUES + 1)))
    else:
        values = tuple(dict.fromkeys(part.strip() for part in message.split(",") if part.strip()))
    if not 0 < len(values) <= _MOST_VALUES:
        raise ConfigError(
            f"--sweep {text!r}: gives {len(values)} values, wanted 1 to {_MOST_VALUES}", example
        )
    return SettingSweep(key.strip(), values)


def named_variants(
    tree: Mapping[str, Any], kind: Kind, names: Sequence[str] = (), *, sets: Sequence[str] = ()
) -> list[Variant]:
    """Return readings by their names in :data:`READINGS`; none means all of them.

    They take the place of a stage in ``tree``; ``sets`` are further settings of all of them, as
    ``key=value``.
    """
    known = READINGS[kind]
    for name in names:
        if name not in known:
            raise ConfigError(f"reading {name!r} of {kind} is not known", f"choose from {'; '.join(known)}")
    variants = []
    for name in names or known:
        changed = deepcopy(dict(tree))
        changed["stages"] = dict(changed.get("stages", {})) | {_TABLE[kind]: deepcopy(known[name])}
        variants.append(Variant(name, _checked(changed, sets)))
    return variants


def sweep_variants(
    tree: Mapping[str, Any], sweep: SettingSweep, *, sets: Sequence[str] = ()
) -> list[Variant]:
    """Return the settings with one of them at each value of a sweep."""
    numbers = sweep.numbers
    return [
        Variant(
            value,
            _checked(deepcopy(dict(tree)), [*sets, f"{sweep.key}={value}"]),
            value if numbers is None else numbers[place],
        )
        for place, value in enumerate(sweep.values)
    ]


def _checked(tree: dict[str, Any], sets: Sequence[str]) -> SessionConfig:
    origins = override_recorded(tree, sets)
    return check_tree(tree, origins, base=Path.cwd()).config
