"""An amplifier on the network, a real Lab Streaming Layer outlet: ``python -m tega_emulators.lsl``.

Needs ``pylsl``. What it is called, its source identifier, is the ``port`` that it prints. The stream has the faults
that a network stream can have: loss, freeze, slow, duplicate, and unplug, which takes the outlet away. Its stamps are
the library's, or with ``--stamps`` those of another sender (:data:`STAMPS`); ``stamps NAME`` changes them.
"""

from __future__ import annotations

import argparse
import os
import random
import select
import sys
import time
from collections.abc import Callable
from typing import Any

from tega_emulators.faults import SIGNALS, Faults, Signal
from tega_emulators.pipe import notify, obey

__all__ = ["STAMPS", "main"]

_BURST_S = 0.01
_FAULTS = ("loss", "freeze", "slow", "duplicate")

STAMPS: dict[str, Callable[[float, float], float]] = {
    "own": lambda now_s, _since_s: now_s,
    "unix": lambda _now_s, _since_s: time.time(),
    "device": lambda _now_s, since_s: since_s,
    "late": lambda now_s, _since_s: now_s - 2.0,
    "ahead": lambda now_s, _since_s: now_s + 5.0,
}
"""Stamps of a sender, from the library's clock and the seconds since the sender began."""


def main() -> None:
    """Run the outlet until the standard input closes or says ``quit``."""
    options = _options()
    rng = random.Random(options.seed)
    signal, faults = Signal(options.rate, rng, options.signal), Faults(rng, names=_FAULTS)
    source_id = f"tega-emulator-{os.getpid()}"
    stated_hz = options.rate if options.stated_rate is None else options.stated_rate
    import pylsl

    info = pylsl.StreamInfo(options.name, options.type, options.channels, stated_hz, "float32", source_id)
    outlet: Any = pylsl.StreamOutlet(info)
    stamps, since_s = options.stamps, time.monotonic()
    notify({"port": source_id})

    def act(words: list[str]) -> None:
        nonlocal outlet, stamps
        if words == ["unplug"]:
            outlet = None
        elif words == ["plug"]:
            outlet = pylsl.StreamOutlet(info)
        elif words[0] == "stamps":
            stamps = words[1] if words[1] in STAMPS else stamps
        elif words[0] == "signal":
            signal.set(words[1], int(words[2]) if len(words) > 2 else None)
        elif words == ["clear"]:
            faults.clear()
        else:
            faults.set(words[0], float(words[1]) if len(words) > 1 else 1.0)

    last_s = time.monotonic()
    n, due = 0, 0.0
    while True:
        ready, _, _ = select.select([sys.stdin], [], [], _BURST_S)
        if ready:
            line = sys.stdin.readline()
            if line.split() in ([], ["quit"]):
                return
            obey(line, act)
        now_s = time.monotonic()
        due += (now_s - last_s) * options.rate * faults.share["slow"]
        last_s = now_s
        rows = []
        while due >= 1:
            due -= 1
            if faults.frozen:
                continue
            row = [1e9 if v is None else float(v) for v in signal.steps(n, options.channels)]
            n += 1
            if rng.random() >= faults.share["loss"]:
                rows += [row] * (2 if rng.random() < faults.share["duplicate"] else 1)
        if rows and outlet is not None:
            outlet.push_chunk(rows, STAMPS[stamps](pylsl.local_clock(), now_s - since_s))


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rate", type=float, default=500.0)
    parser.add_argument("--stated-rate", type=float, help="what the stream says of itself; 0 is irregular")
    parser.add_argument("--channels", type=int, default=3)
    parser.add_argument("--signal", choices=SIGNALS, default="ramp")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--stamps", choices=tuple(STAMPS), default="own")
    parser.add_argument("--name", default="tega-emulator")
    parser.add_argument("--type", default="EMG", help="what the stream declares itself as")
    return parser.parse_args()


if __name__ == "__main__":
    main()
