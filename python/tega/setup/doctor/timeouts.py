"""Run jobs side by side, each in a thread and under a time limit."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from typing import TypeVar

_Key = TypeVar("_Key")
_Answer = TypeVar("_Answer")


def in_time(
    jobs: Mapping[_Key, Callable[[], _Answer]], deadline_s: float, late: Callable[[_Key, float], _Answer]
) -> dict[_Key, _Answer]:
    """Run all jobs at once and return their results, in their order.

    A job that is not done in time is left to itself: its thread does not keep the program from ending.

    Args:
        jobs: Functions to run; a job must not raise.
        deadline_s: Time limit for all of them together.
        late: Given a job's key and the deadline, makes the answer of one that is not done.

    Example:
        >>> in_time({"a": lambda: 1, "b": lambda: 2}, 10.0, lambda key, _: 0)
        {'a': 1, 'b': 2}
    """
    answers: dict[_Key, _Answer] = {}

    def do(key: _Key, job: Callable[[], _Answer]) -> None:
        answers[key] = job()

    threads = [
        threading.Thread(target=do, args=item, name=f"tega-look-{item[0]}", daemon=True)
        for item in jobs.items()
    ]
    until_s = time.monotonic() + deadline_s
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(max(0.0, until_s - time.monotonic()))
    done = dict(answers)
    return {key: done[key] if key in done else late(key, deadline_s) for key in jobs}
