"""The picture of the tracker's run time against its error can be read: no name lies on another or on a point."""

from __future__ import annotations

import json
from itertools import combinations

import pytest

from tega_figures.touch_peers.pareto import RESULTS, drawn

text_module = pytest.importorskip("matplotlib.text", reason="needs the extra tega[lab]")


def test_names_of_variants_lie_on_no_other_name_and_on_no_point() -> None:
    rows = json.loads(RESULTS.read_text(encoding="utf-8"))
    figure = drawn(rows)
    for panel in figure.axes:
        names = [text for text in panel.texts if isinstance(text, text_module.Annotation) and text.get_text()]
        assert len(names) == len(rows)
        boxes = [name.get_window_extent() for name in names]
        assert not any(a.overlaps(b) for a, b in combinations(boxes, 2))
        points = panel.transData.transform([name.xy for name in names])
        assert not any(box.contains(*point) for box in boxes for point in points)
