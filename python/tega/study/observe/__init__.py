"""Observing a session: one key an event, in a file of its own for each rater.

::

    observing.py   what a rater adds, and which trials the rater saw from start to end; no display
    console.py     the console in a terminal, a program of its own

A console reads the session's events and its board, and writes into no file but the rater's. So it needs no
connection, and either side can stop and start again at any moment. Raters do not see one another, nor the condition.
"""

from __future__ import annotations

from tega.study.observe.observing import Observing

__all__ = ["Observing"]
