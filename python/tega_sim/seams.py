"""Define the types that the simulated world, gel, operator and loop pass to one another.

The world steps physics and returns each fingertip's indenters (:class:`Indenter`) and the true state
(:class:`WorldTruth`). The gel turns indenters into a camera frame. The operator receives everything that a person
could perceive (:class:`Percept`) and returns the person's action (:class:`Act`). Nothing here computes.

Fingers are in the order thumb, index, middle, ring. Pad frame of a fingertip: origin on the undeformed gel at its
middle, x to the right and y down in the upright picture, z out of the gel; right-handed.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.haptics import MotorLevels


class Indenter(NamedTuple):
    """A rigid shape that presses a fingertip's gel.

    Attributes:
        size_mm: Sphere: radius, 0, 0. Cylinder and capsule: radius, half length along its own z, 0. Box: half
            lengths along its own axes. Plane: zeros; its own z is its outward normal.
        pose_mm: float64 (3, 4), rotation and translation from the shape's own frame to the pad frame.
        force_n: Normal force of this shape on the gel, 0 or more.
    """

    shape: Literal["sphere", "cylinder", "capsule", "box", "plane"]
    size_mm: tuple[float, float, float]
    pose_mm: NDArray[np.float64]
    force_n: float


class WorldTruth(NamedTuple):
    """True state of the simulated world, whatever a sensor reports.

    Attributes:
        t_s: Simulated time since the trial began.
        object_height_m: Height of the object over where it stood.
        pad_force_n: Normal force on each pad, thumb first.
        slip_m: How far the object has slid down through the grasp since it left the table.
        slip_m_s: Speed of that.
        deformation_m: How much narrower the object is than unloaded.
        damage_m: How much of that stays when let go.
        dropped: Whether the object was lifted and lies on the table, or below, again.
        hand_to_object_m: Distance of the grasp's centre from the object's.
    """

    t_s: float
    object_height_m: float
    lift_off: bool
    pad_force_n: tuple[float, float, float, float]
    slip_m: float
    slip_m_s: float
    deformation_m: float
    damage_m: float
    dropped: bool
    hand_to_object_m: float


class Percept(NamedTuple):
    """Sights and vibrations that reach the person now; delays and thresholds are the person's own.

    Attributes:
        vest: Current frame of the vest's motors; ``None`` if it is off or not worn.
        closure: The hand's closure as it can be seen, levels 1 to 5 with fractions; ``None``: not shown.
    """

    t_s: float
    scene: WorldTruth
    vest: MotorLevels | None
    closure: float | None = None


class Act(NamedTuple):
    """Act of the person, which lasts until the next one.

    Attributes:
        excitation: Drive of the grip muscles as a share of the strongest, 0 to 1.15; EMG follows it.
        forearm_m: Where the person moves the hand: height over the grasp pose and distance back from it.
        phase: ``reach``, ``grasp``, ``lift``, ``hold``, ``place``, ``release`` or ``done``.
    """

    excitation: float
    forearm_m: tuple[float, float]
    phase: str
