"""Where numbers go wrong, tried on purpose: every kernel at its extremes, judged by exact arithmetic.

Each case says what was done, what happened, and how far the result is from a reference in whole numbers, fractions
or 60-digit decimals, next to the bound it has to keep. ``tega-teleop stress`` runs them.
"""

from __future__ import annotations

from tega_campaigns.stress.case import GROUPS, StressCase
from tega_campaigns.stress.page import render_page
from tega_campaigns.stress.runner import run_stress

__all__ = ["GROUPS", "StressCase", "render_page", "run_stress"]
