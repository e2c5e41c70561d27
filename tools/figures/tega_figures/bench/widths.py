"""The kernels at every width, over the least that reads both images: upright, lying, and with rows apart in memory."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.tactile.tracker import TouchTracker
from tega_figures.bench.peers import contact_peers
from tega_figures.bench.scenes import scenes, untouched
from tega_figures.bench.timing import ratio, take_turns
from tega_figures.bench.variants import NUMPY_FLOOR, Law, floor_kernels, law_kernel

__all__ = ["WIDTHS", "WidthRow", "width_rows"]

# The least, a DIGIT's two sides, the most, and widths that are no multiple of 32, 16 or 8 pixels.
WIDTHS = (100, 117, 160, 201, 240, 270, 320, 333, 400, 482, 555, 640, 720)
LAWS = {
    "rectified": Law("rectified", "spatial"),
    "signed": Law("signed", "spatial"),
    "intensity": Law("rectified", "intensity"),
}
TRACKED = ("live, at rest", "live, touched")
# Pixels between the end of a row and the next in memory.
APART = 8


class WidthRow(msgspec.Struct, frozen=True, kw_only=True):
    """The kernels at one size of picture.

    Attributes:
        size: Height and width.
        strided: Whether rows lie apart in memory, as in a part of a larger picture.
        to_floor: A call's time over NumPy's or-reduce of both images, by law; of `live` the tracker at rest and
            touched.
        peer_to_ours: Time of OpenCV's fastest form over ours, by law.
    """

    size: tuple[int, int]
    strided: bool
    to_floor: dict[str, float]
    peer_to_ours: dict[str, float]


def width_rows(*, budget_s: float) -> list[WidthRow]:
    """Measure every width upright, lying, and upright with rows apart; ``budget_s`` is for each."""
    rows = []
    for width in WIDTHS:
        upright, lying = (width * 4 // 3, width), (width * 3 // 4, width)
        rows += [
            _row(size, strided=strided, budget_s=budget_s)
            for size, strided in ((upright, False), (lying, False), (upright, True))
        ]
    return rows


def _row(size: tuple[int, int], *, strided: bool, budget_s: float) -> WidthRow:
    scene = scenes(size)[1]
    place = _apart if strided else np.ascontiguousarray
    images = place(scene.frame), place(scene.baseline)
    calls: dict[str, Callable[[], object]] = {NUMPY_FLOOR: floor_kernels(scene)[NUMPY_FLOOR]}
    peers: dict[str, list[str]] = {}
    for name, law in LAWS.items():
        calls[name] = partial(law_kernel(law), *images)
        others = {
            f"{name}, {n}": one for n, one in contact_peers(law, size).items() if n.startswith("OpenCV")
        }
        peers[name] = list(others)
        calls |= {n: partial(one, *images) for n, one in others.items()}
    calls["live, at rest"] = partial(TouchTracker(images[1]).update, place(untouched(size)))
    calls["live, touched"] = partial(TouchTracker(images[1]).update, images[0])
    turns = take_turns(calls, budget_s=budget_s)
    return WidthRow(
        size=size,
        strided=strided,
        to_floor={n: ratio(turns[n], turns[NUMPY_FLOOR]) for n in (*LAWS, *TRACKED)},
        peer_to_ours={
            n: min(ratio(turns[p], turns[n]) for p in others) for n, others in peers.items() if others
        },
    )


def _apart(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    height, width, _ = image.shape
    part = np.zeros((height, width + APART, 3), np.uint8)[:, :width]
    part[:] = image
    return part
