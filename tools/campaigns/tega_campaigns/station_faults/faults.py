"""The faults."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Literal

from tega_campaigns.program import REFUSED
from tega_campaigns.runner import until
from tega_campaigns.station_faults.scene import SECOND, StationScene
from tega_campaigns.station_faults.trials import StationFault
from tega_link.keys import make_keys

__all__ = ["FAULTS", "WIRE_FAULTS"]


def _nothing(_scene: StationScene) -> None:
    pass


def _worse(part: Literal["link", "wire"] = "link", /, **how: float) -> Callable[[StationScene], None]:
    def begin(scene: StationScene) -> None:
        for name, value in how.items():
            setattr(getattr(scene, part), name, value)

    return begin


_well = _worse(delay_ms=0.0, jitter_ms=0.0, loss=0.0)


def _other_operator(scene: StationScene, settings: Path, words: str) -> None:
    """Have another operator ask for the lead; it has to be told no, and to end."""
    with scene.station_of(settings) as other:
        other.start()
        until(lambda: not other.alive, 30.0)
        until(lambda: other.has_said(words) is not None, 1.0)
        reported_s, code = other.has_said(words), other.end()
    scene.others_said = [line for line in other.lines if words in str(line.said)]
    begun_s = other.has_said("begins")
    if reported_s is not None and begun_s is not None and code == REFUSED:
        scene.refused_s = reported_s - begun_s


def _second_operator(scene: StationScene) -> None:
    _other_operator(scene, scene.files("second-", keys=scene.keys, name=SECOND)[1], "is led by 'operator'")


def _same_certificate(scene: StationScene) -> None:
    _other_operator(scene, scene.files("same-", keys=scene.keys)[1], "is led by 'operator'")


def _wrong_certificate(scene: StationScene) -> None:
    keys = scene.folder / "other-keys"
    make_keys(keys, operators=["operator"], robots=["robot"])
    _other_operator(scene, scene.files("wrong-", keys=keys)[1], "answers at")


_HOLDS = "hand keeps its level, then opens; arm holds, lets go, stops; vest silent"
_ON = "all goes on"
_SHORT = "all goes on, or holds until a young command comes"

# The clocks' offset is known from the last ten seconds: longer than that, and only what is late is left of it.
_LEARNT_S = 12.0
_PATIENT = {"ttl_ms": 250.0}

FAULTS = (
    StationFault("link lost for 5 s", _HOLDS, lambda s: s.link.cut(), lambda s: s.link.mend(), lasts_s=5.0),
    StationFault(
        "operator's program frozen for 3 s",
        _HOLDS,
        lambda s: s.operator.hold_up(on=True),
        lambda s: s.operator.hold_up(on=False),
        vest="its program stands still: the vest's own watchdog",
    ),
    StationFault(
        "robot's program frozen for 3 s",
        "arm's own program holds it; vest silent",
        lambda s: s.robot.hold_up(on=True),
        lambda s: s.robot.hold_up(on=False),
    ),
    StationFault("3 s stall, then all at once", _HOLDS, lambda s: s.link.stall(), lambda s: s.link.resume()),
    StationFault(
        "the same, `lease_ms` = 10 000",
        _HOLDS + "; nothing of the burst is used",
        lambda s: s.link.stall(),
        lambda s: s.link.resume(),
        net={"lease_ms": 10_000.0},
    ),
    StationFault(
        "0.25 s stall, then all at once",
        "arm holds and goes on, hand keeps its level, vest silent",
        lambda s: s.link.stall(),
        lambda s: s.link.resume(),
        lasts_s=0.25,
    ),
    *(
        StationFault(
            f"{share} % of segments lost",
            _SHORT,
            _worse(loss=share / 100),
            _well,
            lasts_s=8.0,
            interrupts=None,
        )
        for share in (1, 5)
    ),
    StationFault(
        "20 ms later each way", _ON, _worse(delay_ms=20.0), _well, lasts_s=_LEARNT_S, interrupts=False
    ),
    StationFault(
        "50 ms later each way",
        "goes on for 10 s, while the clocks are known from before; then all may be too old, as without a link",
        _worse(delay_ms=50.0),
        _well,
        lasts_s=_LEARNT_S,
    ),
    *(
        StationFault(
            f"{ms} ms later each way",
            "as without a link: all is too old",
            _worse(delay_ms=float(ms)),
            _well,
            lasts_s=4.0,
        )
        for ms in (100, 200)
    ),
    StationFault(
        "50 ms later each way, `ttl_ms` = 250",
        _ON,
        _worse(delay_ms=50.0),
        _well,
        lasts_s=_LEARNT_S,
        interrupts=False,
        net=_PATIENT,
    ),
    StationFault(
        "100 ms later each way, `ttl_ms` = 250",
        "hand goes on; arm and vest have limits of 100 ms of their own",
        _worse(delay_ms=100.0),
        _well,
        lasts_s=_LEARNT_S,
        interrupts=None,
        net=_PATIENT,
    ),
    StationFault(
        "wrong certificate, while somebody leads",
        _ON + "; the other is refused",
        _wrong_certificate,
        _nothing,
        lasts_s=0.0,
        interrupts=False,
        keys=True,
        refuses=True,
    ),
    StationFault(
        "two operators at once, each with a certificate",
        _ON + "; the second is told who leads",
        _second_operator,
        _nothing,
        lasts_s=0.0,
        interrupts=False,
        keys=True,
        refuses=True,
    ),
    StationFault(
        "two operators at once, with the same certificate",
        _ON + "; the second is told who leads",
        _same_certificate,
        _nothing,
        lasts_s=0.0,
        interrupts=False,
        keys=True,
        refuses=True,
    ),
    StationFault(
        "robot's program killed, started again after 3 s",
        "vest silent; then an arm that nobody holds, an open hand",
        lambda s: s.robot.kill(),
        lambda s: s.robot.start(),
    ),
    StationFault(
        "operator's program killed, started again after 3 s",
        _HOLDS,
        lambda s: s.operator.kill(),
        lambda s: s.operator.start(),
        vest="its program is gone: the vest's own watchdog",
    ),
)


_well_wired = _worse("wire", delay_ms=0.0, loss=0.0, reorder=0.0)

WIRE_FAULTS = tuple(
    StationFault(
        name,
        wish,
        _worse("wire", **how),
        _well_wired,
        lasts_s=_LEARNT_S,
        interrupts=interrupts,
        keys=True,
        wire=True,
    )
    for name, wish, how, interrupts in (
        ("1 % of packets lost", _SHORT, {"loss": 0.01}, None),
        ("5 % of packets lost", _SHORT, {"loss": 0.05}, None),
        ("a fifth of packets 10 ms late, overtaken by others", _ON, {"reorder": 0.2}, None),
        ("1 % lost, 20 ms later each way", _SHORT, {"loss": 0.01, "delay_ms": 20.0}, None),
        ("5 % lost, 20 ms later each way", _SHORT, {"loss": 0.05, "delay_ms": 20.0}, None),
    )
)
"""On a wire of packets, with keys; needs root."""
