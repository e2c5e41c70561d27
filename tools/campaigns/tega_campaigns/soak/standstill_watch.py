"""Looks how late it wakes, in a process of its own, and says when that was very late."""

from __future__ import annotations

import sys
import threading
import time

__all__ = ["main"]

_STEP_S = 0.02
_LEAST_S = 0.25


def main() -> None:
    """Look until the standard input ends; print since when and till when the machine stood still, ns of the day."""
    over = threading.Event()

    def listen() -> None:
        sys.stdin.read()
        over.set()

    threading.Thread(target=listen, daemon=True).start()
    last_ns = time.time_ns()
    while not over.wait(_STEP_S):
        now_ns = time.time_ns()
        if now_ns - last_ns > _LEAST_S * 1e9:
            print(last_ns, now_ns, flush=True)  # noqa: T201  # to the program that started it
        last_ns = now_ns


if __name__ == "__main__":
    main()
