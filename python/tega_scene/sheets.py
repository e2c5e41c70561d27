"""Print tags and the ChArUco board to scale: A4 pages as SVG or PDF, in millimetres."""

from __future__ import annotations

from pathlib import Path
from typing import Final, NamedTuple
from xml.sax.saxutils import escape

import numpy as np

from tega.errors import InvalidValueError
from tega.runtime.files.whole_file import write_whole
from tega.runtime.opencv import load_cv2
from tega_scene.corners import tag_dictionary
from tega_scene.layout import Family, PlacedTag, TagLayout
from tega_scene.lens import board_size_mm, charuco_board

PAGE_MM: Final = (210.0, 297.0)

_EDGE_MM, _GAP_MM, _HEAD_MM, _LABEL_MM = 15.0, 6.0, 20.0, 5.0
_POINTS_PER_MM: Final = 72 / 25.4
_CUT_MM: Final = 0.1


class PrintedRect(NamedTuple):
    """A filled rectangle; ``x`` and ``y`` are millimetres from the page's upper left corner."""

    x: float
    y: float
    width: float
    height: float


class PrintedPage(NamedTuple):
    """A page: black rectangles, and lines of text with their left and baseline in millimetres."""

    ink: list[PrintedRect]
    words: list[tuple[float, float, str]]


def modules_mm(
    bits: np.ndarray[tuple[int, int], np.dtype[np.bool_]], x: float, y: float, pitch: float
) -> list[PrintedRect]:
    """Return the dark squares of a pattern, joined along rows.

    ``bits`` is bool (n, n), dark where true; ``x``, ``y`` and ``pitch``, a square's side, are millimetres.
    """
    found = []
    for row, line in enumerate(bits):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], line.astype(np.int8), [0]])))
        for begin, end in edges.reshape(-1, 2).tolist():
            found.append(PrintedRect(x + begin * pitch, y + row * pitch, (end - begin) * pitch, pitch))
    return found


def _tag_ink(
    tag: PlacedTag, family: Family, x: float, y: float, *, quarter_turns: int = 0
) -> list[PrintedRect]:
    dictionary = tag_dictionary(family)
    n = dictionary.markerSize + 2
    dark = load_cv2("scene").aruco.generateImageMarker(dictionary, tag.id, n) < 128
    return modules_mm(np.rot90(dark, quarter_turns), x, y, tag.size_mm / n)


def _headed(title: str) -> PrintedPage:
    """Return an empty page with its title and a line of 100 mm to measure."""
    bar = [
        PrintedRect(_EDGE_MM, 12.0, 100.0, 0.4),
        PrintedRect(_EDGE_MM, 10.0, 0.4, 4.4),
        PrintedRect(_EDGE_MM + 99.6, 10.0, 0.4, 4.4),
    ]
    reported = "From mark to mark 100.0 mm: print at 100 %, without fitting to the page, and measure."
    return PrintedPage(bar, [(_EDGE_MM, 8.0, title), (_EDGE_MM, 17.5, reported)])


def tag_pages(layout: TagLayout) -> list[PrintedPage]:
    """Return pages with all tags of a layout, each with a white margin to cut along.

    A box's tags are cut with the box's edge as side, so that the five cover it. No tag may be wider than the
    page.
    """
    pages: list[PrintedPage] = []
    x = y = row_mm = 0.0
    for name, body in layout.bodies().items():
        if name == "table" and (sheet := _table_sheet(layout)) is not None:
            pages.append(sheet)
            y = PAGE_MM[1]  # what follows begins a page of its own
            continue
        edge_mm = {tag.id: body.cube.edge_mm for tag in body.cube.tags()} if body.cube else {}
        sides = dict(zip(edge_mm, ("top", "+x", "-x", "+y", "-y"), strict=False))
        for tag in body.all_tags():
            cut = edge_mm.get(tag.id, 1.25 * tag.size_mm)
            if cut > PAGE_MM[0] - 2 * _EDGE_MM:
                raise InvalidValueError(
                    f"tag {tag.id}: {tag.size_mm:g} mm with its margin is wider than an A4 page",
                    f"at most {(PAGE_MM[0] - 2 * _EDGE_MM) / 1.25:.0f} mm",
                )
            if x + cut > PAGE_MM[0] - _EDGE_MM:
                x, y, row_mm = _EDGE_MM, y + row_mm + _LABEL_MM + _GAP_MM, 0.0
            if not pages or y + cut + _LABEL_MM > PAGE_MM[1] - _EDGE_MM:
                pages.append(_headed(f"TEGA tags, {layout.family}, page {len(pages) + 1}"))
                x, y, row_mm = _EDGE_MM, _HEAD_MM + _GAP_MM, 0.0
            page = pages[-1]
            margin = (cut - tag.size_mm) / 2
            page.ink.extend(_tag_ink(tag, layout.family, x + margin, y + margin))
            page.ink.extend(_outline(x, y, cut))
            side = f", {sides[tag.id]} of the box" if tag.id in sides else ""
            page.words.append((x, y + cut + 3.5, f"{name} {tag.id}{side}, {tag.size_mm:g} mm"))
            x, row_mm = x + cut + _GAP_MM, max(row_mm, cut)
    return pages


def _table_sheet(layout: TagLayout) -> PrintedPage | None:
    """Return the page with the table's tags where they belong, and the mark; ``None`` where they take more than A4."""
    tags = layout.table.all_tags()
    flat = all(tag.at_mm[2] == 0 and tag.x == (1.0, 0.0, 0.0) and tag.y == (0.0, 1.0, 0.0) for tag in tags)
    reach = [max(abs(tag.at_mm[axis]) + 0.625 * tag.size_mm for tag in tags) for axis in (0, 1)]
    middle = PAGE_MM[0] / 2, PAGE_MM[1] / 2 + 8
    if not flat or reach[0] > middle[1] - _HEAD_MM or reach[1] > middle[0] - 2:
        return None
    page = _headed(
        f"TEGA table sheet, {layout.family}: tape it flat to the table; the object stands on the cross"
    )
    for tag in tags:
        # The sheet lies across: the table's x is down the page, its y to the right.
        x, y = middle[0] + tag.at_mm[1], middle[1] + tag.at_mm[0]
        half = tag.size_mm / 2
        page.ink.extend(_tag_ink(tag, layout.family, x - half, y - half, quarter_turns=-1))
    page.ink.append(PrintedRect(middle[0] - 10, middle[1] - 0.15, 20.0, 0.3))
    page.ink.append(PrintedRect(middle[0] - 0.15, middle[1] - 10, 0.3, 20.0))
    page.words.append((middle[0] + 3, middle[1] - 12, "x: down the page; y: to the right"))
    return page


def board_page() -> PrintedPage:
    """Return the page with the ChArUco board, turned to lie along the page."""
    width, height = board_size_mm()
    board = charuco_board()
    scale = 48 / board.getSquareLength() / 1000  # pixels a millimetre; whole numbers of them for each module
    picture = board.generateImage((round(scale * width), round(scale * height)), marginSize=0, borderBits=1)
    page = _headed(f"TEGA calibration board, {width:g} × {height:g} mm: glue it to something flat")
    dark = np.rot90(np.asarray(picture) < 128)
    page.ink.extend(modules_mm(dark, (PAGE_MM[0] - height) / 2, _HEAD_MM + 2, 1 / scale))
    return page


def _outline(x: float, y: float, side: float) -> list[PrintedRect]:
    return [
        PrintedRect(x, y, side, _CUT_MM),
        PrintedRect(x, y + side - _CUT_MM, side, _CUT_MM),
        PrintedRect(x, y, _CUT_MM, side),
        PrintedRect(x + side - _CUT_MM, y, _CUT_MM, side),
    ]


def page_svg(page: PrintedPage) -> str:
    """Return a page as SVG with its size in millimetres."""
    width, height = PAGE_MM
    ink = "".join(f"M{r.x:.4f} {r.y:.4f}h{r.width:.4f}v{r.height:.4f}h{-r.width:.4f}z" for r in page.ink)
    words = "".join(
        f'<text x="{x:.2f}" y="{y:.2f}" font-family="sans-serif" font-size="3">{escape(text)}</text>'
        for x, y, text in page.words
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}mm" height="{height:g}mm" '
        f'viewBox="0 0 {width:g} {height:g}"><rect width="100%" height="100%" fill="#fff"/>'
        f'<path d="{ink}" shape-rendering="crispEdges"/>{words}</svg>\n'
    )


def pages_pdf(pages: list[PrintedPage]) -> bytes:
    """Return pages as one PDF (1.4, Helvetica, nothing compressed)."""
    width, height = (side * _POINTS_PER_MM for side in PAGE_MM)
    kids = " ".join(f"{4 + 2 * k} 0 R" for k in range(len(pages)))
    objects = [
        b"<< /Type /Catalog /Pages 2 0 R >>",
        f"<< /Type /Pages /Kids [{kids}] /Count {len(pages)} >>".encode(),
        b"<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica /Encoding /WinAnsiEncoding >>",
    ]
    for k, page in enumerate(pages):
        drawn = [f"{_POINTS_PER_MM:.6f} 0 0 {_POINTS_PER_MM:.6f} 0 0 cm 0 g"]
        drawn += [
            f"{r.x:.4f} {PAGE_MM[1] - r.y - r.height:.4f} {r.width:.4f} {r.height:.4f} re" for r in page.ink
        ]
        drawn.append("f")
        for x, y, text in page.words:
            safe = text.replace("\\", r"\\").replace("(", r"\(").replace(")", r"\)")
            drawn.append(f"BT /F1 3 Tf {x:.2f} {PAGE_MM[1] - y:.2f} Td ({safe}) Tj ET")
        content = "\n".join(drawn).encode("cp1252", "replace")
        objects.append(
            f"<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {width:.3f} {height:.3f}] /Contents {5 + 2 * k} 0 R "
            f"/Resources << /Font << /F1 3 0 R >> >> >>".encode()
        )
        objects.append(b"<< /Length %d >>\nstream\n%s\nendstream" % (len(content), content))
    out = bytearray(b"%PDF-1.4\n")
    places = []
    for number, body in enumerate(objects, 1):
        places.append(len(out))
        out += b"%d 0 obj\n%s\nendobj\n" % (number, body)
    table = len(out)
    out += b"xref\n0 %d\n0000000000 65535 f \n" % (len(objects) + 1)
    out += b"".join(b"%010d 00000 n \n" % place for place in places)
    out += b"trailer\n<< /Size %d /Root 1 0 R >>\nstartxref\n%d\n%%%%EOF\n" % (len(objects) + 1, table)
    return bytes(out)


def write_pages(file: Path, pages: list[PrintedPage]) -> list[Path]:
    """Write pages as ``file.pdf``, or ``file.svg``, ``file-2.svg`` and so on; return the files."""
    kind = file.suffix.lower()
    if kind == ".pdf":
        write_whole(file, pages_pdf(pages))
        return [file]
    if kind != ".svg":
        raise InvalidValueError(f"{file.name}: sheets are written as .pdf or .svg", "name it tags.pdf")
    files = [file if k == 0 else file.with_stem(f"{file.stem}-{k + 1}") for k in range(len(pages))]
    for one, page in zip(files, pages, strict=True):
        write_whole(one, page_svg(page))
    return files
