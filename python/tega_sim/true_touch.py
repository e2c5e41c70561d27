"""Show the wearer, or a reflex, the truth of the simulated world instead of the measurements: positive controls.

The loop is unchanged: it measures every camera frame, and its tables and displays have its measurements. Only the
vest's frames come from the truth, at the same rate, by a mapping of the real vest, and they reach the skin in the
same way.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Final

import msgspec

from tega.config import FINGERS, ReflexSection, SessionConfig, StageConfig, StagesSection
from tega.config.calibration import TouchMaxima
from tega.config.choose import felt_map, grip_reflex, vest_mapping
from tega.haptics import FeltMap, Layout, Mirror, MotorLevels
from tega.loop.reflex import ReflexArc, ReflexInputs
from tega.loop.touch import TouchLoop
from tega.records import Contact, Event, NamedValue
from tega.records.bus import Bus
from tega.stages.base import Mapping as MappingStage
from tega.stages.base import Reflex, VestSetup
from tega_sim.conditions import ARMS, ReflexReports, Reports
from tega_sim.lab import Lab
from tega_sim.plan import FULL_N, TrialPlan
from tega_sim.score import REST_M_S, REST_S, SLIP_M_S
from tega_sim.seams import WorldTruth

FULL_REFLEX: Final = ReflexSection(name="grip", authority=1.0)
"""Reflex of the arms that have one, where the settings name none; authority of it, where they give none."""


class TrueSlipArc(ReflexArc):
    """A reflex arc that receives the true slide through the grasp on every loaded finger, and no events."""

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

    def step(self, t_ns: int, own: float, contacts: Callable[[], Mapping[str, Contact]]) -> float:  # noqa: ARG002
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
    settings, replace = config.stages.reflex, msgspec.structs.replace
    if reports != "none" and settings.name is None:
        settings = FULL_REFLEX
    elif reports != "none" and settings.authority == 0:
        settings = replace(settings, authority=FULL_REFLEX.authority)
    reflex = grip_reflex(replace(config.stages, reflex=settings), config.session.preset, FINGERS)
    if reflex is None:
        return None

    def snapshot(_t_ns: int) -> ReflexInputs:
        measured = closure() if settings.authority > 0 else None
        return ReflexInputs(settings.authority, allowed=True, measured=measured)

    if reports == "true slips":
        return TrueSlipArc(reflex, settings, snapshot=snapshot, slip_mm_s=slip_mm_s, forces_n=forces_n)
    return ReflexArc(reflex, settings, snapshot=snapshot, notify=bus.publish)


_FORCE: Final = {"front": "force_n", "back": "force_n", "front_max": FULL_N, "back_max": FULL_N}
_DISPLAYED: Final[dict[Reports, StageConfig]] = {
    "true slips": StageConfig("pulses", {"contact": 0.0, "release": 0.0}),
    "true force": StageConfig("columns", _FORCE),
    "true force, equal steps": StageConfig("equal-steps", _FORCE),
    "true force, linear": StageConfig("columns", {**_FORCE, "law": "linear"}),
}


class TrueTouch(TouchLoop):
    """Makes vest frames of the world's truth, and everything else of the measured contacts.

    A slip begins when the object, off the table, slides down through the grasp at 5 mm/s, the speed by which
    slips are counted, and is over when it has rested for 0.2 s. It is shown at once. Counted slips last at
    least 30 ms and reach 3 mm, which cannot be known at the start.

    ``mirror`` is which faces have their columns reversed, ``felt`` the wearer's thresholds and steps where
    they are known; ``mapping`` makes the mapping of measured contacts, for display.
    """

    def __init__(
        self,
        reports: Reports,
        maxima: Mapping[str, TouchMaxima],
        *,
        layout: Layout,
        mirror: Mirror = "none",
        felt: FeltMap | None = None,
        mapping: Callable[[VestSetup], MappingStage] | None = None,
    ) -> None:
        super().__init__(maxima, layout=layout, mirror=mirror, felt=felt, mapping=mapping)
        displayed: Any = vest_mapping(StagesSection(mapping=_DISPLAYED[reports]), "live")
        self._reported = TouchLoop(maxima, layout=layout, mirror=mirror, felt=felt, mapping=displayed)
        self._forces_n: tuple[float, ...] = (0.0,) * len(FINGERS)
        self._slips: list[Event] = []
        self._slid_s: float | None = None

    def watch(self, t_s: float, truth: WorldTruth) -> None:
        """Note the current true state; called a hundred times a second."""
        self._forces_n = truth.pad_force_n
        if self._slid_s is not None and t_s - self._slid_s >= REST_S:
            self._slid_s = None
        if not truth.lift_off or truth.dropped:
            return
        if truth.slip_m_s >= SLIP_M_S and self._slid_s is None:
            t_ns = round(t_s * 1e9)
            self._slips.append(Event(t_ns=t_ns, finger="", kind="slip", began_ns=t_ns))
            self._slid_s = t_s
        elif truth.slip_m_s >= REST_M_S and self._slid_s is not None:
            self._slid_s = t_s

    def frame(self, t_ns: int) -> MotorLevels:
        """Return the vest frame for the current true state."""
        contacts = {
            finger: Contact(finger=finger, t_ns=t_ns, in_contact=force_n > 0, force_n=force_n)
            for finger, force_n in zip(FINGERS, self._forces_n, strict=True)
        }
        slips, self._slips = self._slips, []
        return self._reported.displayed(t_ns, contacts, slips)


def stages_of(lab: Lab, plan: TrialPlan) -> StagesSection:
    """Return the stages of a trial: those of its settings, with the mapping that its condition has."""
    stages = lab.config.stages
    if ARMS[plan.condition].reports != "events":
        return stages
    return msgspec.structs.replace(stages, mapping=StageConfig(name="pulses"))


def touch_of(lab: Lab, plan: TrialPlan, *, layout: Layout) -> TouchLoop:
    """Return the source of the vest's frames in a trial: the measurements or the truth."""
    vest, reports = lab.config.vest, ARMS[plan.condition].reports
    make = partial(TrueTouch, reports) if reports in _DISPLAYED else TouchLoop
    mapping = vest_mapping(stages_of(lab, plan), plan.preset)
    return make(lab.touch, layout=layout, mirror=vest.mirror, felt=felt_map(vest), mapping=mapping)
