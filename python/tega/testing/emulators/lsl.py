"""An amplifier on the network, a real Lab Streaming Layer outlet: ``python -m tega.testing.emulators.lsl``.

Needs ``pylsl``. What it is called, its source identifier, is written to ``--port-file``. The stream has the faults
that a network stream can have: loss, freeze, slow, duplicate, and unplug, which takes the outlet away.
"""

from __future__ import annotations

import argparse
import os
import random
import select
import sys
import time
from pathlib import Path
from typing import Any

from tega.testing.emulators.faults import SIGNALS, Faults, Signal

__all__ = ["main"]

_BURST_S = 0.01
_FAULTS = ("loss", "freeze", "slow", "duplicate")


def main() -> None:
    """Run the outlet until the standard input closes or says ``quit``."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--port-file", type=Path, required=True, help="where to write the source identifier")
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
    options.port_file.with_suffix(".new").write_text(source_id)
    options.port_file.with_suffix(".new").replace(options.port_file)
    last_s = time.monotonic()
    n, due = 0, 0.0
    while True:
        ready, _, _ = select.select([sys.stdin], [], [], _BURST_S)
        if ready:
            words = sys.stdin.readline().split()
            if words in ([], ["quit"]):
                return
            answer = "ok"
            if words == ["unplug"]:
                outlet = None
            elif words == ["plug"]:
                outlet = _outlet(source_id, options.channels, stated_hz)
            else:
                answer = _obey(words, signal, faults)
            sys.stdout.write(answer + "\n")
            sys.stdout.flush()
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


def _obey(words: list[str], signal: Signal, faults: Faults) -> str:
    try:
        if words[0] == "signal":
            signal.set(words[1], int(words[2]) if len(words) > 2 else None)
        elif words[0] == "clear":
            faults.clear()
        else:
            faults.set(words[0], float(words[1]) if len(words) > 1 else 1.0)
    except (KeyError, ValueError, IndexError) as error:
        return f"? {' '.join(words)}: {error!r}"
    return "ok"


if __name__ == "__main__":
    main()
