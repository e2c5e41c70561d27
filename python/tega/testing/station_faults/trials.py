"""The faults, and how each is tried."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import msgspec

from tega.net.keys import make_keys
from tega.testing.lossy_wire import LossyWire
from tega.testing.station_faults.scene import Scene, Watch, until

__all__ = ["FAULTS", "WIRE_FAULTS", "Fault", "Outcome", "try_fault"]

_CALM_S = 1.0
_BACK_S = 20.0


class Fault(msgspec.Struct, frozen=True):
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
        vest: What it does, where no station is left to tell.
    """

    name: str
    wish: str
    begin: Callable[[Scene], None]
    end: Callable[[Scene], None]
    lasts_s: float = 3.0
    interrupts: bool | None = True
    comes_back: bool = True
    net: Mapping[str, Any] = {}
    keys: bool = False
    vest: str = ""


class Outcome(msgspec.Struct, frozen=True):
    """What came of it; times are seconds after its beginning unless said otherwise.

    Attributes:
        hand: What the hand's run was, and from when.
        arm: What the arm did, and from when.
        silent_s: When the vest fell silent for good; ``None`` if it did not.
        no_data_s: When the operator's station said that no data comes from the robot; ``None`` if it did not.
        seen_s: When hand, arm or vest first did something else; ``None`` if they never did.
        over_s: After its end, until muscles steer the hand and touch is felt again; 0 where that never stopped,
            ``None`` if they did not come back.
        used: Commands used from its beginning on.
        stale: Of all commands, those that were used though really older than the time-to-live.
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
    used: int
    stale: int
    oldest_ms: float
    said: list[str]
    as_wished: bool


def try_fault(fault: Fault) -> Outcome:
    """Start two stations, let it happen, and look.

    Raises:
        DeviceUnavailableError: The stations do not come together in the first place.
    """
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="tega-stations-")))
        wire = stack.enter_context(LossyWire()) if fault in WIRE_FAULTS else None
        keys = folder / "keys" if fault.keys else None
        if keys is not None:
            make_keys(keys, operators=["operator"], robots=["robot"])
        with Scene(folder, net=dict(fault.net), keys=keys, wire=wire) as scene:
            time.sleep(_CALM_S)
            begun_s, before = time.monotonic(), scene.robot.now
            fault.begin(scene)
            time.sleep(max(0.0, begun_s + fault.lasts_s - time.monotonic()))
            ended_s = time.monotonic()
            went = not scene.ready()
            fault.end(scene)
            back = fault.comes_back and until(
                lambda: scene.ready() and scene.robot.now["t_s"] > ended_s, patience_s=_BACK_S
            )
            over_s = None
            if back:
                over_s = time.monotonic() - ended_s if went else 0.0
            time.sleep(_CALM_S)
            return _outcome(fault, scene, begun_s=begun_s, ended_s=ended_s, over_s=over_s, before=before)


def _outcome(
    fault: Fault,
    scene: Scene,
    *,
    begun_s: float,
    ended_s: float,
    over_s: float | None,
    before: dict[str, Any],
) -> Outcome:
    def after(changes: list[tuple[float, Any]]) -> list[tuple[float, Any]]:
        return [(round(t_s - begun_s, 3), what) for t_s, what in changes]

    robot, operator = scene.robot, scene.operator
    hand = after(robot.since(begun_s, "state"))
    arm = [(t, str(words).partition(":")[0]) for t, words in after(robot.since(begun_s, "arm"))]
    arm = [one for k, one in enumerate(arm) if k == 0 or one[1] != arm[k - 1][1]]
    felt = [one for one in after(operator.since(begun_s, "felt")) if one[0] <= ended_s - begun_s]
    no_data = [t for t, is_so in after(operator.since(begun_s, "no_data")) if is_so]
    acted = [t for t, state in hand if state != "active"] + [t for t, state in arm if state != "following"]
    now = robot.now
    # Of a station that was started again the counts begin anew.
    used = now["used"] - (before["used"] if now["used"] >= before["used"] else 0)
    interrupted = bool(acted)
    silent_s = felt[-1][0] if felt and not felt[-1][1] else None
    if silent_s is not None:
        acted.append(silent_s)
    met = fault.interrupts is None or interrupted == fault.interrupts
    said = [
        one["said"]
        for one in sorted(robot.told + operator.told, key=lambda one: one["t_s"])
        if one["t_s"] > begun_s and "said" in one
    ]
    return Outcome(
        hand=hand,
        arm=arm,
        silent_s=silent_s,
        no_data_s=no_data[0] if no_data else None,
        seen_s=min(acted) if acted else None,
        over_s=None if over_s is None else round(over_s, 3),
        used=used,
        stale=now["stale"],
        oldest_ms=round(now["oldest_ms"], 1),
        said=said,
        as_wished=met and now["stale"] == 0 and (over_s is not None or not fault.comes_back),
    )


def _nothing(_scene: Scene) -> None:
    pass


def _worse(**how: float) -> Callable[[Scene], None]:
    def begin(scene: Scene) -> None:
        for name, value in how.items():
            setattr(scene.link, name, value)

    return begin


_well = _worse(delay_ms=0.0, jitter_ms=0.0, loss=0.0)


def _other_operator(scene: Scene, settings: Path, words: str) -> None:
    """Have another operator ask for the lead; it has to be told no, and to end."""
    with Watch(settings, "--cap", str(scene.lab.cap.port)) as other:
        until(lambda: other.process.poll() is not None, patience_s=30.0)
        until(lambda: other.has_said(words) is not None, patience_s=1.0)
        scene.operator.told.extend(one for one in list(other.told) if words in one.get("said", ""))


def _second_operator(scene: Scene) -> None:
    _other_operator(scene, scene.files("second-", keys=None, name="bob")[1], "is led by")


def _wrong_certificate(scene: Scene) -> None:
    keys = scene.folder / "other-keys"
    make_keys(keys, operators=["operator"], robots=["robot"])
    _other_operator(scene, scene.files("wrong-", keys=keys)[1], "answers at")


def _restart_robot(scene: Scene) -> None:
    scene.robot.kill()


def _robot_again(scene: Scene) -> None:
    scene.robot.follow(scene.start_robot())


def _operator_again(scene: Scene) -> None:
    scene.operator.follow(scene.start_operator())


_HOLDS = "hand keeps its level, then opens; arm holds, lets go, stops; vest silent"
_ON = "all goes on"
_SHORT = "all goes on, or holds until a young command comes"

FAULTS = (
    Fault("link lost for 5 s", _HOLDS, lambda s: s.link.cut(), lambda s: s.link.mend(), lasts_s=5.0),
    Fault(
        "operator's program frozen for 3 s",
        _HOLDS,
        lambda s: s.operator.freeze(),
        lambda s: s.operator.go_on(),
        vest="its program stands still: the vest's own watchdog",
    ),
    Fault(
        "robot's program frozen for 3 s",
        "arm's own program holds it; vest silent",
        lambda s: s.robot.freeze(),
        lambda s: s.robot.go_on(),
    ),
    Fault("3 s stall, then all at once", _HOLDS, lambda s: s.link.stall(), lambda s: s.link.resume()),
    Fault(
        "the same, `lease_ms` = 10 000",
        _HOLDS + "; nothing of the burst is used",
        lambda s: s.link.stall(),
        lambda s: s.link.resume(),
        net={"lease_ms": 10_000.0},
    ),
    Fault(
        "0.25 s stall, then all at once",
        "arm holds and goes on, hand keeps its level, vest silent",
        lambda s: s.link.stall(),
        lambda s: s.link.resume(),
        lasts_s=0.25,
    ),
    *(
        Fault(
            f"{share} % of segments lost",
            _SHORT,
            _worse(loss=share / 100),
            _well,
            lasts_s=10.0,
            interrupts=None,
        )
        for share in (1, 5)
    ),
    *(
        Fault(
            f"{ms} ms later each way", _ON, _worse(delay_ms=float(ms)), _well, lasts_s=5.0, interrupts=False
        )
        for ms in (20, 50)
    ),
    *(
        Fault(
            f"{ms} ms later each way",
            "as without a link: all is too old",
            _worse(delay_ms=float(ms)),
            _well,
            lasts_s=5.0,
        )
        for ms in (100, 200)
    ),
    Fault(
        "100 ms later each way, `ttl_ms` = 250",
        "hand goes on; arm and vest have limits of 100 ms of their own",
        _worse(delay_ms=100.0),
        _well,
        lasts_s=5.0,
        interrupts=None,
        net={"ttl_ms": 250.0},
    ),
    Fault(
        "wrong certificate, while somebody leads",
        _ON + "; the other is refused",
        _wrong_certificate,
        _nothing,
        lasts_s=0.0,
        interrupts=False,
        keys=True,
    ),
    Fault(
        "two operators at once",
        _ON + "; the second is told who leads",
        _second_operator,
        _nothing,
        lasts_s=0.0,
        interrupts=False,
    ),
    Fault(
        "robot's program killed, started again after 3 s",
        "vest silent; then an arm that nobody holds, an open hand",
        _restart_robot,
        _robot_again,
    ),
    Fault(
        "operator's program killed, started again after 3 s",
        _HOLDS,
        lambda s: s.operator.kill(),
        _operator_again,
        vest="its program is gone: the vest's own watchdog",
    ),
)


def _wire(**how: float) -> Callable[[Scene], None]:
    def begin(scene: Scene) -> None:
        for name, value in how.items():
            setattr(scene.wire, name, value)

    return begin


_well_wired = _wire(delay_ms=0.0, loss=0.0, reorder=0.0)

WIRE_FAULTS = tuple(
    Fault(name, wish, _wire(**how), _well_wired, lasts_s=15.0, interrupts=interrupts, keys=True)
    for name, wish, how, interrupts in (
        ("1 % of packets lost", _SHORT, {"loss": 0.01}, None),
        ("5 % of packets lost", _SHORT, {"loss": 0.05}, None),
        ("a fifth of packets 10 ms late, overtaken by others", _ON, {"reorder": 0.2}, None),
        ("1 % lost, 20 ms later each way", _SHORT, {"loss": 0.01, "delay_ms": 20.0}, None),
        ("5 % lost, 20 ms later each way", _SHORT, {"loss": 0.05, "delay_ms": 20.0}, None),
    )
)
"""On a wire of packets, with keys; needs root."""
