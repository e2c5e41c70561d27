"""Lead a session: take participant and experimenter through the planned trials.

::

    running_trial.py       one trial between the bench's thread and the session's
    benches.py             the lab's devices, or the simulated bench: a trial runs on them
    beeps.py               the second task's beeps, where the plan has one
    questions.py           raw NASA-TLX and comfort, asked after each block
    asking.py              their screen and keys
    experimenter.py        the experimenter's screen and keys: a terminal, or lines
    screens.py             the screens while a trial is waited for, and while it goes on
    fatigue.py             whether the arm tires, shown in a rest
    rest_tasks.py          what the bench does in a rest
    squeeze.py             of that: a squeeze against the first
    to_start.py            and arm and hand to their start
    between_trials.py      the trial before: how it went, corrections, notes
    status_file.py         the session's status for the observers' consoles, in a file beside the events
    tell.py                commands of other programs
    session_progress.py    screen and status file, brought up to date no more often than is of use
    session.py             the session: rest, countdown, trial, questions, from the first trial to the last

All that is decided is an event in the session's journal; a stop at any moment loses nothing that was acknowledged.
"""

from __future__ import annotations

from tega_study.lead.session import lead_session

__all__ = ["lead_session"]
