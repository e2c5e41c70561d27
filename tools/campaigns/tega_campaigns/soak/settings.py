"""Settings of a soak, with limits that a run without them would break."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tega.hand import TORQUE_LIMITS
from tega_campaigns.soak.faults import link_board
from tega_emulators.lab import EmulatedLab

__all__ = ["soak_settings"]

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
    tree["emg"]["options"]["port"] = str(link_board(folder, lab))
    tree["recording"] = {"dir": str(folder / "session"), "stop_free_mib": 64.0, "warn_free_mib": 64.0}
    return tree
