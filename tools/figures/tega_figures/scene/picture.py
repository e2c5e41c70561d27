"""Draw what the camera sees of a simulated lift, with the tags that were found, and the printed tags.

``python -m tega_figures.scene.picture docs/images/scene.webp docs/images/scene-tags.svg``
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from tega.runtime.opencv import load_cv2
from tega_figures.scene.bench import RenderedTrial
from tega_figures.scene.render import Film
from tega_figures.scene.trials import true_trial
from tega_scene.corners import TagFinder
from tega_scene.layout import example_layout
from tega_scene.sheets import PAGE_MM, page_svg, tag_pages
from tega_sim.plan import TrialPlan

_CUT = np.s_[0:1080, 340:1660]


def printed_tags() -> str:
    """Return the pages that ``scene tags`` prints, side by side on grey, as SVG."""
    pages = [page_svg(page) for page in tag_pages(example_layout())]
    width, height = PAGE_MM
    inner = "".join(
        page.replace(
            f'width="{width:g}mm" height="{height:g}mm"',
            f'x="{5 + k * (width + 5):g}" y="5" width="{width:g}" height="{height:g}"',
        )
        for k, page in enumerate(pages)
    )
    wide, high = 5 + len(pages) * (width + 5), height + 10
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{4 * wide:g}" height="{4 * high:g}" '
        f'viewBox="0 0 {wide:g} {high:g}"><rect width="100%" height="100%" fill="#adb5bd"/>{inner}</svg>\n'
    )


def main() -> None:
    """Write the pictures that are named."""
    Path(sys.argv[2]).write_text(printed_tags(), encoding="utf-8")
    cv2 = load_cv2("figures")
    trial = true_trial(TrialPlan(object="container", condition="haptic", seed=1))
    at_s = next(one.t_s for one in trial.events if one.kind == "lifted") - 1.0
    scene = RenderedTrial(trial, Film(), rate_hz=30, begin_s=at_s, end_s=at_s + 0.01, seed=1)
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
