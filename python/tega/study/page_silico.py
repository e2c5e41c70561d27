"""What a report of simulated people has besides: the paper's directions, the assumptions, what they decide."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

from tega.study.analyse import Analysis
from tega.study.directions import Direction
from tega.study.markup import esc, fold, number, table
from tega.study.silico.assumptions import Assumptions
from tega.study.silico.sensitivity import SensitivityRow
from tega.study.tables import PAPER_LABELS

__all__ = ["assumptions_html", "directions_html", "sensitivity_html"]

SHORT = {"duration_s": "time", "slips": "slips", "deformations": "deformed", "success": "success"}
SMALLEST = 0.005
"""Differences that round to 0.00 are called none."""

MARKS = {"as printed": "yes told", "opposite": "no told", "not told apart": "", "no data": ""}


def directions_html(analysis: Analysis) -> str:
    """Return the table of the paper's directions and what became of them; nothing for people."""
    if not analysis.directions:
        return ""
    total = len(analysis.directions)
    same = [one for one in analysis.directions if one.verdict == "as printed"]
    opposite = [one for one in analysis.directions if one.verdict == "opposite"]
    told = f"<p><b>{len(same)} of the paper's {total} differences come out in its direction"
    told += f" ({_list(same)})" if same else ""
    told += f", {len(opposite)} come out the other way" + (f" ({_list(opposite)})" if opposite else "")
    rest = total - len(same) - len(opposite)
    told += f", {rest} cannot be told from no difference.</b> A direction that does not come out is a finding about "
    told += "these assumptions; nothing was tuned until it did.</p>"
    rows = [
        [
            esc(PAPER_LABELS[one.metric]),
            esc(one.object),
            f"{one.paper_first} / {one.paper_second}",
            "fewer" if one.paper_sign < 0 and one.metric in {"slips", "deformations"} else
            "less" if one.paper_sign < 0 else "more",
            f"{_amount(one, one.first)} / {_amount(one, one.second)}",
            _difference(one),
            f'<span class="mark {MARKS[one.verdict]}">{one.verdict}</span>',
        ]
        for one in analysis.directions
    ]  # fmt: skip
    a, b = analysis.conditions[:2]
    head = ["metric", "object", f"paper: {a} / {b}", "paper says", "simulated", "difference", "comes out"]
    note = (
        f"Every number of the paper's Table I that differs between {esc(a)} and {esc(b)}. Difference: mean over "
        f"{analysis.directions[0].people} simulated people with its 95 % interval by t, uncorrected. The paper's "
        "times have no unit, so that only their sign is compared. A dropped object ends a trial early."
    )
    return "<h2>The paper's directions</h2>" + told + table(head, rows, note)


def _list(some: Sequence[Direction]) -> str:
    return ", ".join(f"{PAPER_LABELS[one.metric].lower()} of {esc(one.object)}" for one in some)


def _amount(one: Direction, value: float | None) -> str:
    if value is None:
        return "–"
    return f"{100 * value:.0f}&nbsp;%" if one.metric == "success" else number(value)


def _difference(one: Direction) -> str:
    if one.difference is None:
        return "–"
    scale, digits = (100.0, 0) if one.metric == "success" else (1.0, 2)
    text = number(scale * one.difference, digits)
    if one.low is not None and one.high is not None:
        text += f" ({number(scale * one.low, digits)} to {number(scale * one.high, digits)})"
    return text + ("&nbsp;points" if one.metric == "success" else "")


def sensitivity_html(analysis: Analysis) -> str:
    """Return the table of what changes the directions; nothing where no change was run."""
    if not analysis.sensitivity:
        return ""
    rows = analysis.sensitivity
    asked = rows[0].directions
    head = ["changed", "to", *(f"{SHORT[one.metric]}, {one.object}" for one in asked)]
    body = [
        [
            esc(row.what),
            esc(f"{row.setting}"),
            *(_mark(one) for one in row.directions),
        ]
        for row in rows
    ]
    sizes = sorted({(row.people, row.trials) for row in rows})
    size = "; ".join(f"{people} people, {trials} trials" for people, trials in sizes)
    note = (
        f"Each row is a small study of its own ({size}), with the same people and chance; a parameter is set to an "
        "end of its range for everybody, an arm takes the place of haptic, paper are the loop's readings as printed. "
        "✓ the sign that the paper prints, ✗ the opposite, 0 no difference, beside it the difference; "
        '<span class="mark yes told">✓</span> and <span class="mark no told">✗</span> where the 95 % '
        "interval over these few people leaves 0 out: with so many cells one in twenty does by chance alone. A "
        "direction that says something about touch has to stand in base and to be gone in unrelated, constant and "
        "inverted."
    )
    ranges = "Over base and the parameters' ends, without arms and readings."
    text = "<h2>Which directions hold over which range</h2>" + table(head, body, note)
    head = ["direction", "sign as printed", "told apart", "told apart, opposite", "turns within the range of"]
    return text + table(head, _ranges(rows), ranges)


def _mark(one: Direction) -> str:
    if one.difference is None:
        return "–"
    if abs(one.difference) < SMALLEST:
        return "0"
    sign = "✓" if _as_printed(one) else "✗"
    value = number(100 * one.difference, 0) + "&nbsp;%" if one.metric == "success" else number(one.difference)
    return f'<span class="mark {MARKS[one.verdict]}">{sign}</span>&nbsp;<span class="small">{value}</span>'


def _ranges(rows: Sequence[SensitivityRow]) -> list[list[str]]:
    """Tell for each direction how often it has the paper's sign, and which parameters turn it."""
    found = []
    people = [row for row in rows if row.what not in {"arm", "reading"}]
    for place, asked in enumerate(rows[0].directions):
        signs = [_as_printed(row.directions[place]) for row in people]
        told = [row.directions[place].verdict for row in people]
        base = next((_as_printed(row.directions[place]) for row in people if row.what == "base"), None)
        turned = []
        for what, some in groupby((row for row in people if row.what != "base"), key=lambda row: row.what):
            ends = [row for row in some if _as_printed(row.directions[place]) != base]
            if ends:
                turned.append(f"{esc(what)} (at {' and '.join(esc(row.setting) for row in ends)})")
        found.append(
            [
                f"{esc(PAPER_LABELS[asked.metric])}, {esc(asked.object)}",
                f"{sum(signs)} of {len(signs)}",
                str(told.count("as printed")),
                str(told.count("opposite")),
                ", ".join(turned) or "none",
            ]
        )
    return found


def _as_printed(one: Direction) -> bool:
    off = one.difference or 0.0
    return abs(off) >= SMALLEST and (off > 0) == (one.paper_sign > 0)


def assumptions_html(analysis: Analysis) -> str:
    """Return what a study in silico takes for granted; nothing for people."""
    stated = analysis.assumptions
    if stated is None:
        return ""
    how = (
        "the one that was frozen, and committed, before the first closed-loop run"
        if stated.frozen
        else "<b>changed</b>: not the one that was frozen before the first closed-loop run"
    )
    text = (
        "<h2>Assumptions</h2><p>Simulated people are drawn from the population that the parameter file describes. Its "
        f"SHA-256 is <code>{stated.parameters_sha256}</code>: {how}. Nothing is set per object, condition or cell of a "
        "table; both conditions have the same people, chance, guesses and costs. Every number in it has a mark and a "
        "source; marks G and P are guesses with a range."
    )
    if stated.everyone:
        same = ", ".join(f"{esc(name)} = {value:g}" for name, value in stated.everyone.items())
        text += f" <b>Changed for everybody:</b> {same}."
    text += f" Readings of the loop: {stated.preset}. Program: tega {esc(stated.version)}.</p>"
    return (
        text
        + fold("Objects, none of them measured", _objects(stated))
        + fold("Parameters", _parameters(analysis))
    )


def _objects(stated: Assumptions) -> str:
    names = ("mass_kg", "stiffness_n_m", "friction", "diameter_m", "height_m", "harm_m", "plastic_share")
    rows = [[esc(name), *(f"{fields[one]:g}" for one in names)] for name, fields in stated.objects.items()]
    note = "From the ranges of household objects; made by hand, like the hand's and the gel's properties."
    return table(["object", *names], rows, note)


def _parameters(analysis: Analysis) -> str:
    rows = [
        [
            f"{section}.{name}",
            f"{p.value:g}",
            "" if p.sd == 0 else f"{p.sd:g}" + (" (ln)" if p.law == "lognormal" else ""),
            f"{p.low:g} to {p.high:g}",
            esc(p.unit),
            p.mark,
            esc(p.source),
        ]
        for section, entries in analysis.parameters.items()
        for name, p in entries.items()
    ]
    note = "F read in full, A abstract, M measured, G general knowledge, P proposal. sd over people; range: bounds."
    return table(["parameter", "value", "sd", "range", "unit", "mark", "source"], rows, note)
