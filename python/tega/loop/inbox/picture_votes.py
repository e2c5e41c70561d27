"""Take the vote from a fingertip whose pictures show no touch: dark ones, torn ones, the same one again and again.

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
from typing import TYPE_CHECKING

import numpy as np

from tega._native import vote_lines

if TYPE_CHECKING:
    from numpy.typing import NDArray


_DARK_SHARE = 0.6
# A line of the untouched picture with less spread, counts of 255, is of one colour by itself.
_LEAST_SPREAD = 1.0
_FEWEST = 3
_BACK_NS = 500_000_000


class PictureVotes:
    """Judges the pictures of one camera as they come.

    Args:
        baseline: The untouched picture, uint8 (H, W, 3).

    Attributes:
        fault: Why the camera has no vote now, in words; ``""`` while it has.

    Example:
        >>> lit = np.random.default_rng(1).integers(90, 110, (64, 48, 3), dtype=np.uint8)
        >>> votes = PictureVotes(lit)
        >>> [votes.take(lit // 4, k * 16_000_000) for k in range(3)], votes.fault
        ([False, False, False], 'dark: 25 % of the light of the untouched picture')
    """

    def __init__(self, baseline: NDArray[np.uint8]) -> None:
        self._light, lines = vote_lines(baseline)
        spreads = [float(np.frombuffer(line, np.uint8).std()) for line in lines]
        self._edges = [k for k, spread in enumerate(spreads) if spread >= _LEAST_SPREAD]
        self._last: list[bytes] = []
        self._bad_ns: deque[int] = deque(maxlen=_FEWEST)
        self._lost = False
        self.fault = ""

    def take(self, image: NDArray[np.uint8], t_ns: int) -> bool:
        """Judge the next picture that is not the one before it again.

        Args:
            image: uint8 (H, W, 3), of the baseline's size.
            t_ns: Its time.

        Returns:
            Whether it may be used.
        """
        said = self._wrong(image)
        if said:
            self._bad_ns.append(t_ns)
            self._lost |= len(self._bad_ns) == _FEWEST and t_ns - self._bad_ns[0] <= _BACK_NS
        elif self._lost and t_ns - self._bad_ns[-1] >= _BACK_NS:
            self._lost = False
        if said or not self._lost:
            self.fault = said if self._lost else ""
        return not (said or self._lost)

    def frozen(self) -> None:
        """Take note that the camera sends the same picture again and again; the next other one is judged anew."""
        self.fault = "frozen: it sends the same picture again and again"

    def _wrong(self, image: NDArray[np.uint8]) -> str:
        light, lines = vote_lines(image)
        now, before = [lines[k] for k in self._edges], self._last
        self._last = now
        share = light / self._light if self._light else 1.0
        if share < _DARK_SHARE:
            return f"dark: {100 * share:.0f} % of the light of the untouched picture"
        of_one_colour = any(line == line[-3:] * (len(line) // 3) for line in now)
        if of_one_colour or any(map(operator.eq, now, before)):
            return "torn: part of each picture is missing, or of the one before"
        return ""
