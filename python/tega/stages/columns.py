"""Show touch as a column of motors a finger (Eq 7 to 9), with any value on any face."""

from __future__ import annotations

from collections.abc import Mapping as AnyMapping
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import msgspec
import numpy as np

from tega.errors import ConfigError
from tega.haptics import intensity
from tega.stages.base import Mapping, StageOptions, TouchEvent, VestSetup

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tega.records import Contact

__all__ = ["FIELDS", "ColumnsMapping", "ColumnsOptions", "finger_columns", "value_of"]

FIELDS = (
    "cci",
    "eda",
    "peak",
    "mass",
    "spread",
    "threshold",
    "area_mm2",
    "depth_mm",
    "force_n",
    "strength",
    "broad",
)
"""Numbers of a contact that a face can show."""

_Finger = Literal["thumb", "index", "middle", "ring"]
_FINGERS: tuple[_Finger, _Finger, _Finger, _Finger] = ("thumb", "index", "middle", "ring")

_Positive = Annotated[float, msgspec.Meta(gt=0, le=1e12)]


class ColumnsOptions(StageOptions, frozen=True):
    """Options of the mapping ``columns``.

    Attributes:
        front: Value that the front shows: a number of the contact (cci, eda, peak, mass, depth_mm, force_n and others),
            or a value of the metric's own.
        back: Value that the back shows, likewise.
        front_max: What counts as full on the front, in the value's unit; none means the calibration's (cci, eda).
        back_max: What counts as full on the back, likewise.
        law: ``logistic`` is Eq 7 as printed; ``linear`` is in proportion.
        end_value: Share of full intensity that the logistic law gives at value 0.
        saturate: Whether a value above its maximum counts as the maximum; as printed the law goes on.
        fingers: Which finger each column shows, from the wearer's left.
    """

    front: str = "cci"
    back: str = "eda"
    front_max: _Positive | None = None
    back_max: _Positive | None = None
    law: Literal["logistic", "linear"] = "logistic"
    end_value: Annotated[float, msgspec.Meta(gt=0, lt=0.5)] = 0.01
    saturate: bool = False
    fingers: tuple[_Finger, _Finger, _Finger, _Finger] = _FINGERS


class ColumnsMapping(Mapping):
    """A finger a column; one value in front, another at the back; every row of a column alike.

    Raises:
        ConfigError: A value has no maximum to be full at, a finger is named twice, or the layout has too few columns.
    """

    summary: ClassVar[str] = "a column a finger: CCI in front, EDA at the back (Eq 7 to 9)"
    options_type: ClassVar[type[StageOptions]] = ColumnsOptions

    def __init__(self, setup: VestSetup, options: ColumnsOptions) -> None:
        self._options = options
        columns = finger_columns(setup, options.fingers)
        self._shown = [
            (index, motor.face, columns[motor.column])
            for index, motor in enumerate(setup.layout.motors)
            if motor.column in columns
        ]
        self._n = len(setup.layout.motors)
        self._full = {
            finger: (
                _full(setup, finger, "front", options.front, options.front_max),
                _full(setup, finger, "back", options.back, options.back_max),
            )
            for finger in setup.fingers
        }

    def columns(self, finger: str, contact: Contact) -> tuple[float, float]:
        """Return the finger's columns, percent; 0 without contact."""
        if not contact.in_contact:
            return 0.0, 0.0
        front, back = self._full[finger]
        o = self._options
        return self._percent(value_of(contact, o.front), front), self._percent(
            value_of(contact, o.back), back
        )

    def levels(
        self,
        t_ns: int,  # noqa: ARG002  # what is fresh is shown as it is
        contacts: AnyMapping[str, Contact],
        events: Sequence[TouchEvent],  # noqa: ARG002  # events are not asked for
    ) -> NDArray[np.float64]:
        """Return every motor's level."""
        percent = {finger: self.columns(finger, contact) for finger, contact in contacts.items()}
        levels = np.zeros(self._n)
        for index, face, finger in self._shown:
            if finger in percent:
                levels[index] = percent[finger][face == "back"]
        return levels

    def _percent(self, value: float, maximum: float | None) -> float:
        if maximum is None:
            return 0.0
        o = self._options
        if o.saturate:
            value = min(value, maximum)
        return intensity(value, maximum, end_value=o.end_value, law=o.law)


def value_of(contact: Contact, name: str) -> float:
    """Return a contact's value by its name: a field of it, or a value of the metric's own.

    Raises:
        ConfigError: The metric measures no such value.
    """
    for one in contact.more:
        if one.name == name:
            return one.value
    value = getattr(contact, name) if name in FIELDS else None
    if value is None:
        known = [field for field in FIELDS if getattr(contact, field) is not None]
        known += [one.name for one in contact.more]
        raise ConfigError(f"the metric measures no value {name!r}", f"it measures {', '.join(known)}")
    return float(value)


def finger_columns(setup: VestSetup, fingers: Sequence[str] = _FINGERS) -> dict[int, str]:
    """Return the finger that each column of a layout shows, from the wearer's left.

    Raises:
        ConfigError: A finger is named twice, or the layout has fewer columns than a finger in use needs.
    """
    if len(set(fingers)) < len(fingers):
        raise ConfigError(f"stages.mapping.options.fingers = {list(fingers)}: a finger is named twice")
    layout = setup.layout
    width = max(layout.columns("front"), layout.columns("back"))
    for column, finger in enumerate(fingers):
        if finger in setup.fingers and column >= width:
            raise ConfigError(
                f"layout {layout.name!r} has {width} columns: the {finger} would be column {column + 1}",
                "order stages.mapping.options.fingers so that the fingers in use come first",
            )
    return dict(enumerate(fingers))


def _full(setup: VestSetup, finger: str, face: str, value: str, given: float | None) -> float | None:
    """Return what counts as full: given, or the calibration's; ``None`` where that has none of this finger."""
    if given is not None:
        return given
    if value in {"cci", "eda"}:
        return setup.maxima.get(finger, {}).get(value)
    raise ConfigError(
        f"stages.mapping.options.{face}_max: missing: the calibration has no maximum of {value!r}",
        f"give the {value} that counts as full",
    )
