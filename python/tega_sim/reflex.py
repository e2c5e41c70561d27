"""Give a simulated trial the settings' reflex, fed by the loop's measurements or by the world's truth."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Final

import msgspec

from tega.config import FINGERS, ReflexSection, SessionConfig
from tega.config.choose import grip_reflex
from tega.loop.reflex import ReflexArc, ReflexInputs
from tega.records import Contact, Event, NamedValue
from tega.records.bus import Bus
from tega.stages.base import Reflex
from tega_sim.conditions import ReflexReports

FULL_REFLEX: Final = ReflexSection(name="grip", authority=1.0)
"""Reflex of the arms that have one, where the settings name none; authority of it, where they give none."""


class TrueSlipArc(ReflexArc):
    """A reflex arc that receives the truth, on every finger that bears a force, and no events.

    It receives the speed of the slide through the grasp; ``forces_n`` are the true ones, thumb first.
    """

    def __init__(
        self,
        reflex: Reflex,
        settings: ReflexSection,
        *,
        snapshot: Callable[[int], ReflexInputs],
        slip_mm_s: Callable[[], float],
        forces_n: Callable[[], Sequence[float]],
    ) -> None:
        super().__init__(reflex, settings, snapshot=snapshot)
        self._slip_mm_s, self._forces_n = slip_mm_s, forces_n

    def on_event(self, event: Event) -> None:
        """Ignore events that were found in pictures."""

    def step(
        self,
        t_ns: int,
        own: float,
        contacts: Callable[[], Mapping[str, Contact]],  # noqa: ARG002
    ) -> float:
        """Return the addition of a tick, levels."""
        speed = NamedValue("slip_mm_s", self._slip_mm_s(), "mm/s")
        true = {
            name: Contact(finger=name, t_ns=t_ns, in_contact=force_n > 0, more=(speed,))
            for name, force_n in zip(FINGERS, self._forces_n(), strict=True)
        }
        return super().step(t_ns, own, lambda: true)


def trial_reflex(
    config: SessionConfig,
    reports: ReflexReports,
    bus: Bus,
    *,
    closure: Callable[[], float],
    slip_mm_s: Callable[[], float],
    forces_n: Callable[[], Sequence[float]],
) -> ReflexArc | None:
    """Make the reflex of a trial; ``None`` where neither its condition nor the settings have one.

    ``bus`` receives every addition. ``closure`` returns the hand's closure by its joints, levels;
    ``slip_mm_s`` the speed of the object's slide; ``forces_n`` the true force on each pad, thumb first.
    """
    stages = config.stages
    if reports != "none" and stages.reflex.name is None:
        stages = msgspec.structs.replace(stages, reflex=FULL_REFLEX)
    elif reports != "none" and stages.reflex.authority == 0:
        full = msgspec.structs.replace(stages.reflex, authority=FULL_REFLEX.authority)
        stages = msgspec.structs.replace(stages, reflex=full)
    settings = stages.reflex
    reflex = grip_reflex(stages, config.session.preset, FINGERS)
    if reflex is None:
        return None

    def snapshot(_t_ns: int) -> ReflexInputs:
        measured = closure() if settings.authority > 0 else None
        return ReflexInputs(settings.authority, allowed=True, measured=measured)

    if reports == "true slips":
        return TrueSlipArc(reflex, settings, snapshot=snapshot, slip_mm_s=slip_mm_s, forces_n=forces_n)
    return ReflexArc(reflex, settings, snapshot=snapshot, notify=bus.publish)
