"""Keep a core busy until the input ends: a program that runs beside a bench."""

from __future__ import annotations

import sys
import threading


def main() -> None:
    """Compute."""
    over = threading.Event()

    def listen() -> None:
        sys.stdin.read()
        over.set()

    threading.Thread(target=listen, daemon=True).start()
    while not over.is_set():
        sum(range(10_000))


if __name__ == "__main__":
    main()
