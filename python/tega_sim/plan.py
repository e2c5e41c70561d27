"""Define a trial's plan and its result: two records that go to files and between processes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal, Self, TypeAlias

import msgspec

from tega.config import LOOP_KEYS, SessionConfig, load_config
from tega.config.errors import wrong_value
from tega.errors import ConfigError, InvalidValueError
from tega.runtime.words import nearest_hint
from tega_sim.conditions import ARMS, CONDITIONS, Condition
from tega_sim.operator.vision import ViewName
from tega_sim.score import TrialEvent
from tega_sim.world.objects import OBJECTS, ObjectSpec

Task: TypeAlias = Literal["lift", "place", "fill"]
"""Task of a trial."""


FULL_N = 8.0
"""Force on a pad that counts as full, newtons: that of the guided presses, by which the pictures' maxima are taken."""


class TrialPlan(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Plan of a trial; equal plans give equal results, bit for bit.

    Attributes:
        object: Name in :data:`tega_sim.world.OBJECTS`, or of ``spec``.
        seed: Seed of the person and of all random numbers: the same for all objects and conditions.
        operator: ``simulated``: a person drawn from the population. ``scripted``: a fixed course.
            ``keyboard``: a user at the keys, who is given to :func:`run_trial`.
        practice: Lifts of the same object under the same condition before the one that counts.
        mass_kg: Instead of the object's own, as the following.
        stiffness_n_m: Stiffness of the object's wall.
        friction: Between object and gel.
        settings: Settings of the loop, as ``key=value``: those of stages (``stages.metric.name=reading``) and
            :data:`tega.config.LOOP_KEYS`.
        view: Sight of the hand while the object is held, see :data:`tega_sim.operator.VIEWS`.
        spec: The object, where it is none of :data:`tega_sim.world.OBJECTS`.
        task: ``lift``: up, held and put down where it stood. ``place``: carried to a second marked place
            before that. ``fill``: held for ten seconds while it is filled, see :mod:`tega_sim.filling`.
    """

    object: str
    condition: Condition = "haptic"
    seed: Annotated[int, msgspec.Meta(ge=0, lt=2**32)] = 0
    operator: Literal["simulated", "scripted", "keyboard"] = "simulated"
    practice: Annotated[int, msgspec.Meta(ge=0, le=100)] = 0
    preset: Literal["paper", "live"] = "live"
    mass_kg: float | None = None
    stiffness_n_m: float | None = None
    friction: float | None = None
    settings: tuple[str, ...] = ()
    view: ViewName = "direct"
    spec: ObjectSpec | None = None
    task: Task = "lift"

    @property
    def object_spec(self) -> ObjectSpec:
        """The object, with the changes of the plan."""
        changes = {name: value for name, value in self.changes.items() if value is not None}
        return (self.spec or OBJECTS[self.object]).with_(**changes)

    @property
    def changes(self) -> dict[str, float | None]:
        """Changes of the plan to the object, by attribute."""
        return {name: getattr(self, name) for name in ("mass_kg", "stiffness_n_m", "friction")}

    @property
    def other(self) -> TrialPlan:
        """Trial that lends its vest frames to a sham: the same person, the next object.

        The vest is the real one; in the place of pulses at true slips it is the other trial's pulses.
        """
        names = list(OBJECTS)
        name = names[(names.index(self.object) + 1) % len(names)] if self.object in names else names[0]
        return msgspec.structs.replace(
            self,
            object=name,
            condition="oracle" if ARMS[self.condition].pulses else "haptic",
            operator="scripted" if self.operator == "scripted" else "simulated",
            spec=None,
            **dict.fromkeys(self.changes),
        )

    @classmethod
    def checked(cls, fields: dict[str, Any]) -> Self:
        """Make a plan of plain values, and check them."""
        name, spec = fields.get("object"), fields.get("spec")
        if name not in OBJECTS if spec is None else getattr(spec, "name", None) != name:
            raise InvalidValueError(f"object = {name!r} is not known", nearest_hint(str(name), OBJECTS))
        condition = fields.get("condition", "haptic")
        if condition not in CONDITIONS:
            raise InvalidValueError(
                f"condition = {condition!r} is not known", nearest_hint(condition, CONDITIONS)
            )
        try:
            plan = msgspec.convert(tree := {**fields, "spec": msgspec.to_builtins(spec)}, cls)
        except msgspec.ValidationError as error:
            raise InvalidValueError(f"plan of a trial: {wrong_value(error, tree)}") from error
        loop_settings(plan.preset, plan.settings)
        _ = plan.object_spec  # refuses what is out of range
        return plan


def loop_settings(preset: Literal["paper", "live"], settings: Sequence[str]) -> SessionConfig:
    """Return the settings of a trial's loop: the preset's, with the loop's ``key=value`` of ``settings``."""
    for item in settings:
        key = item.partition("=")[0].strip()
        if not key.startswith("stages.") and key not in LOOP_KEYS:
            raise ConfigError(
                f"--set {item!r}: a simulated trial has no such setting",
                f"it has stages.*, {', '.join(LOOP_KEYS)}",
            )
    return load_config(None, environ={}, sets=[f"session.preset={preset}", *settings]).config


class TrialResult(TrialPlan, frozen=True, kw_only=True):
    """Outcome of a trial, with its plan repeated.

    Attributes:
        success: Lifted to 0.2 m and held there for 1 s within 15 s, and not dropped; in a task ``place`` put
            down on its mark as well.
        slips: Visible slips after lift-off, until it was put down.
        deformations: Times the object was narrowed more than is good for it.
        drops: 1 if it was lifted and fell.
        duration_s: From the start until the person was done, or the trial was ended.
        peak_force_n: Largest normal force on one fingertip.
        lift_off_s: When it left the table; ``None`` if it didn't.
        lifted_s: When it had been at the height for a second; ``None`` if it hadn't.
        deformation_m: Largest narrowing.
        mean_level: Mean closure level from lift-off until it was put down; 0 without lift-off.
        simulated_s: Time simulated, practice included.
        person: First digits of the SHA-256 of the people's parameters and the version of their rules; empty
            without a simulated person.
        placed: Task ``place``: whether it stands upright within 20 mm of the second mark, let go of and not
            dropped; ``None`` in other tasks.
        off_mark_m: How far from that mark it is in the end.
    """

    success: bool
    slips: int
    deformations: int
    drops: int
    duration_s: float
    peak_force_n: float
    lift_off_s: float | None
    lifted_s: float | None
    slid_m: float
    deformation_m: float
    mean_level: float
    events: tuple[TrialEvent, ...]
    simulated_s: float
    person: str = ""
    placed: bool | None = None
    off_mark_m: float | None = None

    @property
    def plan(self) -> TrialPlan:
        """The plan it came from."""
        return TrialPlan(**{name: getattr(self, name) for name in TrialPlan.__struct_fields__})
