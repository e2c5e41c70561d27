"""Score a study's trials: gather several accounts of what happened, and measure how far they agree.

::

    accounts.py   who says what: raters, the experimenter, the truth of a simulated bench
    agree.py      events matched in time, chance, delay, Cohen's kappa, ICC
    boris.py      BORIS projects out, events coded there in
    boris_file.py  what such a project holds
    clips.py      blind clips of recordings for BORIS, with proposals
    recorded.py, trial_pictures.py, clip_video.py   the trials that clips show, their pictures, the video
    clips_coded.py  what was coded of them
"""

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
