"""What a soak takes for the report of a fault: words about that fault, and no others."""

from __future__ import annotations

from typing import Any

import pytest

from tega.arm.gate import JUMPED
from tega.arm.settings import WatchdogSettings
from tega.arm.watch import ArmWatch
from tega_campaigns.soak.plan import KINDS, STATION_KINDS, Kind

_EVERY = {*KINDS, *STATION_KINDS}
_LATER_NS = 200_000_000
_LET_GO = ("holding", "idle", "stopped")


def _watch(*, poses: bool, arm: bool, refusal: str = "") -> str:
    """Return why an arm lets go, 200 ms after poses and arm were heard at last; or one of them just now."""
    watch = ArmWatch(WatchdogSettings())
    watch.believed(_LATER_NS if poses else 0)
    watch.arm(_LATER_NS if arm else 0)
    if refusal:
        watch.refused(_LATER_NS, refusal)
    return watch.trouble(_LATER_NS, 0.0).reason


def _line(
    alert: str = "", *, reason: str = "all devices ready", state: str = "active", arm: str = ""
) -> dict[str, Any]:
    """Return a line of a run that is well but for what is given."""
    return {
        "state": state,
        "reason": reason,
        "alerts": [alert] if alert else [],
        "arm": arm or "following: the arm follows the forearm",
        "felt": True,
        "rss_mib": 110.0,
    }


def _held(reason: str) -> dict[str, Any]:
    return _line(reason=reason, state="hold")


_NO_POSE = _watch(poses=False, arm=True)
_LOST = _watch(poses=False, arm=True, refusal="the tracker calls it lost")
_NO_ARM = _watch(poses=True, arm=False)
_ARM_ENDED = (
    "simulated-arm: the arm's process has ended (-9); no program controls the arm: use its switch if it moves"
)

_ABOUT: dict[str, list[dict[str, Any]]] = {
    **{
        finger: [_line(f"{finger}: no picture for 0.4 s"), _line(f"{finger}: 12 pictures a second of 60")]
        for finger in ("thumb", "index", "middle", "ring")
    },
    "emg": [_line("emg: no vote for channel 2: railed"), _held("emg: no signal for 0.3 s")],
    "hand": [_line("hand: messages have a wrong length"), _line("hand: frames come twice")],
    "hand silence": [_line("hand: silent; it has not confirmed the command to switch its motors off")],
    "hand freeze": [
        {"ended": "DeviceUnavailableError: allegro: no joint angle has changed by a single count for 0.4 s"}
    ],
    "hand hot": [{"ended": "DeviceUnavailableError: allegro: index_j3 is at 85 °C; the limit is 80 °C"}],
    "hand's guard": [_line("hand: the process that lets go of the hand was lost; another is being started")],
    "hand slow": [{"ended": "DeviceUnavailableError: allegro: the hand sends its joint positions 193 times"}],
    "vest": [_line("vest: not reached, so touch is not felt")],
    "pedal": [_held("dead-man: no data"), _held("dead-man: released")],
    "tracker": [
        _line("hololens: no packet for 0.3 s"),
        _line(f"arm: {_LOST}"),
        *(_line(arm=f"{state}: {why}") for state in _LET_GO for why in (_NO_POSE, _LOST)),
        _line(arm=f"holding: the tracker has no vote: {JUMPED} 300 mm, 3 times and more"),
    ],
    "arm stop": [
        _line("simulated-arm: the arm's process has said nothing for 0.4 s"),
        *(_line(arm=f"{state}: {_NO_ARM}") for state in _LET_GO),
    ],
    "arm kill": [_line(_ARM_ENDED), _line(arm=f"stopped: {_ARM_ENDED}")],
    "computer clock": [_line("clock: the time of day jumped by +3600.0 s; this run counts on as before")],
    "computer disk": [_line("recording: stopped: the file cannot be written: File too large")],
    "recorder kill": [_line("recording: stopped: the recorder's process ended with code -9")],
    "recorder": [_line("recording: 12 records dropped: disk or processor does not keep up")],
    "program": [_held("the loop was 1234 ms late")],
    "link": [_held("link: no word from robot 'lab' for 0.6 s; nothing is sent")],
    "nothing": [
        _line(),
        _line("latency: p99 41 ms"),
        _line(state="armed"),
        {"said": "the link to the robot is up"},
        {"ended": "stopped", "recording": "trial-001.mcap"},
        *(_line(arm=f"{state}: the clutch is open") for state in _LET_GO),
        _line(arm="holding: the run is not active"),
    ],
}

# A program that got no time hears nothing of its hand, and another station nothing of it.
_BESIDES = {
    "program": ["hand", "hand silence"],
    "robot": ["program", "hand", "hand silence", "link"],
    "operator": ["link"],
}


def _reports(kind: Kind) -> set[str]:
    """Return whose words count for a fault."""
    exact = f"{kind.device} {kind.how}"
    own = exact if exact in _ABOUT else kind.device
    # Noise on its bus may silence the hand.
    silent = {"hand silence"} if own == "hand" else set()
    return {own, *silent, *_BESIDES.get(kind.device, ())} & _ABOUT.keys()


@pytest.mark.parametrize("kind", sorted(_EVERY), ids=lambda kind: f"{kind.device} {kind.how}")
def test_only_words_about_a_fault_count_as_telling_of_it(kind: Kind) -> None:
    if kind.how == "kill" and kind.device not in {"arm", "recorder"}:
        # After it no word of the program counts, but what the devices do.
        assert not any(kind.words(text) for lines in _ABOUT.values() for text in lines)
        return
    counted = {about for about, lines in _ABOUT.items() if any(map(kind.words, lines))}
    assert counted == _reports(kind)
    for about in counted:
        assert all(map(kind.words, _ABOUT[about]))
