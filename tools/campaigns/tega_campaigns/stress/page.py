"""The cases as a page."""

from __future__ import annotations

from collections.abc import Iterable

from tega_campaigns.stress.case import GROUPS, Group, StressCase, short

__all__ = ["render_page"]

INTRODUCTION = """\
# Stress: the kernels where numbers go wrong

Every line is one case that `tega-teleop stress` runs: what was done, what happened, how far the worst result is from
an exact reference, and the bound it has to keep. The references are whole numbers and fractions for the contact
metrics, 60-digit decimals for the vest intensity and the EMG filter; none of them shares code with what it judges.

This page is the output of `tega-teleop stress --markdown`, without the times that some cases also print. Errors have
one digit; the last digits of a logarithm or a sine differ from one C library to the next, and so may they.
`tega-teleop stress --quick` takes a million samples instead of a hundred million.
"""


NOTES: dict[Group, str] = {
    "contact": "Each case runs the equations with several differences and spreads; where one of EDA, peak pixel and "
    "contact verdict is not exactly right, the error counts as infinite. What the two presets say is told beside it.",
    "sigmoid": "",
    "emg": "Drift would show as a mean that moves away from the input's, or as an output that depends on how long the "
    "filter has run. What there is at high rates is rounding, which grows as the square of the rate: a constant comes "
    "to rest next to where it should, and stays there.",
}


def render_page(cases: Iterable[StressCase]) -> str:
    """Write the page.

    Args:
        cases: As `run_stress` returns them.

    Returns:
        Markdown, ending with a newline.
    """
    cases = list(cases)
    lines = [INTRODUCTION]
    for group, title in GROUPS.items():
        lines += [f"## {title}", ""]
        lines += [NOTES[group], ""] if NOTES[group] else []
        lines += ["| case | done | happened | error | bound | error is |", "|---|---|---|---|---|---|"]
        for c in (case for case in cases if case.group == group):
            error = short(c.error) if c.passed else f"**{short(c.error)}: missed**"
            cells = (c.name, c.done, c.happened, error, f"{c.bound:.2g}", c.error_of)
            lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
        lines.append("")
    return "\n".join(lines)
