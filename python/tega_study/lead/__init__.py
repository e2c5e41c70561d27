"""Lead a session: take participant and experimenter through the planned trials.

::

    running_trial.py       one trial shared by the bench's thread and the session's
    benches.py             the lab's devices, or the simulated bench, to run trials on
    beeps.py               the second task's beeps, if the plan has one
    questions.py           raw NASA-TLX and comfort, asked after each block
    asking.py              screen and keys for the questions
    experimenter.py        the experimenter's screen and keys: a terminal, or lines
    screens.py             the screens before and during a trial
    fatigue.py             fatigue of the arm, shown in a rest
    rest_tasks.py          tasks of the bench in a rest
    squeeze.py             rest task: compare a squeeze with the first
    to_start.py            rest task: move arm and hand to their start
    between_trials.py      the trial before: result, corrections, notes
    status_file.py         the session's status for the observers' consoles, in a file beside the events
    tell.py                commands from other programs
    session.py             the session: rest, countdown, trial, questions, from the first trial to the last

Every decision is an event in the session's journal; a stop at any moment loses no acknowledged event.
"""

from __future__ import annotations

from tega_study.lead.session import lead_session

__all__ = ["lead_session"]
