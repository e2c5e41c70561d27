"""Define the objects that the hand lifts: three of everyday life, and any variation of them.

Mass, stiffness and friction are independent of one another and of the size, so that a study can vary one alone.
The defaults come from the ranges of household objects; none was measured for this program.
"""

from __future__ import annotations

from typing import Annotated, Final, Literal

import msgspec

from tega.errors import InvalidValueError

PALM_FACE_M: Final = 0.0111
"""How far the palm's face is before the palm's frame."""


class ObjectSpec(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """An upright round object whose wall gives under each finger.

    The wall under one fingertip pushes back with ``stiffness · x + stiffening · x³`` newtons at a dent of ``x``
    metres, whatever the direction in the horizontal plane. A share of the linear part is plastic: it yields
    beyond ``yield_m`` and then leaves a dent.

    Attributes:
        name: What it is called.
        mass_kg: All of it.
        stiffness_n_m: Of the wall under one fingertip, N/m, when new.
        friction: Coulomb coefficient between the object and whatever touches it.
        diameter_m: Of the upright cylinder that it is; thinner ones slip through the five closure poses.
        height_m: Of that.
        stiffening_n_m3: Cubic part of the wall's law, N/m³.
        damping_ratio: Of the wall's springs with their own mass.
        plastic_share: Part of ``stiffness_n_m`` that yields, 0 to 0.9.
        yield_m: Dent at which it begins to.
        harm_m: Narrowing beyond which a person would call it badly deformed.
        grasp_height_m: Height of the middle of the palm over the table when the object is grasped.
        clearance_m: Between the palm and the object in the grasp pose.
        forward_m: How far towards the fingertips the object's axis is from the palm's frame then.
        rgba: Colour to draw it in.
        shell: What gives: ``pads``, a wall on springs for each finger; ``flex``, all of it as one linear elastic
            solid as soft as that wall. A flex has no ``stiffening_n_m3`` and no ``plastic_share``.
    """

    name: str
    mass_kg: Annotated[float, msgspec.Meta(ge=0.15, le=2.0)]
    stiffness_n_m: Annotated[float, msgspec.Meta(ge=50, le=10_000)]
    friction: Annotated[float, msgspec.Meta(ge=0.1, le=1.5)]
    diameter_m: Annotated[float, msgspec.Meta(ge=0.07, le=0.12)]
    height_m: Annotated[float, msgspec.Meta(ge=0.14, le=0.35)]
    stiffening_n_m3: Annotated[float, msgspec.Meta(ge=0, le=1e7)] = 0.0
    damping_ratio: Annotated[float, msgspec.Meta(ge=0.01, le=2)] = 0.5
    plastic_share: Annotated[float, msgspec.Meta(ge=0, le=0.9)] = 0.0
    yield_m: Annotated[float, msgspec.Meta(gt=0, le=0.1)] = 0.1
    harm_m: Annotated[float, msgspec.Meta(gt=0, le=0.1)] = 0.006
    grasp_height_m: Annotated[float, msgspec.Meta(ge=0.07, le=0.2)] = 0.11
    clearance_m: Annotated[float, msgspec.Meta(ge=0, le=0.05)] = 0.003
    forward_m: Annotated[float, msgspec.Meta(ge=-0.05, le=0.1)] = -0.01
    rgba: tuple[float, float, float, float] = (0.6, 0.6, 0.6, 1.0)
    shell: Literal["pads", "flex"] = "pads"

    @property
    def palm_to_axis_m(self) -> tuple[float, float]:
        """Way from palm frame to object axis in the grasp pose, metres: out of the palm, to the fingertips."""
        return PALM_FACE_M + self.diameter_m / 2 + self.clearance_m, self.forward_m

    def with_(self, **changes: object) -> ObjectSpec:
        """Return the same object with some attributes changed.

        Args:
            changes: New values by attribute name.

        Raises:
            InvalidValueError: There is no such attribute, or a value is out of its range.

        Example:
            >>> OBJECTS["bottle"].with_(mass_kg=0.53).mass_kg
            0.53
        """
        try:
            return msgspec.convert(msgspec.to_builtins(self) | changes, ObjectSpec)
        except msgspec.ValidationError as error:
            raise InvalidValueError(f"object {self.name!r}: {error}") from error


OBJECTS: Final[dict[str, ObjectSpec]] = {
    spec.name: spec
    for spec in (
        ObjectSpec(
            name="bottle",
            mass_kg=1.04,
            stiffness_n_m=3000.0,
            friction=0.6,
            diameter_m=0.082,
            height_m=0.26,
            rgba=(0.35, 0.62, 0.85, 1.0),
        ),
        ObjectSpec(
            name="container",
            mass_kg=0.50,
            stiffness_n_m=1500.0,
            friction=0.7,
            diameter_m=0.09,
            height_m=0.19,
            plastic_share=0.33,
            yield_m=0.003,
            harm_m=0.008,
            rgba=(0.93, 0.93, 0.90, 1.0),
        ),
        ObjectSpec(
            name="bag",
            mass_kg=0.40,
            stiffness_n_m=250.0,
            friction=0.5,
            diameter_m=0.10,
            height_m=0.20,
            stiffening_n_m3=2e5,
            damping_ratio=0.7,
            plastic_share=0.33,
            yield_m=0.003,
            harm_m=0.0215,
            forward_m=-0.005,
            rgba=(0.86, 0.70, 0.45, 1.0),
        ),
    )
}
"""Bottle (heavy, rigid), container (medium) and bag (light, soft), by name."""
