"""How a fault is tried, and what comes of it."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

import msgspec

from tega_campaigns.runner import until
from tega_campaigns.station_faults.scene import StationScene
from tega_campaigns.station_faults.setups import Setups

__all__ = ["StationFault", "StationOutcome", "try_fault"]

_CALM_S = 1.0
_BACK_S = 40.0
_ATTEMPTS = 5


class StationFault(msgspec.Struct, frozen=True):
    """One thing that goes wrong.

    Attributes:
        name: Short.
        wish: What hand, arm and vest shall do, in words.
        begin: Makes it happen.
        end: Ends it.
        lasts_s: How long between the two.
        interrupts: Whether robot and arm shall stop obeying while it lasts; ``None`` where either is right.
        comes_back: Whether the stations shall come together again by themselves.
        net: Further settings of ``[net]``, for both stations.
        keys: Whether the link is encrypted.
        wire: Whether it is one of packets, between network namespaces.
        refuses: Whether another operator has to be told no.
        vest: What it does, where no station is left to tell.
    """

    name: str
    wish: str
    begin: Callable[[StationScene], object]
    end: Callable[[StationScene], object]
    lasts_s: float = 3.0
    interrupts: bool | None = True
    comes_back: bool = True
    net: Mapping[str, Any] = {}
    keys: bool = False
    wire: bool = False
    refuses: bool = False
    vest: str = ""


class StationOutcome(msgspec.Struct, frozen=True):
    """What came of it; times are seconds after its beginning unless said otherwise.

    Attributes:
        hand: What the hand's run was, and from when.
        arm: What the arm did, and from when.
        silent_s: When the vest fell silent for good; ``None`` if it did not.
        no_data_s: When the operator's station said that no data comes from the robot; ``None`` if it did not.
        seen_s: When hand, arm or vest first did something else; ``None`` if they never did.
        over_s: After its end, until muscles steer the hand and touch is felt again; 0 where that never stopped,
            ``None`` if they did not come back.
        refused_s: When another operator's program was told no, seconds after it began; ``None`` without one.
        used: Commands used from its beginning on.
        stale: Of those, the ones that were used though really older than the time-to-live.
        oldest_ms: The oldest one used.
        said: What the stations told people of it.
        as_wished: Whether hand, arm, vest and commands did as they should.
    """

    hand: list[tuple[float, str]]
    arm: list[tuple[float, str]]
    silent_s: float | None
    no_data_s: float | None
    seen_s: float | None
    over_s: float | None
    refused_s: float | None
    used: int
    stale: int
    oldest_ms: float
    said: list[str]
    as_wished: bool


def try_fault(fault: StationFault, setups: Setups) -> StationOutcome:
    """Let it happen between two stations, and look.

    Raises:
        DeviceUnavailableError: The stations do not come together in the first place.
    """
    scene = setups.scene(net=fault.net, keys=fault.keys, wire=fault.wire)
    scene.refused_s, scene.others_said = None, ()
    for _ in range(_ATTEMPTS):
        time.sleep(_CALM_S)
        if scene.steers():
            break
        scene.take_hold()  # a busy machine has made them hold by itself
    begun_s, before = time.monotonic(), scene.robot.now
    fault.begin(scene)
    time.sleep(max(0.0, begun_s + fault.lasts_s - time.monotonic()))
    ended_s = time.monotonic()
    went = not scene.ready()
    fault.end(scene)
    over_s = None
    if (
        fault.comes_back
        and until(lambda: scene.ready() and scene.robot.newest.at_s > ended_s, _BACK_S) is not None
    ):
        over_s = time.monotonic() - ended_s if went else 0.0
    time.sleep(_CALM_S)
    return _outcome(fault, scene, begun_s=begun_s, ended_s=ended_s, over_s=over_s, before=before)


def _outcome(
    fault: StationFault,
    scene: StationScene,
    *,
    begun_s: float,
    ended_s: float,
    over_s: float | None,
    before: dict[str, Any],
) -> StationOutcome:
    def after(changes: list[tuple[float, Any]]) -> list[tuple[float, Any]]:
        return [(round(t_s - begun_s, 3), subject) for t_s, subject in changes]

    robot, operator = scene.robot, scene.operator
    hand = after(robot.since(begun_s, "state"))
    arm = [(t, str(words).partition(":")[0]) for t, words in after(robot.since(begun_s, "arm"))]
    arm = [one for k, one in enumerate(arm) if k == 0 or one[1] != arm[k - 1][1]]
    felt = [one for one in after(operator.since(begun_s, "felt")) if one[0] <= ended_s - begun_s]
    no_data = [t for t, is_so in after(operator.since(begun_s, "no_data")) if is_so]
    acted = [t for t, state in hand if state != "active"] + [t for t, state in arm if state != "following"]
    now = {"used": 0, "stale": 0, **robot.now}
    # Of a station that was started again the counts begin anew.
    same = now["used"] >= before["used"]
    used, stale = (now[key] - (before[key] if same else 0) for key in ("used", "stale"))
    ages_ms = [text["oldest_ms"] for at_s, text in robot.lines if at_s > begun_s and "oldest_ms" in text]
    interrupted = bool(acted)
    silent_s = felt[-1][0] if felt and not felt[-1][1] else None
    if silent_s is not None:
        acted.append(silent_s)
    met = fault.interrupts is None or interrupted == fault.interrupts
    text = [
        str(text.get("said", text.get("ended")))
        for at_s, text in sorted(
            [*robot.lines, *operator.lines, *scene.others_said], key=lambda line: line.at_s
        )
        if at_s > begun_s and text.keys() & {"said", "ended"}
    ]
    return StationOutcome(
        hand=hand,
        arm=arm,
        silent_s=silent_s,
        no_data_s=no_data[0] if no_data else None,
        seen_s=min(acted) if acted else None,
        over_s=None if over_s is None else round(over_s, 3),
        refused_s=None if scene.refused_s is None else round(scene.refused_s, 3),
        used=used,
        stale=stale,
        oldest_ms=round(max(ages_ms, default=0.0), 1),
        said=text,
        as_wished=met
        and stale == 0
        and (over_s is not None or not fault.comes_back)
        and (scene.refused_s is not None) == fault.refuses,
    )
