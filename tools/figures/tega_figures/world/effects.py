"""What each property of an object does, one at a time, and what each closure level does."""

from __future__ import annotations

from typing import Final, NamedTuple

from tega_figures.world.lift import LiftResult, lift
from tega_figures.world.rig import GRAVITY_M_S2, slip_force_n
from tega_sim.world.objects import OBJECTS, ObjectSpec

__all__ = ["CHANGES", "Effect", "SlipForce", "effects", "levels", "slip_forces"]

CHANGES: Final[tuple[tuple[str, str, float, float], ...]] = (
    ("bottle", "mass_kg", 0.4, 1.6),
    ("bottle", "friction", 1.2, 0.45),
    ("container", "mass_kg", 0.35, 1.2),
    ("bag", "mass_kg", 0.3, 0.8),
    ("bag", "friction", 0.9, 0.3),
    ("bottle", "stiffness_n_m", 6000.0, 1000.0),
    ("container", "stiffness_n_m", 6000.0, 800.0),
    ("bag", "stiffness_n_m", 600.0, 120.0),
)
"""Object, property, its easier and its harder value."""

_GRIPPED_S: Final = 4.0


class Effect(NamedTuple):
    """What one property did, all else being equal.

    Attributes:
        name: The object.
        what: The property.
        values: Its easier and its harder value.
        needed: The lowest level that lifts and holds the object, for each; 6: none.
        narrowing_m: How much narrower the object is when gripped at level 4, before it is lifted, for each.
        right: Whether the right one grew: the level for mass and friction, the narrowing for stiffness.
    """

    name: str
    what: str
    values: tuple[float, float]
    needed: tuple[int, int]
    narrowing_m: tuple[float, float]
    right: bool


class SlipForce(NamedTuple):
    """Force of each of four pads at which an object slips.

    Attributes:
        spec: The object.
        expected_n: ``m · g / (4 · µ)``.
        found_n: In the simulation.
    """

    spec: ObjectSpec
    expected_n: float
    found_n: float


def levels(name: str) -> list[LiftResult]:
    """Return lifts of an object at levels 2 to 5."""
    return [lift(name, level) for level in range(2, 6)]


def effects() -> list[Effect]:
    """Return what each change of :data:`CHANGES` does."""
    rows = []
    for name, subject, easy, hard in CHANGES:
        (low, narrow), (high, narrower) = (
            _needed(OBJECTS[name].with_(**{subject: value})) for value in (easy, hard)
        )
        right = narrower > narrow if subject == "stiffness_n_m" else high > low
        rows.append(Effect(name, subject, (easy, hard), (low, high), (narrow, narrower), right))
    return rows


def slip_forces() -> list[SlipForce]:
    """Return the slip force of each object as it is, and with mass and friction changed."""
    rows = []
    for spec in OBJECTS.values():
        for variant in (spec, spec.with_(mass_kg=spec.mass_kg / 2), spec.with_(friction=1.0)):
            expected = variant.mass_kg * GRAVITY_M_S2 / (4 * variant.friction)
            rows.append(SlipForce(variant, expected, slip_force_n(variant)))
    return rows


def _needed(spec: ObjectSpec) -> tuple[int, float]:
    """Return the lowest level that holds an object, and how much narrower level 4 makes it before the lift."""
    lifts = {level: lift(spec, level, hold_s=0.5) for level in range(2, 6)}
    needed = next((level for level, one in lifts.items() if one.held), 6)
    gripped = [truth.deformation_m for truth in lifts[4].trace if truth.t_s <= _GRIPPED_S]
    return needed, gripped[-1]
