"""Define the table ``[safety]`` of a session's settings."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec

_Ms = Annotated[float, msgspec.Meta(ge=0, le=600_000)]


class SafetySection(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Consequences of each hazard. It concerns live devices; recordings do not get lost.

    Attributes:
        emg_lost_ms: Without a block of EMG for so long beyond its time, the hand holds its level.
        hold_ms: So long it holds; then see ``then``.
        then: ``open`` opens the hand when the hold is over, ``keep`` holds until all devices are ready again.
        tactile_lost: ``silent`` goes on with the finger's column silent, ``hold`` holds the level as well.
        vest_lost: ``go-on`` goes on and warns, ``hold`` holds the level.
        late_ms: A loop later than this holds the level.
        settle_ms: So long nothing may be wrong before the run arms or goes on.
        lowest_rate_share: A stream has to come at this share of its rate before the run arms.
        latency_budget_ms: Limit of our own part of the latency from camera to vest, 99 frames of 100.
        joint_budget_ms: Time from a muscle's sample to the first motion of a joint; beyond it an alert names the stage.
    """

    emg_lost_ms: Annotated[float, msgspec.Meta(ge=20, le=5000)] = 150.0
    hold_ms: _Ms = 2000.0
    then: Literal["open", "keep"] = "open"
    tactile_lost: Literal["silent", "hold"] = "silent"
    vest_lost: Literal["go-on", "hold"] = "go-on"
    late_ms: Annotated[float, msgspec.Meta(ge=5, le=5000)] = 100.0
    settle_ms: _Ms = 200.0
    lowest_rate_share: Annotated[float, msgspec.Meta(ge=0, le=1)] = 0.5
    latency_budget_ms: Annotated[float, msgspec.Meta(gt=0, le=1000)] = 5.0
    joint_budget_ms: Annotated[float, msgspec.Meta(gt=0, le=5000)] = 300.0
