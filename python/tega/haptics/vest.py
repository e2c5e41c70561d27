"""Turn contact metrics into vest intensities (Eq 7 to 9), and fill the vest's finger columns.

Per finger, CCI and EDA go through :func:`intensity` with that finger's calibrated maximum. :func:`vest_frame`
then writes CCI into the front and EDA into the back, one column a finger, from the wearer's left.

Example:
    >>> from tega import haptics
    >>> front = [haptics.intensity(cci, 0.04) for cci in (0.03, 0.0, 0.02, 0.04)]
    >>> frame = haptics.vest_frame(front, [0, 0, 50, 100], layout="x16")
    >>> frame.intensities.reshape(4, 4)
    array([[ 91,   1,  50,  99],
           [ 91,   1,  50,  99],
           [  0,   0,  50, 100],
           [  0,   0,  50, 100]], dtype=uint8)
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Final, Literal, TypeAlias, cast, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tega import _native
from tega.errors import DtypeError, InvalidValueError, ShapeError
from tega.haptics.motor_layout import SHIPPED, Mirror, find_layout, torso_svg
from tega.runtime.leading_axes import as_array, each_number, whole_array

Layout: TypeAlias = str
"""Name of a layout: one of :data:`LAYOUTS`, or of an installed package's (:mod:`tega.haptics.motor_layout`)."""

ContactType: TypeAlias = Literal["none", "focal", "broad", "mixed"]

FINGERS: Final = cast("tuple[str, str, str, str]", tuple(_native.FINGERS))
"""The fingers in the order of the columns, from the wearer's left; the hand's is :data:`tega.wire.HAND_FINGERS`."""

LAYOUTS: Final[tuple[Layout, ...]] = tuple(SHIPPED)
"""Names of the layouts that come with TEGA."""

HIGH_SHARE: Final[float] = _native.HIGH_SHARE
"""Share of the maximum from which CCI or EDA counts as high: where the vest motor is at 50 %."""

CONTACT_RULES: Final[Mapping[ContactType, str]] = MappingProxyType(
    {
        "none": "EDA is 0: no contact",
        "focal": "high CCI, low EDA: small and sharp, go carefully",
        "broad": "low CCI, high EDA: wide and gentle, tolerant",
        "mixed": "CCI and EDA both high or both low: the rule says nothing",
    }
)
"""The reading rule behind each answer of :func:`contact_type`, for display."""


Law: TypeAlias = Literal["logistic", "linear"]


@overload
def intensity(value: float, maximum: float, *, end_value: float = 0.01, law: Law = "logistic") -> float: ...
@overload
def intensity(
    value: ArrayLike, maximum: ArrayLike, *, end_value: float = 0.01, law: Law = "logistic"
) -> NDArray[np.float64]: ...
def intensity(
    value: ArrayLike, maximum: ArrayLike, *, end_value: float = 0.01, law: Law = "logistic"
) -> float | NDArray[np.float64]:
    """Return the motor intensity in percent for a metric's value (Eq 7 to 9).

    The logistic law is ``100 / (1 + exp(-k (value - maximum/2)))`` with ``k = 2 ln((1 - e)/e) / maximum``,
    ``e`` being ``end_value``: the printed ``2 ln 99 / maximum``. It gives exactly 1, 50 and 99 at 0, half of the
    maximum and the maximum, and never decreases with ``value``; the relative error is below 3e-15 above 1e-290.

    Args:
        value: The metric, in its own unit; any finite number, or an array of them.
        maximum: The finger's calibrated maximum, same unit; finite and above 0. Arrays are broadcast; the result is
            float64 of their common shape then.
        end_value: Share of full intensity at value 0, above 0 and below 0.5.
        law: ``"logistic"`` as printed, or ``"linear"``: 100 · value/maximum held within 0 to 100.

    Raises:
        DtypeError: An array does not hold real numbers.
        InvalidValueError: An argument is not finite or out of its range, or the law is not known.

    Example:
        >>> round(intensity(0.5, 2.0), 6)
        9.132525
        >>> intensity([0.0, 1.0, 2.0], 2.0)
        array([ 1., 50., 99.])
    """
    if law not in {"logistic", "linear"}:
        raise InvalidValueError(f"law = {law!r} is not known: choose 'logistic' or 'linear'")
    function: Callable[[float, float], float] = _native.linear_intensity
    if law == "logistic":
        function = partial(_native.logistic_intensity, end_value=end_value)
    numbers = type(value) is float and type(maximum) is float  # at first sight: nearly always they are
    if numbers or not (
        isinstance(value, (np.ndarray, Sequence)) or isinstance(maximum, (np.ndarray, Sequence))
    ):
        return function(cast("float", value), cast("float", maximum))
    return each_number(function, value, maximum, dtype=np.float64)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class MotorLevels:
    """Intensities of one layout's motors at one moment.

    Attributes:
        layout: ``"paper32"`` (rows 0 to 3 of each face), ``"x40"``, ``"x16"``, or the name of an installed one.
        intensities: uint8, (n,), percent, in the order of the layout's table: with the three, front row by row from
            the top, each row from the wearer's left, then the back in the same order. Made by :func:`vest_frame` it
            is read-only.

    Raises:
        DtypeError: ``intensities`` is not a uint8 array.
        ShapeError: Its size is not the layout's.
        InvalidValueError: The layout is not known, or an intensity is masked or above 100.
    """

    layout: Layout
    intensities: NDArray[np.uint8]

    def __post_init__(self) -> None:
        """Refuse frames that no vest could show."""
        if getattr(self.intensities, "dtype", None) != np.uint8:
            kind = getattr(self.intensities, "dtype", f"a {type(self.intensities).__name__}")
            raise DtypeError(f"intensities is {kind}, not an array of uint8")
        whole_array("intensities", self.intensities)
        if self.intensities.ndim != 1:
            raise ShapeError(f"intensities has shape {self.intensities.shape}, not one dimension")
        n, wanted = len(self.intensities), len(find_layout(self.layout).motors)
        if n != wanted:
            raise ShapeError(f"intensities has {n} motors, layout {self.layout} has {wanted}")
        worst = int(self.intensities.argmax())
        if self.intensities[worst] > 100:
            subject = f"intensities[{worst}] = {self.intensities[worst]} percent"
            raise InvalidValueError(f"{subject} is out of range: 0 to 100")

    def __eq__(self, other: object) -> bool:
        """Compare layout and every motor."""
        if not isinstance(other, MotorLevels):
            return NotImplemented
        return self.layout == other.layout and self.intensities.tobytes() == other.intensities.tobytes()

    def __repr__(self) -> str:
        """Layout, and how many motors vibrate how hard."""
        on = self.intensities[self.intensities > 0]
        most = f", at most {on.max()} %" if on.size else ""
        return f"MotorLevels({self.layout!r}, {on.size} of {self.intensities.size} motors on{most})"

    def _repr_html_(self) -> str:
        return torso_svg(self.layout, self.intensities.tolist())

    def __hash__(self) -> int:
        """Hash of layout and motors."""
        return hash((self.layout, self.intensities.tobytes()))

    @property
    def motors(self) -> NDArray[np.uint8]:
        """Index of each motor in the vendor's numbering, uint8 (n,), read-only.

        The front of a 40-motor vest is 0 to 19 and the back 20 to 39, each ``4 * row + column``. A 16-motor vest is
        addressed through the rows 0 and 2.
        """
        return find_layout(self.layout).numbers

    @property
    def levels(self) -> NDArray[np.uint8]:
        """Step of each motor, uint8 (n,), 0 to 15: the four bits that reach it, ``(15 * percent + 50) // 100``."""
        return _native.motor_steps(self.intensities)

    def x40(self) -> NDArray[np.uint8]:
        """Return the frame of a 40-motor vest, uint8 (40,), percent, in wearer order (front, then back).

        ``paper32`` leaves the bottom row of each face at 0. ``x16`` writes its upper motors into rows 0 and 1
        and its lower ones into rows 2 to 4: the rows a 16-motor vest combines into each. Of another layout each
        motor is at its number.
        """
        if self.layout not in SHIPPED:
            all_motors = np.zeros(40, np.uint8)
            all_motors[self.motors] = self.intensities
            return all_motors
        return _native.vest_x40(self.layout, self.intensities)


def vest_frame(
    front: Iterable[float],
    back: Iterable[float],
    *,
    layout: Layout = "paper32",
    mirror: Mirror = "none",
) -> MotorLevels:
    """Fill the finger columns of both faces.

    Every row of a column shows the same value. Numbers are rounded half to even and held within 0 to 100.

    Args:
        front: Thumb, index, middle, ring in percent (CCI in the paper).
        back: The same fingers in percent (EDA in the paper).
        layout: ``"paper32"``: 4 × 4 on each face; ``"x40"``: the fifth row repeats the fourth; ``"x16"``: two rows;
            or the name of an installed layout, in which columns beyond the fourth rest.
        mirror: ``"none"``: thumb at the wearer's left on both faces; ``"back"``: the back reversed;
            ``"all"``: both reversed, as for a left hand.

    Raises:
        ShapeError: A face has not four numbers.
        DtypeError: A face holds something that is not a number.
        InvalidValueError: A number is not finite, or layout or mirror is not known.

    Example:
        >>> vest_frame([80, 60, 40, 20], [10, 0, 100, 55]).levels[:4]
        array([12,  9,  6,  3], dtype=uint8)
    """
    faces = _four("front", front), _four("back", back)
    fill = _native.vest_intensities if layout in SHIPPED else vest_intensities
    return MotorLevels(layout, _read_only(fill(*faces, layout=layout, mirror=mirror)))


def vest_intensities(
    front: ArrayLike, back: ArrayLike, *, layout: Layout = "paper32", mirror: Mirror = "none"
) -> NDArray[np.uint8]:
    """Fill the finger columns as :func:`vest_frame` does, for any number of moments.

    The faces are (..., 4), with leading axes that are broadcast; the result is uint8 (..., motors), percent: along
    the last axis the intensities of :func:`vest_frame`, whose options and errors are these.

    Example:
        >>> vest_intensities([[80, 60, 40, 20], [0, 0, 0, 100]], [0] * 4)[:, :4]
        array([[ 80,  60,  40,  20],
               [  0,   0,   0, 100]], dtype=uint8)
    """
    try:
        faces = [np.asarray(as_array(face), np.float64) for face in (front, back)]
        shape = np.broadcast_shapes(*(face.shape for face in faces))
    except (TypeError, ValueError) as error:
        raise (ShapeError if "broadcast" in str(error) else DtypeError)(f"front and back: {error}") from error
    if any(face.shape[-1:] != (4,) for face in faces):
        hint = "give thumb, index, middle and ring along the last axis"
        raise ShapeError(f"front has shape {faces[0].shape}, back {faces[1].shape}, not (..., 4)", hint)
    # The four columns of each face, then what rests.
    columns = [*(np.broadcast_to(face, shape) for face in faces), np.zeros((*shape[:-1], 1))]
    places = [
        8 if m.column >= 4 else m.column + 4 * (m.face == "back")
        for m in find_layout(layout).mirrored(mirror).motors
    ]
    displayed = np.concatenate(columns, axis=-1)[..., places]
    return _native.vest_percents(np.ascontiguousarray(displayed.ravel())).reshape(displayed.shape)


class FeltMap:
    """Equalizes one person's perception of all motors.

    Every motor has a threshold, the lowest intensity that is felt there, and a step, the smallest increase that is
    noticed. An intensity of i percent becomes

    ``threshold + i/100 · n · step``, with ``n`` the least ``(100 − threshold) / step`` of all motors:

    the same number of noticeable steps above the threshold at every motor. 0 stays exactly 0. A step is taken to be as
    large everywhere between the threshold and 100 as where it was measured. Results are rounded half to even.

    Args:
        threshold: Percent, 0 to 99: one number for all motors, or one for each of 40 in the wearer's order; kept as
            float64 (40,), read-only.
        step: Likewise, above 0 to 100.

    Raises:
        InvalidValueError: A number is out of its range or not finite.
        ShapeError: There are neither 1 nor 40 of them.

    Example:
        >>> FeltMap(threshold=20).apply(vest_frame([0, 1, 50, 100], [0] * 4)).intensities[:4]
        array([  0,  21,  60, 100], dtype=uint8)
    """

    def __init__(
        self, *, threshold: float | Iterable[float] = 0.0, step: float | Iterable[float] = 1.0
    ) -> None:
        thresholds = _per_motor("threshold", threshold, 0.0, 99.0)
        steps = _per_motor("step", step, 0.0, 100.0)
        if not steps.all():
            raise InvalidValueError("step = 0 is out of range: above 0 to 100 percent")
        n_steps = float(np.min((100.0 - thresholds) / steps))
        self.threshold, self.step = thresholds, steps
        shares = np.arange(101)[:, np.newaxis] / 100.0
        table = np.clip(np.rint(thresholds + shares * n_steps * steps), 0, 100).astype(np.uint8)
        table[0] = 0
        self._table: NDArray[np.uint8] = table

    def apply(self, frame: MotorLevels) -> MotorLevels:
        """Return the frame that is felt evenly; its intensities are read-only."""
        return MotorLevels(frame.layout, _read_only(self._table[frame.intensities, frame.motors]))


def _per_motor(name: str, values: float | Iterable[float], least: float, most: float) -> NDArray[np.float64]:
    try:
        numbers = np.asarray(list(values) if isinstance(values, Iterator) else as_array(values), np.float64)  # type: ignore[arg-type]
    except (TypeError, ValueError) as error:
        raise DtypeError(f"{name} = {values!r} is not in percent: {error}") from error
    if numbers.shape not in {(), (40,)}:
        raise ShapeError(f"{name} has shape {numbers.shape}", "give one number, or one for each of 40 motors")
    if not bool(np.all((numbers >= least) & (numbers <= most))):
        raise InvalidValueError(f"{name} = {values!r} is out of range: {least:g} to {most:g} percent")
    return np.broadcast_to(numbers, (40,))


def contact_type(cci_norm: float, eda_norm: float) -> ContactType:
    """Name a contact by the paper's reading rule.

    High is :data:`HIGH_SHARE` of the maximum or more. High CCI with low EDA is ``"focal"``, low CCI with high EDA is
    ``"broad"``, both high or both low is ``"mixed"``, EDA = 0 is ``"none"``. Both are shares of the finger's maximum,
    0 or more, else ``InvalidValueError``.

    Example:
        >>> contact_type(0.9, 0.2)
        'focal'
    """
    return cast("ContactType", _native.contact_type(cci_norm, eda_norm))


def _four(face: str, values: Iterable[float]) -> tuple[float, float, float, float]:
    try:
        numbers = [float(value) for value in values]
    except (TypeError, ValueError) as error:
        raise DtypeError(f"{face} = {values!r} is not four numbers: {error}") from error
    if len(numbers) != 4:
        hint = "give thumb, index, middle and ring; 0 for a finger that is not there"
        raise ShapeError(f"{face} has {len(numbers)} numbers, not 4", hint)
    return numbers[0], numbers[1], numbers[2], numbers[3]


def _read_only(array: NDArray[np.uint8]) -> NDArray[np.uint8]:
    array.flags.writeable = False
    return array
