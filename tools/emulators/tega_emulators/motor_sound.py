"""What a vest's motor sounds like to a microphone taped to it, by a model of an eccentric rotating mass.

``python -m tega_emulators.motor_sound`` is one motor by itself; an emulated vest makes the sound of its own
motors, see :mod:`tega_emulators.vest_process`. Simulated: no real motor was recorded for it.

A motor switched on stands still for ``delay_ms`` (the vest's own radio, processor and the motor's stiction), then its
speed rises exponentially to what the drive asks for. Its force, and with it the sound, goes with the speed squared; the
vibration therefore *begins* at ``delay_ms``. Noise, mains hum and knocks are added.

It obeys lines on its standard input::

    set NAME VALUE         one of SETTINGS
    forget                 everything before, settings included
    drive SECONDS PERCENT  the motor receives this, at that time since the start
    click SECONDS          a hard, short sound, as of a key that is struck
    knock SECONDS          a dull one
    wav FILE SECONDS       writes the sound from 0 on, 16-bit mono
"""

from __future__ import annotations

import math
import random
import sys
import wave
from array import array
from bisect import insort
from pathlib import Path
from typing import Any, Final

from tega_emulators.pipe import notify, obey

__all__ = ["RATE_HZ", "SETTINGS", "MotorSound", "main"]

RATE_HZ: Final = 16_000

SETTINGS: Final = {
    "delay_ms": (60.0, "from the command to the first movement"),
    "rise_ms": (35.0, "time constant of its speed"),
    "fall_ms": (50.0, "likewise when it is let go"),
    "full_hz": (190.0, "turns a second at full drive; with little drive it turns slower"),
    "loud": (0.2, "amplitude at full drive, of full scale"),
    "noise": (0.002, "standard deviation of white noise"),
    "hum": (0.002, "amplitude of mains hum, 50 Hz and its third"),
    "gain": (1.0, "of the microphone; 0 is one that is not plugged in"),
    "seed": (0.0, "of the noise"),
}
_STARTS_ABOVE: Final = 8
_CLICK_S: Final = 0.004
_KNOCK_S: Final = 0.12


class MotorSound:
    """One motor, one microphone; ``settings`` are as in :data:`SETTINGS`."""

    def __init__(self) -> None:
        self.settings = {name: value for name, (value, _) in SETTINGS.items()}
        self._drives: list[tuple[float, float]] = []
        self._events: list[tuple[float, str]] = []
        self.restart()

    def restart(self) -> None:
        """Stand still, and begin again at sample 0."""
        self._n = 0
        self._next = 0
        self._wanted_hz = self._hz = self._phase = 0.0
        self._random = random.Random(int(self.settings["seed"]))

    def set(self, name: str, value: float) -> None:
        """Change a setting; an unknown one is a KeyError."""
        if name not in self.settings:
            raise KeyError(name)
        self.settings[name] = value

    def drive(self, at_s: float, percent: float) -> None:
        """Take a drive; times have to rise."""
        self._drives.append((at_s, percent))

    def strike(self, at_s: float, kind: str) -> None:
        """Sound a ``click`` or a ``knock``."""
        insort(self._events, (at_s, kind))

    def samples(self, until_s: float) -> array[int]:
        """Return the sound from where it stopped last up to a time, 16-bit samples."""
        s, out = self.settings, array("h")
        delay_s = s["delay_ms"] / 1e3
        rise = 1 - math.exp(-1e3 / (RATE_HZ * s["rise_ms"]))
        fall = 1 - math.exp(-1e3 / (RATE_HZ * s["fall_ms"]))
        turn = 2 * math.pi / RATE_HZ
        while self._n < until_s * RATE_HZ:
            t = self._n / RATE_HZ
            while self._next < len(self._drives) and t >= self._drives[self._next][0] + delay_s:
                percent = self._drives[self._next][1]
                share = 0.4 + 0.6 * percent / 100
                self._wanted_hz = s["full_hz"] * share if percent >= _STARTS_ABOVE else 0.0
                self._next += 1
            step = rise if self._wanted_hz > self._hz else fall
            self._hz += (self._wanted_hz - self._hz) * step
            self._phase += turn * self._hz
            force = s["loud"] * (self._hz / s["full_hz"]) ** 2
            received = force * (math.sin(self._phase) + 0.25 * math.sin(2 * self._phase + 0.4))
            received += s["hum"] * (math.sin(100 * math.pi * t) + 0.4 * math.sin(300 * math.pi * t))
            received += self._random.gauss(0.0, s["noise"]) + self._struck(t)
            out.append(round(32767 * max(-1.0, min(1.0, s["gain"] * received))))
            self._n += 1
        return out

    def _struck(self, t: float) -> float:
        received = 0.0
        for at_s, kind in self._events:
            age_s = t - at_s
            if 0 <= age_s < (_CLICK_S if kind == "click" else _KNOCK_S):
                fade = math.exp(-age_s / (0.001 if kind == "click" else 0.03))
                received += (
                    0.6 * fade * math.sin(2 * math.pi * (3500 if kind == "click" else 160) * age_s + 1)
                )
        return received


def write_wav(path: Path, samples: array[int]) -> None:
    """Write 16-bit mono."""
    if sys.byteorder == "big":
        samples = array("h", samples)
        samples.byteswap()
    with wave.open(str(path), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(RATE_HZ)
        file.writeframes(samples.tobytes())


def main() -> None:
    """Run it until the standard input closes."""
    sound = MotorSound()

    def act(words: list[str]) -> dict[str, Any]:
        nonlocal sound
        match words:
            case ["forget"]:
                sound = MotorSound()
            case ["set", name, value]:
                sound.set(name, float(value))
            case ["drive", at_s, percent]:
                sound.drive(float(at_s), float(percent))
            case ["click" | "knock" as kind, at_s]:
                sound.strike(float(at_s), kind)
            case ["wav", path, seconds]:
                sound.restart()
                write_wav(Path(path), sound.samples(float(seconds)))
            case _:
                raise ValueError("there are set, forget, drive, click, knock, wav")
        return {}

    notify({"rate_hz": RATE_HZ})
    for line in sys.stdin:
        obey(line, act)


if __name__ == "__main__":
    main()
