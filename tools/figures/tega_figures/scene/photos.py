"""Measure public photographs of tags against the corners that AprilTag's own library finds in them.

``python -m tega_figures.scene.photos FOLDER`` reads ``*.jpg`` with ``*.txt`` beside them: a line a tag, its number and
four corners, with the middle of the first pixel at 0.5, as in ``test/data`` of github.com/AprilRobotics/apriltag. Those
corners are another detector's, not the truth. Nothing of it is kept in this repository.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Final

import numpy as np

from tega.runtime.opencv import load_cv2
from tega_scene.corners import TagFinder

_SAME_PX: Final = 4.0


def main() -> None:
    """Print how many tags are read and refined, and how far their corners are from the other detector's."""
    cv2 = load_cv2("figures")
    finder = TagFinder("apriltag-36h11", frozenset(range(587)))
    n_there = n_read = 0
    off_px: list[float] = []
    for photo in sorted(Path(sys.argv[1]).glob("*.jpg")):
        grey = cv2.imread(str(photo), cv2.IMREAD_GRAYSCALE)
        candidates = finder.candidates(grey)
        for line in photo.with_suffix(".txt").read_text().splitlines():
            number, *places = (float(one) for one in re.findall(r"-?[\d.]+", line))
            there = np.array(places).reshape(4, 2) - 0.5
            n_there += 1
            near = [
                corners
                for tag, corners in candidates
                if tag == number and np.hypot(*(corners.mean(0) - there.mean(0))) < _SAME_PX
            ]
            if not near:
                continue
            n_read += 1
            if (refined := finder.refined(grey, near[0])) is not None:
                turns = [np.roll(order, k, axis=0) for order in (there, there[::-1]) for k in range(4)]
                off_px.append(min(float(np.hypot(*(turn - refined).T).mean()) for turn in turns))
    sys.stdout.write(
        f"{n_there} tags, {n_read} read, {len(off_px)} refined; corners {np.median(off_px):.2f} px from the other "
        f"detector's in the middle, {np.percentile(off_px, 90):.2f} px in nine of ten\n"
    )


if __name__ == "__main__":
    main()
