"""A mapping of one's own: each finger's column is a bar, which grows with the contact as a thermometer's does."""

from __future__ import annotations

from collections.abc import Mapping as AnyMapping
from collections.abc import Sequence
from typing import Annotated, ClassVar

import msgspec
import numpy as np

from tega.stages import Contact, Event, Mapping, StageOptions, VestSetup

FINGERS = ("thumb", "index", "middle", "ring")


class BarsOptions(StageOptions, frozen=True):
    """The keys of the mapping's ``options`` table.

    Attributes:
        power: Exponent of the law: below 1 a light touch is shown more strongly than in proportion.
        percent: Level of a motor that is wholly within the bar.
        slip_s: How long a slip lights the whole face; 0 leaves it out.
    """

    power: Annotated[float, msgspec.Meta(gt=0, le=4)] = 0.5
    percent: Annotated[float, msgspec.Meta(ge=0, le=100)] = 80.0
    slip_s: Annotated[float, msgspec.Meta(ge=0, le=2)] = 0.15


class BarsMapping(Mapping):
    """A bar a finger, CCI in front and EDA at the back, from the bottom row up."""

    summary: ClassVar[str] = "a bar of motors a finger, as long as the contact is firm"
    options_type: ClassVar[type[StageOptions]] = BarsOptions
    wants_events: ClassVar[bool] = True

    def __init__(self, setup: VestSetup, options: BarsOptions) -> None:
        self._setup, self._options = setup, options
        self._slip_until_ns = 0

    def levels(self, t_ns: int, contacts: AnyMapping[str, Contact], events: Sequence[Event]) -> np.ndarray:
        """Return the level of every motor, percent."""
        o, layout = self._options, self._setup.layout
        for event in events:
            if event.kind == "slip":
                self._slip_until_ns = event.t_ns + round(o.slip_s * 1e9)
        levels = np.zeros(len(layout.motors))
        for index, motor in enumerate(layout.motors):
            finger = FINGERS[motor.column] if motor.column < len(FINGERS) else ""
            if finger in contacts:
                rows = layout.rows(motor.face)
                lit = self._share(finger, contacts[finger], motor.face) * rows - (rows - 1 - motor.row)
                levels[index] = o.percent * np.clip(lit, 0.0, 1.0)
                if t_ns < self._slip_until_ns:
                    levels[index] = o.percent
        return levels

    def _share(self, finger: str, contact: Contact, face: str) -> float:
        name, value = ("cci", contact.cci) if face == "front" else ("eda", float(contact.eda))
        full = self._setup.maxima.get(finger, {}).get(name)
        if not contact.in_contact or full is None:
            return 0.0
        return float(np.clip(value / full, 0.0, 1.0) ** self._options.power)
