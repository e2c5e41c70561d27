"""Measure the quality of recorded pictures: bytes and time against what a reading of the decoded one misses."""

from __future__ import annotations

from functools import partial
from typing import Any, Final

import numpy as np

from tega.tactile import ContactReader, contact_mask
from tega_figures.bench.timing import take_turns, timing
from tega_figures.pareto.drawing import Choice, PricedVariant
from tega_sim.gel import Gel, ball, board

__all__ = ["jpeg_quality"]

DEFAULT: Final = 95
QUALITIES: Final = (50, 70, 80, 90, 95, 98, 100)
PRESSES: Final = (
    *((force_n, at) for force_n in (0.3, 1.0, 3.0, 8.0) for at in ((119.5, 159.5), (70.0, 220.0))),
    (4.0, None),
    (0.0, (119.5, 159.5)),
)


def jpeg_quality(*, budget_s: float) -> Choice:
    """Measure every quality, and PNG, which loses nothing."""
    import cv2

    pictures: list[tuple[Any, Any]] = []
    for seed in (1, 2, 3):
        gel = Gel(seed)
        still = gel.still()
        for n, (force_n, at) in enumerate(PRESSES):
            shape = board(force_n=force_n) if at is None else ball(force_n=force_n, centre_xy=at)
            pictures.append((still, gel.frame([shape], n)))
    ways: dict[str, list[Any]] = {
        f"quality {quality}": [".jpg", [cv2.IMWRITE_JPEG_QUALITY, quality]] for quality in QUALITIES
    }
    ways["lossless (PNG)"] = [".png", [cv2.IMWRITE_PNG_COMPRESSION, 1]]
    timed = pictures[2][1]
    turns = take_turns(
        {name: partial(cv2.imencode, kind, timed, how) for name, (kind, how) in ways.items()},
        budget_s=budget_s,
    )
    variants = []
    for name, (kind, how) in ways.items():
        sizes, missed, peaks, wrong, pixels = [], [], [], 0, []
        for still, image in pictures:
            data = cv2.imencode(kind, image, how)[1]
            back = np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), np.uint8)
            reader = ContactReader(still)
            reported, mask = reader.read(image), contact_mask(image, still)
            other, other_mask = reader.read(back), contact_mask(back, still)
            sizes.append(len(data) / 1000)
            pixels.append(float(np.sqrt(np.mean((back.astype(float) - image) ** 2))))
            wrong += reported.in_contact != other.in_contact
            if reported.in_contact and other.in_contact:
                both, either = np.sum(mask & other_mask), np.sum(mask | other_mask)
                missed.append(100 * (1 - both / either) if either else 0.0)
                peaks.append(100 * abs(other.peak / reported.peak - 1))
        variants.append(
            PricedVariant(
                name=name,
                cost=float(np.mean(sizes)),
                error=float(np.mean(missed)),
                beside={
                    "peak off, %": float(np.mean(peaks)),
                    "judged otherwise, of 30": float(wrong),
                    "pixels off, counts": float(np.mean(pixels)),
                    "ms to encode": timing(turns[name]).median_us / 1000,
                },
                default=name == f"quality {DEFAULT}",
            )
        )
    return Choice(
        title="Recording: quality of the pictures",
        setting="`record.jpeg_quality`, `record.lossless`",
        cost="kB a picture",
        error="contact's outline that differs, %",
        how=(
            "Thirty simulated pictures of three gels: a ball at two places with 0.3 to 8 N, a board, "
            "and nothing. Each is encoded, decoded and read by "
            "`live` against the same still picture; the outline's error is 1 less the overlap of the "
            "two masks."
        ),
        why=(
            "95 moves the outline by half a percent at a ninth of the bytes of a lossless picture, "
            "and pixels by less than the qualities under it. "
            "100 takes three times the bytes of 95. To read the pictures again to the last count, set "
            "`lossless`."
        ),
        variants=variants,
    )
