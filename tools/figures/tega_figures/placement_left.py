"""Draw where electrodes and motors go for a left hand, from the drawings for a right one.

``python -m tega_figures.placement_left docs/images`` reads ``placement-emg.svg`` and ``placement-vest.svg`` and writes
``placement-emg-left.svg`` and ``placement-vest-left.svg``: the arm is mirrored and its words are not; of the vest the
columns change their fingers, and motors and numbers stay.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from tega.ui.view.figures import FINGER_COLOURS

_ANCHORS = {"start": "end", "end": "start", "middle": "middle"}
_COLUMNS = dict(zip(FINGER_COLOURS.values(), reversed(FINGER_COLOURS.values()), strict=True))


def left_arm(right: str) -> str:
    """Return the SVG drawing of a left forearm from that of a right one."""
    width = re.search(r'viewBox="0 0 (\d+) ', right)
    assert width is not None, "a drawing begins at 0 0"

    def word(found: re.Match[str]) -> str:
        x, rest = found[1], found[2]
        anchor = re.search(r' text-anchor="(\w+)"', rest)
        turned = _ANCHORS[anchor[1] if anchor else "start"]
        rest = re.sub(r' text-anchor="\w+"', "", rest)
        back = f"translate({2 * int(x)} 0) scale(-1 1)"
        return f'<text x="{x}" transform="{back}" text-anchor="{turned}"{rest}>'

    head, body, tail = re.split(r"(?<=</title>\n)|(?=</svg>)", right)
    body = re.sub(r'<text x="(\d+)"([^>]*)>', word, body)
    body = body.replace("A right arm that hangs down;", "A left arm that hangs down.")
    body = re.sub(r".*for a left one mirror the drawing.*\n", "", body)
    mirrored = f'  <g transform="translate({width[1]} 0) scale(-1 1)">\n{body}  </g>\n'
    return head.replace("a right forearm", "a left forearm") + mirrored + tail


def left_vest(right: str) -> str:
    """Return the SVG drawing of a vest with the thumb's column at the wearer's right from a right hand's."""
    columns, legend = right.split('<g text-anchor="middle" font-size="13">')
    turned = re.sub("|".join(_COLUMNS), lambda found: _COLUMNS[found[0]], columns)
    return turned + '<g text-anchor="middle" font-size="13">' + legend


def main(folder: Path) -> None:
    """Write both drawings beside those that they are made from."""
    for name, turn, made in (
        ("placement-emg.svg", left_arm, "placement-emg-left.svg"),
        ("placement-vest.svg", left_vest, "placement-vest-left.svg"),
    ):
        drawn = turn((folder / name).read_text(encoding="utf-8"))
        (folder / made).write_text(drawn, encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
