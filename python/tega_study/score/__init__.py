"""Score a study's trials: gather several accounts of each trial, and measure their agreement.

::

    accounts.py   the accounts: raters, the experimenter, the truth of a simulated bench
    agree.py      events matched in time, chance, delay, Cohen's kappa, ICC
    boris.py      export BORIS projects, import coded events
    boris_file.py  content of such a project
    clips.py      blind clips of recordings for BORIS, with proposals
    recorded.py, trial_pictures.py, clip_video.py   the trials shown in clips, their frames, the video
    clips_coded.py  a rater's coding of the clips
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
