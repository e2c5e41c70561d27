"""Lead a session: take participant and experimenter through the planned trials.

::

    lift_rule.py   when an object counts as lifted: 0.2 m, held for a second, begun within the window
    going.py       one trial between the bench's thread and the lead
    benches.py     what a trial runs on: the lab's devices, or the simulated bench
    beeps.py       the second task's beeps, where the plan has one
    questions.py   raw NASA-TLX and comfort, asked after each block
    desk.py        what the experimenter sees and presses: a terminal, or lines
    screens.py     what there is to see while a trial is waited for, and while it goes on
    fatigue.py     whether the arm tires, shown in a rest
    before.py      the trial before: how it went, corrections, notes
    board.py       what the observers' consoles are told, in a file beside the events
    tell.py        commands of other programs
    telling.py     screen and board, no more often than is of use
    session.py     the session: rest, countdown, trial, questions, from the first trial to the last

All that is decided is an event in the session's journal; a stop at any moment loses nothing that was acknowledged.
"""

from __future__ import annotations

from tega.study.lead.session import lead_session

__all__ = ["lead_session"]
