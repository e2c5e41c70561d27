"""How well the onset of an emulated motor is found: ``python -m tega_figures.motor_onset``; simulated sound.

Each line is one emulated motor, in a process of its own that writes what a microphone would hear of twelve bursts.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from random import Random
from typing import Final

import numpy as np

from tega_bench.vest_latency.detect import find_onsets
from tega_bench.vest_latency.log import read_wav
from tega_bench.vest_latency.measure import BURST_S
from tega_emulators.process import Emulator

__all__ = ["CASES", "main"]

CASES: Final[dict[str, dict[str, float]]] = {
    "quiet room, 60 %": {},
    "delay 15 ms": {"delay_ms": 15},
    "delay 200 ms": {"delay_ms": 200},
    "20 %": {"percent": 20},
    "100 %": {"percent": 100},
    "slow motor, 70 ms": {"rise_ms": 70},
    "fast motor, 15 ms": {"rise_ms": 15},
    "hum as loud as the motor": {"hum": 0.1},
    "noise, 1/5 of the motor": {"noise": 0.02},
    "noise, 3/5 of the motor": {"noise": 0.06},
    "noise, twice the motor": {"noise": 0.2},
    "motor that does not turn": {"loud": 0},
    "microphone unplugged": {"gain": 0},
}
_BURSTS = 12


def main() -> None:
    """Print the table."""
    print("| emulated motor | really ms | found ms | middle half ms | bursts used | else |")
    print("|---|---|---|---|---|---|")
    for name, case in CASES.items():
        print(_line(name, dict(case)))


def _line(name: str, case: dict[str, float]) -> str:
    percent = case.pop("percent", 60)
    with tempfile.TemporaryDirectory() as folder, Emulator("motor_sound") as motor:
        for setting, value in case.items():
            motor.say(f"set {setting} {value}")
        rests, t_s, commands_s = Random(3), 0.8, list[float]()
        for _ in range(_BURSTS):
            commands_s.append(t_s)
            motor.say(f"drive {t_s} {percent}")
            motor.say(f"drive {t_s + BURST_S} 0")
            t_s += BURST_S + rests.uniform(0.9, 1.3)
        wav = Path(folder, "sound.wav")
        motor.say(f"wav {wav} {t_s}")
        onsets = find_onsets(*read_wav(wav), commands_s, on_s=BURST_S)
    really_ms = case.get("delay_ms", 60)
    if onsets.problem:
        return f"| {name} | {really_ms:g} | – | – | {len(onsets.delays_s)} of {_BURSTS} | {onsets.problem} |"
    low, middle, high = 1e3 * np.percentile(onsets.delays_s, (25, 50, 75))
    used = f"{len(onsets.delays_s)} of {_BURSTS}"
    return f"| {name} | {really_ms:g} | {middle:.1f} | {low:.1f} to {high:.1f} | {used} | |"


if __name__ == "__main__":
    main()
