"""List the unclear places of the paper and the setting that chooses each reading of them.

Writes the table of ``docs/readings.md``::

    python -m tega_figures.places docs/readings.md
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Final, NamedTuple

from tega.config import LOOP_KEYS

__all__ = ["PLACES", "OpenPlace", "main", "places_table"]

_BEGIN, _END = "<!-- places: begin -->", "<!-- places: end -->"


class OpenPlace(NamedTuple):
    """An unclear place of the paper and how its readings are chosen.

    ``number`` is that of the list of readings, such as ``A1``; ``sets`` has a setting a reading, as for
    ``--set``, after those of ``needs``, on which they stand.
    """

    number: str
    what: str
    sets: tuple[str, ...]
    needs: tuple[str, ...] = ()


_READING = ("stages.metric.name=reading",)
_PRINTED = ("stages.metric.name=reading", "stages.metric.options.threshold=D1")
_METRIC, _DECODER, _MAPPING = (f"stages.{group}.options" for group in ("metric", "decoder", "mapping"))


def _each(key: str, *values: object) -> tuple[str, ...]:
    return tuple(f"{key}={value}" for value in values)


_THRESHOLDS = _each(f"{_METRIC}.threshold", *(f"D{n}" for n in range(1, 9)))
_DIFFERENCES = _each(f"{_METRIC}.difference", "signed", "rectified", "l2", "luminance")

PLACES: Final = (
    OpenPlace("A1", "σ of Eq 4 is a length, I a grey value", _THRESHOLDS, _READING),
    OpenPlace("A1", "σ: spatial, or of the grey values", (f"{_METRIC}.spread=intensity",), _PRINTED),
    OpenPlace("A2", "the upper 90 % of values", _each(f"{_METRIC}.threshold", "D4", "D7"), _READING),
    OpenPlace("A3", "1.28, found or derived", (f"{_METRIC}.factor=2.0",), _READING),
    OpenPlace("A4", "no contact", (f"{_METRIC}.min_pixels=60", f"{_METRIC}.noise_floor=3"), _READING),
    OpenPlace("A4", "no contact, of D1 and D2", (f"{_METRIC}.gate=true",), _PRINTED),
    OpenPlace("A5", "sign of the difference", _DIFFERENCES, _READING),
    OpenPlace("A6", "ω of the colours", (f"{_METRIC}.weights=[0.2, 0.5, 0.3]",), _READING),
    OpenPlace("A11", "value at the centroid", _each(f"{_METRIC}.centroid_value", "bilinear", "disc", "peak"), _READING),
    OpenPlace("A12", "a pixel at the threshold", (f"{_METRIC}.ties=true",), _READING),
    OpenPlace("A13", "which pixels count", ("stages.metric.name=live", f"{_METRIC}.outline=contact")),
    OpenPlace("A14", "the largest value", _each(f"{_METRIC}.peak", "median", "percentile"), _READING),
    OpenPlace("A15", "CCI of a deeper press", _each(f"{_METRIC}.cci", "root", "peak", "mass"), _READING),
    OpenPlace("A20", "drift of the baseline", ("stages.metric.name=live", f"{_METRIC}.rezero=false")),
    OpenPlace(
        "A22", "trend of the deformation",
        (f"{_METRIC}.trend=rise", f"{_METRIC}.trend=change", f"{_METRIC}.trend_s=0.2"), ("stages.metric.name=live",),
    ),
    OpenPlace(
        "A22", "that trend on the vest", (f"{_MAPPING}.front=trend_mm_s",),
        ("stages.metric.name=live", f"{_METRIC}.trend=rise", f"{_MAPPING}.front_max=2.0"),
    ),
    OpenPlace("A23", "32 motors of a vest that has 40", _each("vest.layout", "paper32", "x40", "x16")),
    OpenPlace("A24", "left and right", _each("vest.mirror", "back", "all")),
    OpenPlace("A24", "finger of each column", (f'{_MAPPING}.fingers=["ring", "middle", "index", "thumb"]',)),
    OpenPlace("A25", "rows of a column", (f"{_MAPPING}.rows=bar",)),
    OpenPlace("A26", "intensity at rest", (f"{_MAPPING}.at_rest=law",)),
    OpenPlace("A27", "k of the front", (f"{_MAPPING}.end_value=0.05",)),
    OpenPlace("A28", "k of the back", (f"{_MAPPING}.back_end_value=0.05",)),
    OpenPlace("A29", "the law between 0 and the maximum", _each(f"{_MAPPING}.law", "linear", "power")),
    OpenPlace("A29", "the power", (f"{_MAPPING}.exponent=0.7",), (f"{_MAPPING}.law=power",)),
    OpenPlace("A31", "full scale", (f"{_MAPPING}.front_max=2.0", f"{_MAPPING}.back_max=9000")),
    OpenPlace("A33", "values above the maximum", (f"{_MAPPING}.saturate=true",)),
    OpenPlace("A35", "events instead of a steady picture", ("stages.mapping.name=pulses",)),
    OpenPlace("–", "which value on which face", (f"{_MAPPING}.front=eda", f"{_MAPPING}.back=cci")),
    OpenPlace("A38", "rectified or not", ("emg.kind=envelope",), ("emg.driver=synthetic-emg", "emg.kind=raw")),
    OpenPlace("A39", "cutoff and order of the low-pass", (f"{_DECODER}.cutoff_hz=5", f"{_DECODER}.order=2")),
    OpenPlace("A39", "band of the raw signal before that", (f"{_DECODER}.before=band",)),
    OpenPlace("A40", "τ", _each(f"{_DECODER}.tau_s", 0.05, 0.2)),
    OpenPlace("A44", "four or five equal intervals", (f"{_DECODER}.intervals=5",)),
    OpenPlace("A45", "the maximum, and steadying (A51)", _each(f"{_DECODER}.preset", "paper", "live")),
    OpenPlace("A46", "levels counted from 0 (Fig 8) or 1 (Eq 11) in pictures", _each("session.pose_base", 0, 1)),
    OpenPlace("A49", "the vote", _each(f"{_DECODER}.fusion", "round", "median")),
    OpenPlace("A55", "weight of each channel", (f"{_DECODER}.channel_weights=[1.0, 0.5, 1.0]",)),
)  # fmt: skip
"""The places whose reading is a setting, in the order of the list."""


def places_table() -> str:
    """Return the table of the page, with the marks that it stands between."""
    rows = ["| place | unclear point | settings | where |", "|---|---|---|---|"]
    for place in PLACES:
        reported = [f"`{item}`" for item in (*place.needs, *place.sets)]
        if len({item.partition("=")[0] for item in place.sets}) == 1 and len(place.sets) > 1:
            key = place.sets[0].partition("=")[0]
            values = ", ".join(f"`{item.partition('=')[2]}`" for item in place.sets)
            reported = [*(f"`{item}`" for item in place.needs), f"`{key}=` {values}"]
        rows.append(f"| {place.number} | {place.what} | {', '.join(reported)} | {_where(place)} |")
    return "\n".join([_BEGIN, *rows, _END])


def _where(place: OpenPlace) -> str:
    keys = [item.partition("=")[0] for item in (*place.needs, *place.sets)]
    if all(key.startswith("stages.") or key in LOOP_KEYS for key in keys):
        return "everywhere"
    return "`run`, `study run --lab`"


def main(arguments: list[str] | None = None) -> None:
    """Write the table into a page."""
    (name,) = sys.argv[1:] if arguments is None else arguments
    page = Path(name)
    text = page.read_text(encoding="utf-8")
    before, after = text[: text.index(_BEGIN)], text[text.index(_END) + len(_END) :]
    page.write_text(before + places_table() + after, encoding="utf-8")


if __name__ == "__main__":
    main()
