"""Read the objects that the hand lifts from a file: three of everyday life, others, and variations of them.

Mass, stiffness and friction are independent of one another and of the size, so that a study can vary one alone.
Values, ranges and sources of the three stand in ``objects.toml`` beside this module.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import msgspec

from tega.config.errors import wrong_value
from tega.errors import ConfigError, InvalidValueError, TegaError
from tega.runtime.files.foreign_file import parse_toml, plain_name, read_foreign
from tega.runtime.removed import Removed, without_removed

_NEW: Final = "plan again without it; the version that wrote the file reads it"

REMOVED_FIELDS: Final[Mapping[str, Removed]] = {
    "shear": Removed("0.3", "simulated gels no longer give way sideways", _NEW, "off"),
    "hand": Removed("0.3", "the decoder always gives the hand's level", _NEW, "decoder"),
    "beside": Removed("0.3", "answers of stages beside the connected ones are in the tables", _NEW, []),
    "rules": Removed("0.3", "simulated people follow the third version of their rules", _NEW, 3),
    "relief_counts": Removed("0.3", "simulated objects have no relief", _NEW, 0.0),
    "relief_mm": Removed("0.3", "simulated objects have no relief", _NEW, 0.6),
    "shell": Removed("0.3", "simulated objects are no longer one elastic solid", _NEW, "pads"),
}
"""Fields by name."""


def trial_fields(table: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a trial and its object, less those that were taken out and not in use.

    A field that was taken out and was in use raises :class:`ConfigError`.
    """
    fields = without_removed(table, REMOVED_FIELDS)
    if isinstance(spec := fields.get("spec"), dict):
        fields["spec"] = without_removed(spec, REMOVED_FIELDS)
    return fields


PALM_FACE_M: Final = 0.0111
"""How far the palm's face is before the palm's frame."""

# Factor and form of a value in a name: a study's objects have letters, digits, + - _ in theirs.
_IN_NAME: Final = {"mass_kg": (1e3, "{}g"), "stiffness_n_m": (1.0, "{}npm"), "friction": (1e2, "mu{}")}


class ObjectSpec(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """An upright round object with a wall that gives under each finger.

    The wall under one fingertip pushes back with ``stiffness · x + stiffening · x³`` newtons at a dent of
    ``x`` metres, whatever the direction in the horizontal plane. A share of the linear part is plastic: it
    yields beyond ``yield_m`` and then leaves a dent.

    Attributes:
        stiffness_n_m: Stiffness of the wall under one fingertip, when new.
        friction: Coulomb coefficient between the object and whatever touches it.
        diameter_m: Diameter of the upright cylinder; thinner ones slip through the five closure poses.
        stiffening_n_m3: Cubic part of the wall's law, N/m³.
        damping_ratio: Damping ratio of the wall's springs with their own mass.
        plastic_share: Part of ``stiffness_n_m`` that yields, 0 to 0.9.
        yield_m: Dent at which it begins to.
        harm_m: Narrowing beyond which a person would call it badly deformed.
        grasp_height_m: Height of the middle of the palm over the table when the object is grasped.
        clearance_m: Between the palm and the object in the grasp pose.
        forward_m: How far towards the fingertips the object's axis is from the palm's frame then.
        shell: What gives, always ``pads``: a wall on springs for each finger. Files of studies hold it.
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
    shell: Literal["pads"] = "pads"

    @property
    def palm_to_axis_m(self) -> tuple[float, float]:
        """Way from palm frame to object axis in the grasp pose, metres: out of the palm, to the fingertips."""
        return PALM_FACE_M + self.diameter_m / 2 + self.clearance_m, self.forward_m

    def with_(self, **changes: object) -> ObjectSpec:
        """Return the same object with some attributes changed.

        An unknown attribute, or a value out of its range, raises :class:`InvalidValueError`.

        Example:
            >>> OBJECTS["bottle"].with_(mass_kg=0.53).mass_kg
            0.53
        """
        try:
            return msgspec.convert(given := msgspec.to_builtins(self) | changes, ObjectSpec)
        except msgspec.ValidationError as error:
            raise InvalidValueError(f"object {self.name!r}: {wrong_value(error, given)}") from error


class ObjectRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One object of a file.

    ``range`` is the lowest and highest plausible value by attribute, for maps and factorial plans; ``source``
    where values come from, by attribute. The harm rule's source has to be there.
    """

    spec: ObjectSpec
    range: dict[str, tuple[float, float]]
    source: dict[str, str]


def read_objects(path: Path | None = None) -> dict[str, ObjectRecord]:
    """Read a file of objects; ``None`` means the package's own.

    Mass, stiffness, friction or a harm rule without a source raise :class:`ConfigError`; a name that could
    not name a file raises :class:`UnsafeNameError`.
    """
    source = files("tega_sim.world") / "objects.toml" if path is None else path
    content = source.read_bytes() if path is None else read_foreign(path, most_mib=1, error=ConfigError)
    try:
        tree: dict[str, Any] = parse_toml(content.decode("utf-8-sig"))
        records = {name: _record(name, dict(table), source.name) for name, table in tree.items()}
    except TegaError:
        raise
    except (TypeError, ValueError) as error:  # of TOML and of msgspec
        raise ConfigError(
            f"{source.name}: {error}", "write one table an object, as in tega_sim/world/objects.toml"
        ) from error
    if not records:
        raise ConfigError(f"{source.name}: has no object", "write one table an object, such as [bottle]")
    return records


def crossed(
    specs: Sequence[ObjectSpec],
    *,
    mass_kg: Sequence[float] = (),
    stiffness_n_m: Sequence[float] = (),
    friction: Sequence[float] = (),
) -> dict[str, ObjectSpec]:
    """Cross objects with values of mass, stiffness and friction, for a factorial plan; none leaves each its own.

    Returns a variant for each combination, by a name such as ``bag_600g_mu30``; a value out of range raises
    :class:`InvalidValueError`.

    Example:
        >>> list(crossed([OBJECTS["bag"]], mass_kg=[0.3, 0.6], friction=[0.5]))
        ['bag_300g_mu50', 'bag_600g_mu50']
    """
    factors = {"mass_kg": mass_kg, "stiffness_n_m": stiffness_n_m, "friction": friction}
    requested = {subject: tuple(dict.fromkeys(values)) for subject, values in factors.items() if values}
    variants: dict[str, ObjectSpec] = {}
    for spec, values in itertools.product(specs, itertools.product(*requested.values())):
        changes = dict(zip(requested, values, strict=True))
        name = variant_name(spec.name, changes)
        variants[name] = spec.with_(name=name, **changes)
    return variants


def variant_name(name: str, changes: Mapping[str, float | None]) -> str:
    """Return the name of an object with mass, stiffness or friction changed; ``None`` is no change.

    Example:
        >>> variant_name("bag", {"mass_kg": 0.6, "stiffness_n_m": None, "friction": 0.45})
        'bag_600g_mu45'
    """
    for subject, value in changes.items():
        if value is not None:
            factor, form = _IN_NAME[subject]
            name += "_" + form.format(f"{factor * value:g}".replace(".", "-"))
    return name


def _record(name: str, table: dict[str, Any], where: str) -> ObjectRecord:
    plain_name(name, subject="object", source=where)
    ranges = msgspec.convert(table.pop("range", {}), dict[str, tuple[float, float]])
    source = msgspec.convert(table.pop("source", {}), dict[str, str])
    if missing := sorted({*_IN_NAME, "harm_m"} - {k for k, v in source.items() if v}):
        raise ConfigError(
            f"{where}: object {name!r} has no source for {', '.join(missing)}",
            f"write it under [{name}.source]",
        )
    spec = msgspec.convert({**without_removed(table, REMOVED_FIELDS), "name": name}, ObjectSpec)
    for subject, (low, high) in ranges.items():
        if not low <= getattr(spec, subject, high + 1) <= high:
            raise ConfigError(
                f"{where}: object {name!r}: {subject} is not within its range {low:g} to {high:g}",
                "correct one of them",
            )
    return ObjectRecord(spec, ranges, source)


OBJECTS: Final[dict[str, ObjectSpec]] = {name: record.spec for name, record in read_objects().items()}
"""Bottle (heavy, rigid), container (medium) and bag (light, soft), by name."""
