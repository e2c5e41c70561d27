"""Tell which pictures of a fingertip camera can be used: new, whole, lit ones."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from tega.devices.fingertip.picture_origin import PictureOrigin
from tega.runtime.device_items import CameraCounts

if TYPE_CHECKING:
    from numpy.typing import NDArray


# Mean below which a picture is black although the lights are on.
_BLACK = 5.0
# A sensor's noise makes two pictures, or two rows, never equal; so many equal ones are a stalled source.
_STUCK = 3
_TAIL_SHARE = 16
# How light a picture is, is asked of every so many-th pixel of every so many-th row.
_SAMPLE = 16

Verdict = Literal["good", "odd_size", "duplicate", "black", "torn", "foreign"]

WORDS: Final[Mapping[Verdict, str]] = MappingProxyType(
    {
        "odd_size": "of another size",
        "duplicate": "the same again and again",
        "black": "black",
        "torn": "torn",
        "foreign": "another sensor's",
    }
)
"""What is wrong with pictures that cannot be used."""


class PictureCheck:
    """Judges pictures as they come.

    Args:
        counts: Counted up along the way.

    Attributes:
        origin: Tells whether a picture is another sensor's; ``None`` for no such check.
        foreign_shares: Of each sensor whose lines were seen, the largest share of a picture.
        newest: What the newest picture was.
    """

    def __init__(self, counts: CameraCounts) -> None:
        self._counts = counts
        self._last: NDArray[np.uint8] | None = None
        self._n_equal = 0
        self.origin: PictureOrigin | None = None
        self.foreign_shares: dict[str, float] = {}
        self.newest: Verdict = "good"

    def judge(self, image: NDArray[np.uint8]) -> Verdict:
        """Tell whether a picture can be used; the reason is counted.

        Args:
            image: uint8 (H, W, 3), rows in the order the sensor sends them. It is kept: do not change it.
        """
        self.newest = self._judged(image)
        return self.newest

    def refuse(self, verdict: Literal["odd_size", "torn"]) -> None:
        """Count a picture that cannot be judged, since it has another size or could not be decoded."""
        self._counts.received += 1
        self._counts.odd_size += verdict == "odd_size"
        self._counts.torn += verdict == "torn"
        self.newest = verdict

    def _judged(self, image: NDArray[np.uint8]) -> Verdict:
        counts, last = self._counts, self._last
        counts.received += 1
        if last is not None and image.shape != last.shape:
            counts.odd_size += 1
            return "odd_size"
        self._last = image
        if last is not None and _equal(image, last):
            counts.duplicate += 1
            self._n_equal += 1
            counts.stuck += self._n_equal == _STUCK - 1
            return "duplicate"
        self._n_equal = 0
        sample = image[::_SAMPLE, ::_SAMPLE]
        if np.add.reduce(sample, axis=None) < _BLACK * sample.size:
            counts.black += 1
            return "black"
        n_rows = max(2, len(image) // _TAIL_SHARE)
        tail = image[-n_rows:]
        if _of_one_colour(tail) or (last is not None and _equal(tail, last[-n_rows:])):
            counts.torn += 1
            return "torn"
        if self.origin is not None:
            origin = self.origin.judge(image)
            if origin.other:
                counts.foreign += 1
                self.foreign_shares[origin.other] = max(
                    origin.share, self.foreign_shares.get(origin.other, 0.0)
                )
                return "foreign"
            counts.unlike += origin.unlike
        counts.used += 1
        return "good"


def _equal(one: NDArray[np.uint8], other: NDArray[np.uint8]) -> bool:
    """Whether all pixels are equal; noise in the last row answers for nearly every picture."""
    return one[-1].tobytes() == other[-1].tobytes() and one.tobytes() == other.tobytes()


def _of_one_colour(rows: NDArray[np.uint8]) -> bool:
    """Whether all pixels are the last one; likewise."""
    colour = rows[-1, -1].tobytes()
    return all(lines.tobytes() == colour * (lines.size // len(colour)) for lines in (rows[-1], rows))
