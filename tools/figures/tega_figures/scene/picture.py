"""Draw what the camera sees of a simulated lift, with the tags that were found: ``scene.webp`` of the docs."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from tega.opencv import load_cv2
from tega.scene.corners import TagFinder
from tega.sim.plan import TrialPlan
from tega_figures.scene.bench import RenderedTrial
from tega_figures.scene.render import Film
from tega_figures.scene.trials import true_trial

_CUT = np.s_[0:1080, 340:1660]


def main() -> None:
    """Write the picture that is named."""
    cv2 = load_cv2("figures")
    trial = true_trial(TrialPlan(object="container", condition="haptic", seed=1))
    at_s = next(one.t_s for one in trial.events if one.kind == "lifted") - 1.0
    scene = RenderedTrial(trial, Film(), rate_hz=30, begin_s=at_s, end_s=at_s + 0.01, seed=1, lost=0.0)
    _, image = next(iter(scene.pictures()))
    colour = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)
    wanted = frozenset(tag.id for body in scene.layout.bodies().values() for tag in body.all_tags())
    for number, corners in TagFinder(scene.layout.family, wanted).find(image).items():
        places = np.rint(corners * 16).astype(np.int32)
        cv2.polylines(colour, [places], True, (115, 158, 0), 3, cv2.LINE_AA, 4)  # noqa: FBT003  # OpenCV's
        x, y = corners[corners[:, 1].argmin()].astype(int).tolist()  # above the tag, not on it
        cv2.putText(
            colour,
            str(number),
            (x - 8, y - 12),
            cv2.FONT_HERSHEY_SIMPLEX,
            0.7,
            (233, 180, 86),
            2,
            cv2.LINE_AA,
        )
    small = cv2.resize(colour[_CUT], None, fx=0.7, fy=0.7, interpolation=cv2.INTER_AREA)
    Path(sys.argv[1]).write_bytes(cv2.imencode(".webp", small, [cv2.IMWRITE_WEBP_QUALITY, 80])[1].tobytes())


if __name__ == "__main__":
    main()
