"""Take the vote from a fingertip with frames that cannot show touch: dark, torn or repeated ones.

The check is causal and a function of pictures and their times alone, so that a replay takes the same votes. It concerns
live cameras of every driver; one that refuses such pictures itself never passes them on.

=======  ===============================================================  ========================================
fault    rule                                                             why there
=======  ===============================================================  ========================================
dark     less than 0.6 of the light of the untouched picture              presses leave 0.89 and more (recordings)
torn     the line a sixteenth from an edge is of one colour, or equals    noise makes no two such lines equal
         that of the picture before
frozen   the third picture in a row with exactly these pixels             likewise
=======  ===============================================================  ========================================

A single dark or torn picture is left out and no more. With the third within half a second the camera has no vote, until
half a second has passed without one. A frozen one has it back with the first picture that differs.
"""

from __future__ import annotations

import operator
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega._native import vote_lines
from tega.records import Contact

_DARK_SHARE = 0.6
# A line of the untouched picture with less spread, counts of 255, is of one colour by itself.
_LEAST_SPREAD = 1.0
_FEWEST = 3
_BACK_NS = 500_000_000


class Untouched(NamedTuple):
    """Light and lines of an untouched picture; ``edges`` index edge lines not of one colour by themselves."""

    light: float
    edges: tuple[int, ...]


def untouched_lines(baseline: NDArray[np.uint8]) -> Untouched:
    """Return the reference that a camera's frames are compared with; the baseline is uint8 (H, W, 3)."""
    light, lines = vote_lines(baseline)
    spreads = [float(np.frombuffer(line, np.uint8).std()) for line in lines]
    return Untouched(light, tuple(k for k, spread in enumerate(spreads) if spread >= _LEAST_SPREAD))


def picture_fault(
    image: NDArray[np.uint8], untouched: Untouched, before: Sequence[bytes]
) -> tuple[str, list[bytes]]:
    """Return the fault of a picture, ``""`` for none, and its edge lines; ``before`` are those of the one before it."""
    light, lines = vote_lines(image)
    now = [lines[k] for k in untouched.edges]
    share = light / untouched.light if untouched.light else 1.0
    if share < _DARK_SHARE:
        return f"dark: {100 * share:.0f} % of the light of the untouched picture", now
    of_one_colour = any(line == line[-3:] * (len(line) // 3) for line in now)
    if of_one_colour or any(map(operator.eq, now, before)):
        return "torn: part of each picture is missing, or of the one before", now
    return "", now


class CameraVote:
    """Vote of one camera, by the faults of its pictures.

    Attributes:
        fault: Reason why the camera has no vote now; ``""`` while it has one.

    Example:
        >>> vote = CameraVote()
        >>> [vote.take("dark", k * 16_000_000) for k in range(3)], vote.fault
        ([False, False, False], 'dark')
    """

    def __init__(self) -> None:
        self._bad_ns: deque[int] = deque(maxlen=_FEWEST)
        self._lost = False
        self.fault = ""

    def take(self, fault: str, t_ns: int) -> bool:
        """Count the next picture, with its fault in words or ``""``; return whether it may be used."""
        if fault:
            self._bad_ns.append(t_ns)
            self._lost |= len(self._bad_ns) == _FEWEST and t_ns - self._bad_ns[0] <= _BACK_NS
        elif self._lost and t_ns - self._bad_ns[-1] >= _BACK_NS:
            self._lost = False
        if fault or not self._lost:
            self.fault = fault if self._lost else ""
        return not (fault or self._lost)

    def frozen(self) -> None:
        """Note that the camera sends the same picture again and again; the next other one is judged by itself."""
        self.fault = "frozen: it sends the same picture again and again"


# So many equal pictures in a row, the first included, and a live sensor is called stuck. Two may come of a camera
# that is read faster than it exposes.
STUCK_FRAMES = 3

# A grid of pixels this far apart distinguishes two noisy pictures at a thousandth of the cost of all of them.
_SAMPLE_STRIDE = 40


class KeptPicture(NamedTuple):
    """The newest measured picture, uint8 (H, W, 3), and a copy of some pixels: a driver may reuse one buffer."""

    image: NDArray[np.uint8]
    sample: bytes
    contact: Contact


def kept_picture(image: NDArray[np.uint8], contact: Contact) -> KeptPicture:
    """Return a measured picture, to be compared with the next one."""
    return KeptPicture(image, _sample(image), contact)


def is_repeat(image: NDArray[np.uint8], last: KeptPicture) -> bool:
    """Return whether every pixel of a picture, uint8 (H, W, 3), equals the newest one's.

    Noise makes nearly all pictures differ in the sample; only where that agrees is every pixel compared.
    """
    if image.shape != last.image.shape:
        return False
    if image is last.image and image.base is None and not image.flags.writeable:  # constant
        return True
    return _sample(image) == last.sample and image.tobytes() == last.image.tobytes()


def _sample(image: NDArray[np.uint8]) -> bytes:
    return image[::_SAMPLE_STRIDE, ::_SAMPLE_STRIDE].tobytes()
