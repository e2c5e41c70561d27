"""Show where on the fingertip a contact is: its middle moves the motors that vibrate within the finger's columns."""

from __future__ import annotations

import math
from collections.abc import Mapping as AnyMapping
from typing import Annotated, ClassVar, Final, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.records import Contact
from tega.stages.base import StageOptions, VestSetup
from tega.stages.slip_row import SlipRowMapping, SlipRowOptions

# Width and height of an upright DIGIT's picture, for a finger whose pictures are unknown.
DIGIT_PX: Final = (240, 320)

_Pixels = Annotated[int, msgspec.Meta(ge=8, le=8192)]

# Of a picture: the shares right and down, as shares right and down of the finger with its tip up.
_TURNED: Final = {
    "up": (lambda x, y: (x, y)),
    "down": (lambda x, y: (1 - x, 1 - y)),
    "left": (lambda x, y: (1 - y, x)),
    "right": (lambda x, y: (y, 1 - x)),
}


class PlaceOptions(SlipRowOptions, frozen=True):
    """Options of the mapping ``place``: those of ``slip-row``, and these; ``rows`` counts where ``blend`` is ``all``.

    Attributes:
        blend: Between two motors ``energy`` shares the power, so that a place between them is felt as strong as one;
            ``all`` lights every motor, as ``columns`` does.
        picture_px: Width and height of the fingertips' pictures; none means those of each finger's own.
        tip: Side of the picture at which the fingertip's end is; it is shown at the top.
    """

    slip_row: Literal["bottom", "top", "none"] = "none"
    blend: Literal["energy", "all"] = "energy"
    picture_px: tuple[_Pixels, _Pixels] | None = None
    tip: Literal["up", "down", "left", "right"] = "up"


class PlaceMapping(SlipRowMapping):
    """Columns in which only the motors at the contact's place vibrate.

    The centroid of the contact (Eq 2) is a share of the image, right and down. A contact that moves down the finger
    moves along the rows. A face's columns are divided among the fingers in use, or lists of fingers: with four each has
    one; with one finger it has all four, and the contact moves across them, too. With d the distance from the place to
    a motor, in motors, and w = max(1 - abs(d), 0) along each axis, a motor shows ``sqrt(w)`` of the intensity
    (Israr and Poupyrev 2011, "Tactile brush", doi 10.1145/1978942.1979235). A contact with an unknown centroid is
    shown by all the finger's motors.
    """

    summary: ClassVar[str] = "the contact's place on the fingertip moves the motors that vibrate"
    options_type: ClassVar[type[StageOptions]] = PlaceOptions

    def __init__(self, setup: VestSetup, options: PlaceOptions) -> None:
        super().__init__(setup, options)
        self._place = options
        self._pictures_px = setup.pictures_px
        layout = setup.layout
        in_use = sorted({self._columns_of[finger] for finger in setup.fingers})
        width = {face: layout.columns(face) for face in ("front", "back")}
        self._own_columns = {
            finger: {
                face: range(n * columns // len(in_use), (n + 1) * columns // len(in_use))
                for face, columns in width.items()
            }
            for finger in setup.fingers
            for n in [in_use.index(self._columns_of[finger])]
        }
        top = int(options.slip_row == "top")
        self._motors = [
            (index, motor.face, motor.row - top, motor.column, int(self._rows[index]))
            for index, motor in enumerate(layout.motors)
            if not self._spared[index]
        ]

    def _spread(self, values: NDArray[np.float64], contacts: AnyMapping[str, Contact]) -> NDArray[np.float64]:
        if self._place.blend == "all":
            return super()._spread(values, contacts)
        levels = np.zeros(len(self._rows))
        for n, finger in enumerate(self._fingers):
            percent = {"front": values[2 * n], "back": values[2 * n + 1]}
            if finger not in self._own_columns or not any(percent.values()):
                continue
            contact = contacts.get(finger)
            at = None if contact is None else self._at(contact)
            for index, face, row, motor_column, n_rows in self._motors:
                own = self._own_columns[finger][face]
                if motor_column in own:
                    weight = (
                        1.0 if at is None else self._weight(at, row, n_rows, motor_column - own[0], len(own))
                    )
                    levels[index] = max(levels[index], percent[face] * weight)
        return levels

    def _at(self, contact: Contact) -> tuple[float, float] | None:
        """Return the place of a contact, as shares right and down of a finger with its tip up."""
        size = self._place.picture_px or self._pictures_px.get(contact.finger, DIGIT_PX)
        x, y = (at / (n - 1) for at, n in zip(contact.centroid_xy, size, strict=True))
        if not (math.isfinite(x) and math.isfinite(y)):
            return None
        right, down = _TURNED[self._place.tip](min(max(x, 0.0), 1.0), min(max(y, 0.0), 1.0))
        return right, down

    def _weight(self, at: tuple[float, float], row: int, n_rows: int, column: int, n_columns: int) -> float:
        """Return the share of the intensity that a motor shows of a contact at a place."""
        down = max(0.0, 1 - abs(at[1] * (n_rows - 1) - row))
        right = max(0.0, 1 - abs(at[0] * (n_columns - 1) - column))
        return math.sqrt(down * right)
