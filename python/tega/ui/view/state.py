"""Define what displays show: one moment, the same for a real run, a replay and a simulation, and a run's course.

Everything but the loop's own view is optional; a display leaves out missing parts. The arrays are borrowed: do not
write into them after offering a state.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tega.loop.snapshot import LoopView
from tega.records import Contact
from tega.stages.base import TouchMap

ShapeKind: TypeAlias = Literal["sphere", "capsule", "cylinder", "box", "plane"]


Shape: TypeAlias = tuple[str, ShapeKind, tuple[float, float, float], tuple[float, float, float, float]]
"""A primitive of the 3-D scene: name, kind, size, colour.

Size in metres: a box's half lengths; a sphere's radius; radius and half length of the straight part along its own z of
a cylinder or capsule; half lengths in x and y of a plane. Colour: red, green, blue, opacity, 0 to 1.
"""


_NO_CONTACT: Final = Contact(finger="", t_ns=0, in_contact=False)


class TouchImage(NamedTuple):
    """A fingertip's picture, uint8 (H, W, 3), BGR, and the contact that the run's own metric found in it.

    ``map`` is the metric's, with its outline; ``None`` where it has none, or measured somewhere else.
    """

    frame: NDArray[np.uint8]
    contact: Contact = _NO_CONTACT
    map: TouchMap | None = None


class EmgTail(NamedTuple):
    """The newest few seconds of the muscle signal, (n, channels), the newest last.

    ``maxima`` are each channel's block means at full effort, (channels,), in ``unit``; empty if unknown.
    """

    samples: NDArray[np.float64]
    rate_hz: float
    maxima: NDArray[np.float64]
    kind: Literal["raw", "rectified", "envelope"]
    unit: str = ""


class ViewState(NamedTuple):
    """View of a run at one moment.

    Attributes:
        t_ns: Time since the run began, nanoseconds.
        images: Pictures by finger; ``None`` where there are none.
        shapes: Primitives of the scene. The same object as long as they are the same shapes.
        poses: float64 (n, 7), one row a shape: position in metres, then the quaternion w, x, y, z; z is up.
        palm: float64 (7,), where the palm of the drawn hand is, as a row of ``poses``: the hand as commanded
            is drawn there too.
        contact_points: float64 (k, 6): where, metres, and the force on the object there, newtons.
        rows: Lines of text, such as object, condition, phase.
        cameras: Pictures of scene cameras by name, uint8 (H, W, 3), BGR.
    """

    t_ns: int
    loop: LoopView
    images: Mapping[str, TouchImage] | None = None
    shapes: Sequence[Shape] | None = None
    poses: NDArray[np.float64] | None = None
    palm: NDArray[np.float64] | None = None
    contact_points: NDArray[np.float64] | None = None
    emg: EmgTail | None = None
    rows: Mapping[str, str] = {}
    latency_ms: Mapping[str, float] = {}
    cameras: Mapping[str, NDArray[np.uint8]] = {}


class FingerCourse(NamedTuple):
    """One finger over time, each (n,): times of its pictures, seconds, and contact.

    ``cci_norm`` and ``eda_norm`` are shares of the maximum, 0 to 1.
    """

    t_s: NDArray[np.float64]
    in_contact: NDArray[np.bool_]
    cci_norm: NDArray[np.float64]
    eda_norm: NDArray[np.float64]


class VestCourse(NamedTuple):
    """The vest over time; ``t_s`` are the times of the frames, (n,).

    ``intensities`` are percent, uint8 (n, n_motors), front by columns from the wearer's left, then the back
    in the same order. ``motors`` are the face and column of each, such as ``front column 1``, counted from 1.
    """

    t_s: NDArray[np.float64]
    intensities: NDArray[np.uint8]
    motors: tuple[str, ...]
