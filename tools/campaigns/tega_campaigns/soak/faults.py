"""Makes the faults of a soak on its emulated devices, its link and its programs, and takes them away; its settings."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from typing import Any

from tega.hand import TORQUE_LIMITS
from tega_campaigns.impaired import ImpairedLink
from tega_campaigns.soak.plan import Kind
from tega_campaigns.soak.programs import Programs
from tega_emulators.lab import EmulatedLab

__all__ = ["Breaker", "soak_settings"]

_CLOCK_S = 3600.0
# What ends a fault of the tracker, where "clear" does not.
_TRACKER_AGAIN = {"hide": "show", "late 400": "late 0", "lose": "find"}


def _link_board(folder: Path, lab: EmulatedLab) -> Path:
    """Give the board's port its name, as udev gives it the same one wherever it is plugged in, and return that."""
    port = folder / "board"
    port.unlink(missing_ok=True)
    port.symlink_to(lab.emg.port)
    return port


class Breaker:
    """Breaks one thing and mends it.

    ``link`` is between two stations; ``None`` with one program. The board's port has its name in ``folder``.
    ``held`` is when a program was given no time on purpose, as times of day, ns.
    """

    def __init__(self, lab: EmulatedLab, programs: Programs, link: ImpairedLink | None, folder: Path) -> None:
        self._lab, self._programs, self._link, self._folder = lab, programs, link, folder
        self.held: list[tuple[int, int]] = []

    def make(self, kind: Kind) -> None:
        """Make a fault; a kill of a program is none of these."""
        lab, programs = self._lab, self._programs
        match kind.device:
            case "emg":
                lab.emg.say(kind.how)
            case "hand":
                lab.hand.say(kind.how)
                if kind.how == "freeze":
                    # Angles that do not change are noticed where the hand is to move: the muscles let go.
                    lab.emg.say("signal flat")
            case "vest":
                lab.vest.say(kind.how)
            case "pedal":
                lab.pedal.say(kind.how)
            case "tracker":
                lab.headset.say(kind.how)
            case "arm" | "recorder":
                self._signal(kind.device, signal.SIGKILL if kind.how == "kill" else signal.SIGSTOP)
            case "link":
                self._worsen(kind.how)
            case "program" | "robot" | "operator":
                programs[kind.device].hold_up(on=True)
                self.held.append((time.time_ns(), 0))
            case "computer" if kind.how == "disk":
                programs.main.fill_disk(full=True)
            case "computer":
                programs.notify(f"clock {_CLOCK_S}")
            case finger:
                lab.sensors[finger].say(kind.how)

    def holds_up(self, kind: Kind) -> bool:
        """Whether a fault gives a program that leads devices no time."""
        return kind.device in {"program", "robot", "operator"} and kind.how == "stop"

    def mend(self, kind: Kind) -> None:
        """Take a fault away."""
        lab, programs = self._lab, self._programs
        match kind.device:
            case "emg" if kind.how == "unplug":
                lab.emg.say("plug")
                _link_board(self._folder, lab)
            case "emg":
                lab.emg.say("clear")
                lab.emg.say("signal emg")
            case "hand":
                lab.hand.say("clear")
                lab.emg.say("signal emg")
            case "vest":
                lab.vest.say("clear")
            case "pedal":
                lab.pedal.say("plug" if kind.how == "unplug" else "clear")
            case "tracker":
                lab.headset.say(_TRACKER_AGAIN.get(kind.how, "clear"))
            case "arm" | "recorder":
                self._signal(kind.device, signal.SIGCONT)
            case "link":
                self._mend_link(kind.how)
            case "program" | "robot" | "operator":
                programs[kind.device].hold_up(on=False)
                self.held[-1] = (self.held[-1][0], time.time_ns())
            case "computer" if kind.how == "disk":
                programs.main.fill_disk(full=False)
            case "computer":
                programs.notify(f"clock -{_CLOCK_S}")
            case finger:
                lab.sensors[finger].say("clear")
                lab.sensors[finger].say("press 1")

    def _signal(self, whose: str, number: signal.Signals) -> None:
        run = self._programs.main
        if (pid := run.arm_process() if whose == "arm" else run.recorder_process()) is not None:
            os.kill(pid, number)

    def _worsen(self, how: str) -> None:
        assert self._link is not None
        name, _, value = how.partition(" ")
        if how == "cut":
            self._link.cut()
        elif how == "stall":
            self._link.stall()
        else:
            setattr(self._link, name, float(value))

    def _mend_link(self, how: str) -> None:
        assert self._link is not None
        if how == "cut":
            self._link.mend()
        elif how == "stall":
            self._link.resume()
        else:
            self._link.delay_ms = self._link.loss = 0.0


VEST_LIMIT = 60
HEAT_SHARE = 0.3
TORQUE_SHARE = 0.2
SLEW = 0.05
# The emulated vest's sum of heat is taken in other steps than the driver's.
_HEAT_SLACK = 0.02


def soak_settings(lab: EmulatedLab, folder: Path, *, patient: bool) -> dict[str, Any]:
    """Return settings with limits that a run without them would break, and set what the emulators count."""
    tree = lab.tree
    lab.vest.say(f"limit {VEST_LIMIT} {HEAT_SHARE + _HEAT_SLACK}")
    lab.hand.say("limit " + " ".join(str(v) for v in (SLEW, *(TORQUE_LIMITS * TORQUE_SHARE))))
    tree["vest"]["options"] |= {"limit": VEST_LIMIT, "heat_share": HEAT_SHARE}
    hand = tree["hand"]["options"]
    hand["torque_share"] = TORQUE_SHARE
    for name in ("silent_after_ms", "lowest_rate_hz", "reconnects"):
        hand.pop(name, None)  # as they come
    if patient:
        # A machine that is shared holds an emulated hand up now and then.
        hand |= {"silent_after_ms": 1000.0, "reconnects": 20, "lowest_rate_hz": 0.0}
    tree["emg"]["options"]["port"] = str(_link_board(folder, lab))
    tree["recording"] = {"dir": str(folder / "session"), "stop_free_mib": 64.0, "warn_free_mib": 64.0}
    return tree
