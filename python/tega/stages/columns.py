"""Show touch as a column of motors a finger (Eq 7 to 9), with any value on any face."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from collections.abc import Mapping as AnyMapping
from typing import Annotated, ClassVar, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.errors import ConfigError
from tega.haptics import FINGERS, intensity
from tega.records import Contact, Event
from tega.runtime.words import nearest_hint
from tega.stages.base import Mapping, StageOptions, VestSetup

FIELDS = (
    "cci", "eda", "peak", "mass", "spread", "threshold", "area_mm2", "depth_mm", "force_n", "strength",
    "broad",
)  # fmt: skip
"""Numbers of a contact that a face can show."""

FingerColumns = Annotated[tuple[str | tuple[str, ...], ...], msgspec.Meta(min_length=1)]
_EndValue = Annotated[float, msgspec.Meta(gt=0, lt=0.5)]
_Positive = Annotated[float, msgspec.Meta(gt=0, le=1e12)]


class ColumnsOptions(StageOptions, frozen=True):
    """Options of the mapping ``columns``.

    Attributes:
        front: Value that the front shows: a number of the contact (cci, eda, peak, mass, depth_mm, force_n and others),
            or a value of the metric's own.
        back: Value that the back shows: a number of the contact or of the metric's own, as for the front.
        front_max: Full value on the front, in the value's unit; none means the calibration's (cci, eda).
        back_max: Full value on the back, in the value's unit; none means the calibration's (cci, eda).
        law: ``logistic`` is Eq 7 as printed; ``linear`` is in proportion; ``power`` is the share to the ``exponent``.
        exponent: Exponent of the law ``power``: below 1 a light touch is shown more strongly than in proportion.
        end_value: Share of full intensity that the logistic law gives at value 0.
        back_end_value: Share of full intensity on the back at value 0; none means that of the front.
        at_rest: Output for a finger without contact: ``silent``, or the ``law`` at value 0, as printed.
        rows: ``alike``: all rows of a column show the same; ``bar``: the rows are lit from below in proportion.
        saturate: Whether a value above its maximum counts as the maximum; as printed the law goes on.
        fingers: Finger that each column shows, from the wearer's left, or a list of fingers: the strongest is shown.
    """

    front: str = "cci"
    back: str = "eda"
    front_max: _Positive | None = None
    back_max: _Positive | None = None
    law: Literal["logistic", "linear", "power"] = "logistic"
    exponent: Annotated[float, msgspec.Meta(gt=0, le=10)] = 0.5
    end_value: _EndValue = 0.01
    back_end_value: _EndValue | None = None
    at_rest: Literal["silent", "law"] = "silent"
    rows: Literal["alike", "bar"] = "alike"
    saturate: bool = False
    fingers: FingerColumns = FINGERS


class ColumnsMapping(Mapping):
    """A finger a column; one value in front, another at the back; every row of a column alike.

    A motor of a column with several fingers shows the strongest of them. Raises ``ConfigError`` for a value without a
    maximum, a finger named twice, a finger in no column, or too few columns.
    """

    summary: ClassVar[str] = "a column a finger: CCI in front, EDA at the back (Eq 7 to 9)"
    options_type: ClassVar[type[StageOptions]] = ColumnsOptions

    def __init__(self, setup: VestSetup, options: ColumnsOptions) -> None:
        self._options = options
        self._columns_of = finger_columns(setup, options.fingers)
        self._fingers = tuple(self._columns_of)
        motors, rows = setup.layout.motors, setup.layout.rows
        # Of each motor: which of the fingers' values it shows, front and back in turn, and the 0 behind them all.
        displayed = [
            [
                2 * n + (motor.face == "back")
                for n, finger in enumerate(self._fingers)
                if self._columns_of[finger] == motor.column
            ]
            for motor in motors
        ]
        most, nothing = max(1, *map(len, displayed)), 2 * len(self._fingers)
        self._displayed = np.array([of + [nothing] * (most - len(of)) for of in displayed]).T
        # And the rows of its face, and how many motors are under it.
        self._rows = np.array([rows(motor.face) for motor in motors])
        self._below = np.array([rows(motor.face) - 1 - motor.row for motor in motors])
        self._full = {
            finger: (
                _full(setup, finger, "front", options.front, options.front_max),
                _full(setup, finger, "back", options.back, options.back_max),
            )
            for finger in setup.fingers
        }

    def columns(self, finger: str, contact: Contact) -> tuple[float, float]:
        """Return the finger's columns, percent; 0 without contact, unless the law is to be shown at rest."""
        o = self._options
        front, back = self._full[finger]
        # Looked up at rest, too: a value that the metric does not measure is an error before the first touch.
        values = value_of(contact, o.front), value_of(contact, o.back)
        if not contact.in_contact:
            if o.at_rest == "silent":
                return 0.0, 0.0
            values = (0.0, 0.0)
        back_end = o.end_value if o.back_end_value is None else o.back_end_value
        return self._percent(values[0], front, o.end_value), self._percent(values[1], back, back_end)

    def levels(
        self,
        t_ns: int,
        contacts: AnyMapping[str, Contact],
        events: Sequence[Event],  # noqa: ARG002  # events are not asked for
    ) -> NDArray[np.float64]:
        """Return every motor's level."""
        return self._spread(self._values(t_ns, contacts), contacts)

    def _values(
        self,
        t_ns: int,  # noqa: ARG002  # what is fresh is shown as it is
        contacts: AnyMapping[str, Contact],
    ) -> NDArray[np.float64]:
        """Return percents of the fingers' columns, front and back in turn, and a 0 behind them all."""
        values = np.zeros(2 * len(self._fingers) + 1)
        for n, finger in enumerate(self._fingers):
            contact = contacts.get(finger)
            if contact is not None:
                values[2 * n], values[2 * n + 1] = self.columns(finger, contact)
        return values

    def _spread(
        self,
        values: NDArray[np.float64],
        contacts: AnyMapping[str, Contact],  # noqa: ARG002  # for a mapping that shows where they are
    ) -> NDArray[np.float64]:
        of_each = values.take(self._displayed)
        levels: NDArray[np.float64] = of_each[0] if len(of_each) == 1 else of_each.max(axis=0)
        if self._options.rows == "bar":
            # A motor is lit by as much of the bar as reaches it.
            levels = 100 * np.minimum(np.maximum(levels / 100 * self._rows - self._below, 0), 1)
        return levels

    def _percent(self, value: float, maximum: float | None, end_value: float) -> float:
        if maximum is None or math.isnan(value):
            return 0.0
        o = self._options
        if o.saturate:
            value = min(value, maximum)
        if o.law == "power":
            return float(100.0 * min(max(value / maximum, 0.0), 1.0) ** o.exponent)
        return intensity(value, maximum, end_value=end_value, law=o.law)


def value_of(contact: Contact, name: str) -> float:
    """Return a contact's value by its name: a field of it, or a value of the metric's own; NaN if it is missing now."""
    for one in contact.more:
        if one.name == name:
            return one.value
    value = getattr(contact, name) if name in FIELDS else None
    if value is None:
        known = [field for field in FIELDS if getattr(contact, field) is not None]
        known += [one.name for one in contact.more]
        raise ConfigError(f"the metric measures no value {name!r}", f"it measures {', '.join(known)}")
    return float(value)


def finger_columns(setup: VestSetup, fingers: FingerColumns = FINGERS) -> dict[str, int]:
    """Return the column of a layout that shows each finger, counted from the wearer's left.

    Raises ``ConfigError`` as :func:`column_of_each`, or if a finger in use is beyond the layout's columns.
    """
    columns = column_of_each(fingers, setup.fingers)
    layout = setup.layout
    width = max(layout.columns("front"), layout.columns("back"))
    for finger in setup.fingers:
        if columns[finger] >= width:
            raise ConfigError(
                f"layout {layout.name!r} has {width} columns: the {finger} would be column {columns[finger] + 1}",
                "order stages.mapping.options.fingers so that the fingers in use come first",
            )
    return columns


def column_of_each(fingers: FingerColumns, in_use: Iterable[str]) -> dict[str, int]:
    """Return the column of each finger, from 0; ``ConfigError`` if one is named twice, or one in use is not named."""
    groups = [(group,) if isinstance(group, str) else group for group in fingers]
    columns = {finger: column for column, group in enumerate(groups) for finger in group}
    if len(columns) < sum(map(len, groups)):
        raise ConfigError(f"stages.mapping.options.fingers = {list(fingers)}: a finger is named twice")
    for finger in in_use:
        if finger not in columns:
            raise ConfigError(
                f"the {finger} is in no column of the vest: stages.mapping.options.fingers = {list(fingers)}",
                nearest_hint(
                    finger, columns, "add it to a column, alone or in a list; columns have:", cutoff=0.8
                ),
            )
    return columns


def _full(setup: VestSetup, finger: str, face: str, value: str, given: float | None) -> float | None:
    """Return the full value: the given one, or the calibration's; ``None`` if there is none for this finger."""
    if given is not None:
        return given
    if value in {"cci", "eda"}:
        return setup.maxima.get(finger, {}).get(value)
    raise ConfigError(
        f"stages.mapping.options.{face}_max: missing: the calibration has no maximum of {value!r}",
        f"give the {value} that counts as full",
    )
