"""Observe a session, or its recordings: one key an event, in a file of its own for each rater.

::

    observing.py         live: what a rater adds, and which trials the rater saw from start to end; no display
    recorded.py          recordings: the trials that count, in the rater's own order
    trial_pictures.py    what of a recording is shown, at any moment of its trial
    play_head.py         where in it the rater is, and what was played
    scoring.py           what a rater of recordings adds, and which trials are over; no display
    rater_console.py     what both consoles have in common, programs of their own in a terminal
    console.py, playback_console.py    live, and for recordings

A console reads what the session wrote, and writes into no file but the rater's. So it needs no connection, and either
side can stop and start again at any moment. Raters do not see one another, nor the condition.
"""

from __future__ import annotations

from tega.study.observe.observing import Observing

__all__ = ["Observing"]
