"""Press a simulated fingertip over time, as touch sequences labelled frame by frame with what is true.

For judging a reading: each sequence is one unit of the simulated gel, with leftovers, creep and drift on, pressed by
one shape with a force that follows a curve. Simulated; ``docs/evidence/sim-touch.md`` says how close it comes to a
real one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from types import MappingProxyType
from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega import _native
from tega.errors import InvalidValueError
from tega_sim.gel import CAMERA_HZ, PX_PER_MM, Gel
from tega_sim.seams import Indenter

Shape = Literal["sphere", "cylinder", "capsule", "box", "plane"]

_FLAT = np.eye(3)
_ACROSS = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Axes of a bar that lies across the finger; of one that lies along it."""
_ALONG = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
_HALF = float(np.sqrt(0.5))
_EDGE = np.array([[1.0, 0.0, 0.0], [0.0, _HALF, -_HALF], [0.0, _HALF, _HALF]])

SHAPES: Final = MappingProxyType[str, tuple[Shape, tuple[float, float, float], NDArray[np.float64]]](
    {
        "ball 4 mm": ("sphere", (4.0, 0.0, 0.0), _FLAT),
        "ball 12 mm": ("sphere", (12.0, 0.0, 0.0), _FLAT),
        "bar": ("cylinder", (3.0, 5.0, 0.0), _ACROSS),
        "wall across": ("cylinder", (33.0, 100.0, 0.0), _ACROSS),
        "wall along": ("cylinder", (33.0, 100.0, 0.0), _ALONG),
        "edge": ("box", (4.0, 4.0, 4.0), _EDGE),
        "pad 5 x 5": ("box", (2.5, 2.5, 2.5), _FLAT),
        "face": ("box", (30.0, 30.0, 30.0), _FLAT),
        "soft block": ("box", (1.7, 6.0, 1.5), _FLAT),
    }
)
"""Kind, size in millimetres and axes of what presses. The soft block is three strips of 3.4 x 12 mm beside each other
that lie on the gel as it is round and share the force evenly, as something softer than the gel does."""

_STRIPS_MM: Final = (-3.4, 0.0, 3.4)


class GelMoment(NamedTuple):
    """One frame of a sequence and what is true at its time."""

    t_s: float
    """Seconds since the sequence began."""
    image: NDArray[np.uint8]
    """uint8 (320, 240, 3), BGR; an array of its own."""
    force_n: float
    """Normal force, newtons."""
    touches: bool
    area_px: int
    """Touching area, pixels."""
    area_mm2: float
    depth_mm: float
    """Largest displacement of the gel, millimetres, creep included; 0 where nothing touches, whatever is left."""
    centre_xy: tuple[float, float]
    """Middle of the displacement of what touches, pixels (column, row); NaN where nothing does."""


def ramp(
    *, peak_n: float, wait_s: float, rise_s: float, hold_s: float, fall_s: float
) -> Callable[[float], float]:
    """Return a force, of seconds, that waits at 0, rises evenly, holds, falls evenly and stays at 0."""
    ends = np.cumsum([wait_s, rise_s, hold_s, fall_s])
    forces = np.array([0.0, peak_n, peak_n, 0.0])
    return lambda t_s: float(np.interp(t_s, ends, forces))


def pressing(
    name: str,
    force_n: float,
    *,
    centre_mm: tuple[float, float] = (0.0, 0.0),
    on: Literal["digit", "flat"] = "digit",
) -> list[Indenter]:
    """Return one of :data:`SHAPES` over a place of the gel; a force of 0 returns nothing.

    ``force_n`` is the normal force in all, ``centre_mm`` right of and below the picture's middle; ``on`` is
    the form of the gel that the soft block's strips lie on.
    """
    if name not in SHAPES:
        raise InvalidValueError(f"shape = {name!r} is not known", f"use one of {', '.join(SHAPES)}")
    if force_n <= 0:
        return []
    kind, size_mm, axes = SHAPES[name]
    if name != "soft block":
        return [Indenter(kind, size_mm, np.column_stack([axes, [*centre_mm, 0.0]]), force_n)]
    strips = []
    for beside in _STRIPS_MM:
        x, y = centre_mm[0] + beside, centre_mm[1]
        lies = _facing(x, y) if on == "digit" else axes
        strips.append(
            Indenter(kind, size_mm, np.column_stack([lies, [x, y, 0.0]]), force_n / len(_STRIPS_MM))
        )
    return strips


def press_sequence(
    name: str,
    *,
    seed: int,
    force_n: Callable[[float], float],
    duration_s: float,
    centre_xy: tuple[float, float] = (119.5, 159.5),
    rate_hz: float = CAMERA_HZ,
    start_s: float = 0.0,
    shape: Literal["digit", "flat"] = "digit",
    spread: float = 1.0,
    memory: bool = True,
) -> Iterator[GelMoment]:
    """Press one shape into one unit and yield each frame with its truth; the same arguments, the same bits.

    Args:
        name: One of :data:`SHAPES`.
        seed: Of the unit.
        force_n: Force, newtons, of the time since the sequence began, seconds; :func:`ramp` makes one.
        duration_s: How long the sequence is.
        centre_xy: Over which place of the picture the shape stands, pixels (column, row); how near to it the contact
            is hangs on the gel's form, which ``centre_xy`` of the truth knows.
        rate_hz: Frames a second; noise and drift go by the camera's 60 a second.
        start_s: How long the unit has been running: where in its drift the sequence begins.
        shape: The gel's form, as of :class:`~tega_sim.gel.Gel`.
        spread: How much units differ, likewise.
        memory: Whether leftovers, creep and drift are on, likewise.

    Raises:
        InvalidValueError: An argument is out of range or not known.

    Example:
        >>> force_n = ramp(peak_n=2.0, wait_s=0.05, rise_s=0.1, hold_s=0.1, fall_s=0.1)
        >>> moments = list(press_sequence("ball 4 mm", seed=1, force_n=force_n, duration_s=0.5))
        >>> len(moments), moments[0].touches, max(snapshot.force_n for snapshot in moments)
        (30, False, 2.0)
    """
    for subject, value in (("rate_hz", rate_hz), ("duration_s", duration_s)):
        if not 0 < value < np.inf:
            raise InvalidValueError(
                f"{subject} = {value}, wanted more than 0", "60 frames a second are a DIGIT's"
            )
    pressing(name, 0.0)
    gel = Gel(seed, spread=spread, shape=shape, memory=memory)
    x, y = ((at - middle) / PX_PER_MM for at, middle in zip(centre_xy, (119.5, 159.5), strict=True))
    for number in range(round(duration_s * rate_hz)):
        t_s = number / rate_hz
        now_n = force_n(t_s)
        index = round((start_s + t_s) * CAMERA_HZ)
        image = gel.frame(pressing(name, now_n, centre_mm=(x, y), on=shape), index, t_s=start_s + t_s)
        truth = gel.truth
        yield GelMoment(t_s, image, now_n, *truth)


def _facing(x_mm: float, y_mm: float) -> NDArray[np.float64]:
    """Return axes of a strip that lies flat on the ``digit`` gel at a place."""
    across, along = _native.gel_fall(x_mm, y_mm)
    out = np.array([across, along, 1.0]) / np.sqrt(1 + across**2 + along**2)
    right = np.array([1.0, 0.0, -across]) / np.sqrt(1 + across**2)
    return np.column_stack([right, np.cross(out, right), out])
