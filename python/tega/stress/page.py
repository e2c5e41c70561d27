"""The cases as a page."""

from __future__ import annotations

from collections.abc import Iterable

from tega.stress.case import GROUPS, StressCase, short

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
        lines += [
            f"## {title}",
            "",
            "| case | done | happened | error | bound | error is |",
            "|---|---|---|---|---|---|",
        ]
        for c in cases:
            if c.group == group:
                error = short(c.error) if c.passed else f"**{short(c.error)}: missed**"
                cells = (c.name, c.done, c.happened, error, short(c.bound), c.error_of)
                lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
        lines.append("")
    return "\n".join(lines)
