"""An amplifier on the network, a real Lab Streaming Layer outlet: ``python -m tega_emulators.lsl``.

Needs ``pylsl``. What it is called, its source identifier, is the ``port`` that it prints. The stream has the faults
that a network stream can have: loss, freeze, slow, duplicate, and unplug, which takes the outlet away.
"""

from __future__ import annotations

import argparse
import os
import random
import select
import sys
import time
from typing import Any

from tega_emulators.faults import SIGNALS, Faults, Signal
from tega_emulators.pipe import obey, tell

__all__ = ["main"]

_BURST_S = 0.01
_FAULTS = ("loss", "freeze", "slow", "duplicate")


def main() -> None:
    """Run the outlet until the standard input closes or says ``quit``."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rate", type=float, default=500.0)
    parser.add_argument("--stated-rate", type=float, help="what the stream says of itself; 0 is irregular")
    parser.add_argument("--channels", type=int, default=3)
    parser.add_argument("--signal", choices=SIGNALS, default="ramp")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    rng = random.Random(options.seed)
    signal, faults = Signal(options.rate, rng, options.signal), Faults(rng, names=_FAULTS)
    source_id = f"tega-emulator-{os.getpid()}"
    stated_hz = options.rate if options.stated_rate is None else options.stated_rate
    outlet = _outlet(source_id, options.channels, stated_hz)
    tell({"port": source_id})

    def act(words: list[str]) -> None:
        nonlocal outlet
        if words == ["unplug"]:
            outlet = None
        elif words == ["plug"]:
            outlet = _outlet(source_id, options.channels, stated_hz)
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
            outlet.push_chunk(rows)


def _outlet(source_id: str, n_channels: int, rate_hz: float) -> Any:
    import pylsl

    return pylsl.StreamOutlet(
        pylsl.StreamInfo("tega-emulator", "EMG", n_channels, rate_hz, "float32", source_id)
    )


if __name__ == "__main__":
    main()
