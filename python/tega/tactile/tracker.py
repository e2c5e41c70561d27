"""Follow the touch of a fingertip camera from frame to frame: a reading with a memory.

:class:`TouchTracker` learns its sensor's appearance and variation at rest, follows slow drift, detects light, broad
and soft contacts by the whole area that they change, and ignores the imprint that a released contact leaves in the
gel. ``docs/evidence/touch-live.md`` describes the method and its accuracy.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega import _native
from tega._native import TrackedContact
from tega.errors import InvalidValueError

Order = Literal["bgr", "rgb"]
Outline = Literal["dent", "contact"]

__all__ = [
    "DEPTH_LAW",
    "GelLight",
    "KnownPress",
    "TouchTracker",
    "TrackedContact",
    "calibrate_light",
    "nominal_light",
    "sensor_noise",
    "update_fingers",
]


class GelLight(NamedTuple):
    """Light, scale and stiffness of one sensor's gel, which turn colours into millimetres and newtons."""

    terms: tuple[tuple[tuple[float, ...], ...], ...]
    """Change of blue, green and red in counts for a slope of 1 across and along: 3 x 2 x 6 numbers, the terms 1,
    X, Y, X², XY, Y² with X and Y from -1 to 1 over the picture."""
    mm_per_px: float
    """Scale of a picture of 320 x 240 pixels; other sizes show the same gel."""
    stiffness_n_mm3: float
    """Pressure a depth, newtons per cubic millimetre."""


def nominal_light() -> GelLight:
    """Return the light, scale and stiffness that a tracker takes where none is given: those fitted to one DIGIT."""
    terms, mm_per_px, stiffness_n_mm3 = _native.nominal_light()
    return GelLight(
        tuple(tuple(tuple(line) for line in colour) for colour in terms), mm_per_px, stiffness_n_mm3
    )


DEPTH_LAW: Final = 2
"""Version of the law of depth and force in crates/tega-tactile/src/live/law.rs; parameters fitted to one version do
not fit another."""
# How depth follows a gain of all the light: the sum of the exponents in crates/tega-tactile/src/live/law.rs.
_DEPTH_POWER = 17 / 16
# Of the shading alone, which is all that the light's two directions change of it.
_SHADED_POWER = 5 / 8
# A map answers to about half of what the balance of the light's two directions is changed by (simulated units).
_BALANCE = 2.0


class KnownPress(NamedTuple):
    """Contact that a tracker read of a press with independently measured force (and depth, where known)."""

    contact: TrackedContact
    force_n: float
    """Normal force, newtons, for example from a scale."""
    depth_mm: float | None = None
    """Depth of the press into the gel, millimetres, for example from a screw or a stage; ``None`` if it was not
    measured."""
    depth_map: NDArray[np.floating] | None = None
    """:meth:`TouchTracker.depth_map` after the same frame; ``None`` if it was not requested."""
    ball: bool = False
    """Whether a ball no larger than a fingertip pressed: its dent is as steep across as along, and its map shows the
    light's response in both directions."""


def calibrate_light(presses: Sequence[KnownPress], light: GelLight | None = None) -> GelLight:
    """Scale a gel's light and stiffness so that depth and force of known presses come out right on average.

    Three presses are enough: two with a ball, one with a flat, each held still, 1 to 5 N, read with ``light``; ``None``
    is :func:`nominal_light`. First the light's two directions are balanced: with r the root of the ratio of the squared
    slopes of the balls' maps, the terms across are multiplied by r and those along divided by it. Then depth gain g and
    stiffness k' are geometric means over the presses: g = mean(depth / read depth)^(16/17), k' = k mean(force / read
    force) / g, with the balance taken into account where a press has its map. Depth goes inversely with the light's
    terms (to the power 17/16), which are divided by g; force is stiffness times pressed volume. What is not known is
    unchanged.

    ``InvalidValueError`` if there are no presses, one was not felt, a force or depth is not finite and more than 0, or
    a depth map is empty.
    """
    if not presses:
        raise InvalidValueError(
            "0 presses, wanted at least 1", "press a ball twice and a flat once, 1 to 5 N"
        )
    for number, (contact, force_n, depth_mm, _, _) in enumerate(presses):
        if not (contact.in_contact and contact.force_n > 0 and contact.depth_mm > 0):
            raise InvalidValueError(f"press {number} was not felt", "press harder, or leave it out")
        for subject, value in (("force_n", force_n), ("depth_mm", depth_mm)):
            if value is not None and not 0 < value < math.inf:
                raise InvalidValueError(
                    f"press {number}: {subject} = {value}, wanted more than 0", "measure it again"
                )
    light = nominal_light() if light is None else light
    steep = [None if p.depth_map is None else _steepness(p.depth_map, k) for k, p in enumerate(presses)]
    of_balls = [one for one, press in zip(steep, presses, strict=True) if one is not None and press.ball]
    balance = math.exp(_BALANCE * _mean([math.log(x / y) for x, y in of_balls]) / 2) if of_balls else 1.0
    # What the balance makes of a depth by shading: slopes across are divided by it, those along multiplied.
    shaded = [
        1.0 if s is None else (s[0] ** 2 / balance + s[1] ** 2 * balance) / (s[0] ** 2 + s[1] ** 2)
        for s in steep
    ]
    deeper = [
        math.log(p.depth_mm / p.contact.depth_mm) - _SHADED_POWER * math.log(by)
        for p, by in zip(presses, shaded, strict=True)
        if p.depth_mm is not None
    ]
    gain = math.exp(_mean(deeper) / _DEPTH_POWER) if deeper else 1.0
    harder = math.exp(
        _mean([math.log(p.force_n / p.contact.force_n / by) for p, by in zip(presses, shaded, strict=True)])
    )
    scales = (balance / gain, 1 / (balance * gain))
    terms = tuple(
        tuple(tuple(term * by for term in axis) for axis, by in zip(colour, scales, strict=True))
        for colour in light.terms
    )
    return GelLight(terms, light.mm_per_px, light.stiffness_n_mm3 * harder / gain)


def _mean(values: list[float]) -> float:
    return sum(values) / len(values)


def _steepness(depth_map: NDArray[np.floating], number: int) -> tuple[float, float]:
    """Return the root of the summed squared steps of a map, across and along."""
    across, along = (
        math.sqrt(sum(float(step) ** 2 for step in (after - before).flat))
        for before, after in ((depth_map[:, :-1], depth_map[:, 1:]), (depth_map[:-1], depth_map[1:]))
    )
    if not (0 < across < math.inf and 0 < along < math.inf):
        raise InvalidValueError(
            f"the depth map of press {number} is flat", "take it from the tracker that felt the press"
        )
    return across, along


def sensor_noise(
    frames: NDArray[np.uint8] | Sequence[NDArray[np.uint8]], *, order: Order = "bgr"
) -> tuple[float, float, float]:
    """Measure a camera's noise from frames of its untouched gel; about a second of them is enough.

    The noise is the variation of a cell about its own mean, the median over the cells. A stuck pixel and a lamp that
    flickers over the whole frame do not count; slow changes by video compression do.

    Args:
        frames: uint8 (N, H, W, 3), or two or more images uint8 (H, W, 3) of one size, in the order they were taken.
        order: Order of the colour bytes.

    Returns:
        Standard deviation of a cell's mean (8 x 8 pixels at 320 x 240), counts: blue, green, red whatever
        ``order`` is. At least 0.4 and at most 4 times that of a DIGIT.

    Raises:
        DtypeError: A frame is not a uint8 array.
        ShapeError: A frame is not (H, W, 3), or not of the size of the first.
        InvalidValueError: There are fewer than two frames.
    """
    blue, green, red = _native.sensor_noise(list(frames), order=order)
    return blue, green, red


class TouchTracker:
    """Follows the touch of one fingertip; one object a finger.

    At rest it learns its sensor's appearance and variation, and follows slow drift; in contact that memory is frozen.
    A contact ends when the frame is near rest again, when it falls quickly to the residual imprint of a released
    contact, or when only a trace remains. The residual imprint decays slowly and is not shown; after a second it
    becomes the new rest. A signal that fell quickly and does not decay is a light hold and is reported again. A light
    contact is graded by ``strength``. Lags are of first order and take the time between two frames into account.

    Args:
        baseline: A picture of the untouched gel, uint8 (H, W, 3); it is copied.
        rate_hz: Frames a second, 0.01 to 1000, when :meth:`update` is given no time.
        noise: The sensor's, from :func:`sensor_noise`, blue, green, red, counts; ``None`` takes that of a DIGIT.
            How much the sensor varies at rest is learned in any case.
        light: The gel's own light, scale and stiffness; ``None`` takes those fitted to one DIGIT. Depth and force
            are nominal then, and ``area_mm2``, ``centroid_mm`` and ``spread_mm`` are None.
        order: Order of the colour bytes in all images.
        outline: Area that ``eda`` counts: the dent as an eye marks it, or nearer to the touching area.
        rezero: If true, the rest is measured again a second after a release.

    Raises:
        DtypeError: The baseline is not a uint8 array.
        ShapeError: It is not (H, W, 3), is empty or too large.
        InvalidValueError: An option is out of range or not known.

    Example:
        >>> import numpy as np
        >>> gel = np.full((320, 240, 3), 90, np.uint8)
        >>> tracker = TouchTracker(gel, rate_hz=60.0)
        >>> tracker.update(gel).in_contact
        False
        >>> pressed = gel.copy()
        >>> pressed[100:160, 80:140] += 40
        >>> tracker.update(pressed), tracker.update(pressed).in_contact  # doctest: +ELLIPSIS
        (TrackedContact(in_contact=True, eda=..., ...), True)
    """

    def __init__(
        self,
        baseline: NDArray[np.uint8],
        *,
        rate_hz: float = 60.0,
        noise: Sequence[float] | None = None,
        light: GelLight | None = None,
        order: Order = "bgr",
        outline: Outline = "dent",
        rezero: bool = True,
    ) -> None:
        self._tracker = _native.TouchTracker(
            baseline, rate_hz=rate_hz, noise=noise, light=light, order=order, outline=outline, rezero=rezero
        )

    @property
    def bears_load(self) -> bool:
        """Whether the last frame showed a contact that has not just fallen; passed on to the other fingers."""
        return self._tracker.bears_load

    @property
    def banding(self) -> float:
        """Amplitude of the bands that lamps on mains make at rest, as a share of the light; 0 where there are none."""
        return self._tracker.banding

    def rezero(self) -> bool:
        """Take the last picture for that of the untouched gel, however it differs from the baseline.

        Whatever touches then is not felt until it moves: ask for it only while nothing does. Returns whether it was
        taken: a dark picture is none, and before the first one the baseline stays.
        """
        return self._tracker.rezero()

    def update(
        self, frame: NDArray[np.uint8], *, dt_s: float | None = None, loaded: bool = False
    ) -> TrackedContact:
        """Read the next frame.

        Args:
            frame: The image, uint8 of the baseline's shape, borrowed.
            dt_s: Time since the frame before, 0 to 1e6 seconds, where it is not 1 / ``rate_hz``: frames were dropped,
                or the camera is uneven.
            loaded: If true, another finger bears a load: then a quick fall is a release only if little is left of the
                contact, and the rest is not updated.

        Raises:
            TegaError: The frame or ``dt_s`` is not as above; the tracker is as before.
        """
        return self._tracker.update(frame, dt_s=dt_s, loaded=loaded)

    def update_sums(
        self, sums: NDArray[np.int16], *, dt_s: float | None = None, loaded: bool = False
    ) -> TrackedContact:
        """Read the next frame by its sums over cells of 8 x 8 pixels; the contact is that of :meth:`update`.

        ``sums`` are int16 (3, cells), for each byte of a pixel the cells row by row; a frame of 320 x 240 has 1,200
        cells. All else is as for :meth:`update`.
        """
        return self._tracker.update_sums(sums, dt_s=dt_s, loaded=loaded)

    def mask(self) -> NDArray[np.bool_]:
        """Return the outlined pixels of the last frame, bool (H, W); their number is ``eda``."""
        return self._tracker.mask()

    def depth_map(self) -> NDArray[np.float32]:
        """Return the depth that the last frame shows, millimetres, float32 (rows, columns), one value a cell.

        The map is 0 everywhere without contact.
        """
        return self._tracker.depth_map()


def update_fingers(
    trackers: Sequence[TouchTracker], frames: Sequence[NDArray[np.uint8]], *, dt_s: float | None = None
) -> list[TrackedContact]:
    """Read the next frame of several fingers of one hand in one call that leaves the interpreter to others meanwhile.

    A finger is ``loaded`` if another one was in contact before and its frame has not just fallen. Each tracker comes
    once, with a frame of its own, as for :meth:`TouchTracker.update`.

    Raises:
        DtypeError: A frame is not a uint8 array; no tracker has taken any.
        ShapeError: A frame is not of its baseline's shape; the other fingers have taken theirs.
        InvalidValueError: There are not as many frames as trackers, or ``dt_s`` is not from 0 to 1e6.
    """
    if len(frames) != len(trackers):
        raise InvalidValueError(
            f"{len(frames)} frames for {len(trackers)} trackers", "give each tracker its own frame"
        )
    return _native.update_fingers([one._tracker for one in trackers], list(frames), dt_s=dt_s)  # noqa: SLF001
