"""Score a study's trials: gather several accounts of each trial, and measure their agreement."""

from __future__ import annotations

from tega_study.score.accounts import agreements
from tega_study.score.agree import Agreement, agreement, icc, kappa, match_events
from tega_study.score.boris import export_boris, export_elan, import_boris

__all__ = [
    "Agreement",
    "agreement",
    "agreements",
    "export_boris",
    "export_elan",
    "icc",
    "import_boris",
    "kappa",
    "match_events",
]
