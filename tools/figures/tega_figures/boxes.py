"""Draw block diagrams as SVG: boxes on a grid, arrows from edge to edge; no package needed."""

from __future__ import annotations

from html import escape
from typing import Final, NamedTuple

__all__ = ["Arrow", "Box", "Diagram", "svg"]

FILLS: Final = {
    "tega": "#d9e8f5",
    "person": "#fbeadb",
    "robot": "#e3e8ee",
    "other": "#ffffff",
    "safe": "#fde2e2",
}
INK, SOFT, GROUND = "#2b3440", "#4b5866", "#fbfcfd"
LINE, CHAR, PAD = 18.0, 7.3, 12.0
GAP_X, GAP_Y, TITLE = 34.0, 34.0, 46.0


class Box(NamedTuple):
    """A box in a cell of the grid.

    ``column`` is from 0 at the left, halves stand between two columns; ``row`` is from 0 at the top. The
    first line of ``text`` is bold. ``kind`` is its owner: ``tega``, ``person``, ``robot``, ``other`` or
    ``safe``.
    """

    column: float
    row: float
    text: str
    kind: str = "tega"


class Arrow(NamedTuple):
    """An arrow between two boxes, by their names; with ``both`` it has two heads."""

    start: str
    end: str
    text: str = ""
    both: bool = False


class Diagram(NamedTuple):
    """A picture of boxes and arrows.

    ``gap_x``, which arrows' labels need, and ``gap_y`` are pixels between columns and rows.
    """

    title: str
    boxes: dict[str, Box]
    arrows: tuple[Arrow, ...]
    gap_x: float = GAP_X
    gap_y: float = GAP_Y
    note: str = ""


class _Place(NamedTuple):
    x: float
    y: float
    w: float
    h: float

    @property
    def middle(self) -> tuple[float, float]:
        return self.x + self.w / 2, self.y + self.h / 2

    def edge(self, towards: tuple[float, float]) -> tuple[float, float]:
        """Return where the line from the middle to another point leaves the box."""
        (cx, cy), (tx, ty) = self.middle, towards
        dx, dy = tx - cx, ty - cy
        share = min(self.w / 2 / abs(dx) if dx else 1e9, self.h / 2 / abs(dy) if dy else 1e9)
        return cx + dx * share, cy + dy * share


def _places(diagram: Diagram) -> dict[str, _Place]:
    lines = {name: box.text.split("\n") for name, box in diagram.boxes.items()}
    width = max(max(len(line) for line in text) for text in lines.values()) * CHAR + 2 * PAD
    height = max(len(text) for text in lines.values()) * LINE + 2 * PAD
    return {
        name: _Place(
            16 + box.column * (width + diagram.gap_x),
            TITLE + box.row * (height + diagram.gap_y),
            width,
            height,
        )
        for name, box in diagram.boxes.items()
    }


def _text(x: float, y: float, message: str, *, size: int = 13, bold: bool = False, colour: str = INK) -> str:
    weight = (
        ' font-weight="600"'
        if bold
        else f' paint-order="stroke" stroke="{GROUND}" stroke-width="3"' * (size == 11)
    )
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size}" fill="{colour}"{weight} '
        f'text-anchor="middle">{escape(message)}</text>'
    )


def _arrow(arrow: Arrow, places: dict[str, _Place]) -> list[str]:
    begin, end = places[arrow.start], places[arrow.end]
    x1, y1 = begin.edge(end.middle)
    x2, y2 = end.edge(begin.middle)
    straight = min(abs(begin.middle[n] - end.middle[n]) for n in (0, 1)) < 1
    back = 0.0 if straight else 3.0
    head = ' marker-start="url(#head)"' if arrow.both else ""
    parts = [
        f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" stroke="{INK}" stroke-width="1.6" '
        f'marker-end="url(#head)"{head}/>'
    ]
    if arrow.text:
        middle_x, middle_y = (x1 + x2) / 2, (y1 + y2) / 2
        level = abs(y2 - y1) < abs(x2 - x1)
        lines = arrow.text.split("\n")
        for n, line in enumerate(lines):
            if level:
                y = middle_y - 7 - back - 14 * (len(lines) - 1 - n)
                parts.append(_text(middle_x, y, line, size=11, colour=SOFT))
            else:
                x = middle_x + 6 + len(line) * 2.9
                parts.append(
                    _text(x, middle_y + 4 + 14 * (n - (len(lines) - 1) / 2), line, size=11, colour=SOFT)
                )
    return parts


def svg(diagram: Diagram) -> str:
    """Draw a diagram; return an SVG file with a white ground, so that it can be read on a dark page."""
    places = _places(diagram)
    width = max(max(p.x + p.w for p in places.values()) + 16, len(diagram.title) * 8.4 + 32)
    height = max(p.y + p.h for p in places.values()) + (38 if diagram.note else 18)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" width="{width:.0f}" '
        f'height="{height:.0f}" font-family="Helvetica, Arial, sans-serif">',
        f"<title>{escape(diagram.title)}</title>",
        '<defs><marker id="head" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="8" markerHeight="8" '
        f'orient="auto-start-reverse"><path d="M0 0 L10 5 L0 10 z" fill="{INK}"/></marker></defs>',
        f'<rect width="{width:.0f}" height="{height:.0f}" rx="8" fill="{GROUND}"/>',
        _text(width / 2, 26, diagram.title, size=15, bold=True),
    ]
    for arrow in diagram.arrows:
        parts.extend(_arrow(arrow, places))
    for name, box in diagram.boxes.items():
        place = places[name]
        parts.append(
            f'<rect x="{place.x:.1f}" y="{place.y:.1f}" width="{place.w:.1f}" height="{place.h:.1f}" rx="8" '
            f'fill="{FILLS[box.kind]}" stroke="{INK}" stroke-width="1.2"/>'
        )
        lines = box.text.split("\n")
        top = place.y + place.h / 2 - LINE * (len(lines) - 1) / 2 + 4.5
        for n, line in enumerate(lines):
            parts.append(_text(place.middle[0], top + LINE * n, line, bold=n == 0, size=13 if n == 0 else 12))
    if diagram.note:
        parts.append(_text(width / 2, height - 14, diagram.note, size=12, colour=SOFT))
    return "\n".join([*parts, "</svg>", ""])
