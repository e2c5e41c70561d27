# mypy: allow-untyped-defs, allow-incomplete-defs
"""How long each guard of a vest and of a hand takes, as the settings come: the hazard table's \"within\"."""

from __future__ import annotations

import asyncio
import json
import os
import selectors
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Callable
from queue import Empty
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from reference.processes import until
from reference.scripted import MS
from tega.devices.hand import guard_process, hand_bus, hand_guard, hand_loop
from tega.devices.hand.allegro_options import AllegroOptions
from tega.devices.hand.hand_guard import guard_hand
from tega.devices.vest import vest_ble, vest_ble_guard, vest_stream
from tega.devices.vest.vest_link import VestLink
from tega.devices.vest.vest_stream import StreamedVest, VestOptions
from tega.hand import HandController
from tega.hand.link import HandLink, Received
from tega.haptics import vest_frame
from tega.wire import (
    HAND_FINGERS,
    AllegroTemperature,
    allegro_limp_frames,
    allegro_report_frame,
    allegro_set_period,
)

HELLO = Received(0x200, struct.pack("<HHBBB", 0x0402, 0x0406, 0, 45, 1))


class _Link:
    """A link to a vest that moves the clock by 10 ms at each look, and notes what it is sent and when."""

    present, notes = True, ()

    def __init__(self, vest: Any, now: SimpleNamespace, *, stalls: bool = False) -> None:
        self._vest, self._now, self._stalls = vest, now, stalls
        self.sent: list[tuple[float, bool]] = []

    def ready(self, timeout_s: float) -> bool:  # noqa: ARG002
        self._now.s += 0.01
        self._vest._stopping = self._now.s > 4.0
        return not self._stalls

    def send(self, intensities: NDArray[np.uint8]) -> None:
        self.sent.append((self._now.s, bool(intensities.any())))

    def poll(self) -> None:
        """Nothing comes from there."""


class _Vest(StreamedVest):
    """A vest whose link is the test's."""

    name = "a vest"

    def _new_link(self) -> VestLink:
        raise NotImplementedError


@pytest.fixture
def stands_still(monkeypatch: pytest.MonkeyPatch) -> Callable[..., float]:
    """Have a program say something for 0.5 s, then nothing; return after how long its guard does what it is for."""

    def stand(guard: Any, whose: Any, words: list[str]) -> float:
        now, let_go_s = SimpleNamespace(s=0.0), list[float]()

        class ReceivedMarker:
            def get(self, *, timeout: float | None) -> bytes:
                if now.s < 0.5:
                    now.s += 0.1
                    return b".\n"
                if let_go_s or timeout is None:
                    return b""  # the program ends
                now.s += timeout
                raise Empty

            def empty(self) -> bool:
                return True

        monkeypatch.setattr(whose, "let_go", lambda *_: let_go_s.append(now.s))
        monkeypatch.setattr(guard_process, "receive", ReceivedMarker)
        monkeypatch.setattr(guard_process, "stay_alone", lambda: None)
        monkeypatch.setattr(guard_process, "_answer", lambda _line: None)
        monkeypatch.setattr(sys, "argv", ["guard", *words])
        guard.main()
        return let_go_s[0] - 0.5

    return stand


@pytest.fixture
def served(monkeypatch: pytest.MonkeyPatch) -> Callable[..., _Link]:
    """Write one frame to a vest at 0 s and nothing more; return what its writer's thread did then."""

    def serve(*, stalls: bool = False) -> _Link:
        now = SimpleNamespace(s=0.0)
        clock = SimpleNamespace(monotonic=lambda: now.s, monotonic_ns=lambda: round(now.s * 1e9))
        monkeypatch.setattr(vest_stream, "time", clock)
        monkeypatch.setattr(vest_stream, "_POLL_S", 0.0)
        vest = _Vest(VestOptions(most_hz=1000.0), "here")
        vest._begin()
        vest._thread = SimpleNamespace()  # type: ignore[assignment]
        vest.write(0, vest_frame([80, 60, 40, 20], [13, 0, 100, 53], layout="x40"))
        link = _Link(vest, now, stalls=stalls)
        vest._serve(link)  # type: ignore[arg-type]
        return link

    return serve


def test_a_vest_that_is_told_nothing_rests_within_200_ms(served: Callable[..., _Link]) -> None:
    link = served()
    assert link.sent[0][1]
    rests_s = next(t_s for t_s, on in link.sent if not on)
    assert 0.2 < rests_s <= 0.22
    assert not any(on for t_s, on in link.sent if t_s >= rests_s)
    # And is told so again each second.
    assert sum(t_s > rests_s for t_s, _ in link.sent) >= 3


def test_a_vest_that_takes_no_frame_counts_as_lost_after_a_second(served: Callable[..., _Link]) -> None:
    with pytest.raises(Exception, match="takes no frames, for 1 s now"):
        served(stalls=True)


def _positions(k: int) -> list[Received]:
    """Return a set of positions, each other than the one before."""
    frames = [Received(0x80 + 4 * f, struct.pack("<4h", k % 5, 2000, 2000, 2000)) for f in range(4)]
    frames[3] = Received(0x8C, struct.pack("<4h", 9000, 1000 + k % 5, 2000, 2000))
    return frames


def _hand(rate_hz: float) -> tuple[HandLink, float]:
    """Let a hand push, with so many sets of positions a second; return it and the time in ms."""
    o = AllegroOptions(interface="virtual", channel="x")
    link = HandLink(HandController(), silent_after_ms=o.silent_after_ms, lowest_rate_hz=o.lowest_rate_hz)
    t_ms = 0.0
    for k in range(400):
        t_ms = k * 1000 / rate_hz
        link.exchange([HELLO] if k == 20 else _positions(k) if k > 20 else [], round(t_ms * MS), 5)
        if link.phase in {"stopped", "fault"}:
            break
    return link, t_ms


def test_a_hot_hand_is_let_go_within_half_a_second_of_its_warming() -> None:
    """A hand that tells its temperatures as often as it was told to, and gets hot just after it did."""
    o = AllegroOptions(interface="virtual", channel="x")
    link = HandLink(HandController(), silent_after_ms=o.silent_after_ms, lowest_rate_hz=o.lowest_rate_hz)
    period_ms, told_ms, hot_ms = 0, 0, 0
    for t_ms in range(0, 9000, 3):
        frames = [HELLO] if t_ms == 60 else _positions(t_ms) if t_ms > 60 else []
        if period_ms and t_ms - told_ms >= period_ms:
            told_ms = t_ms
            celsius = (85 if hot_ms else 40,) * 4
            reports = [allegro_report_frame(AllegroTemperature(finger, celsius)) for finger in HAND_FINGERS]
            frames += [Received(report.id, report.data) for report in reports]
            hot_ms = hot_ms or (t_ms if link.phase == "running" else 0)
        for sent in link.exchange(frames, t_ms * MS, 5):
            if sent.id == allegro_set_period(0).id:
                period_ms = int.from_bytes(sent.data[4:6], "little")
        if link.fault is not None:
            break
    assert link.fault is not None
    assert link.fault.kind == "too-hot"
    assert 0 < t_ms - hot_ms <= 500 + 3


def test_a_hand_that_does_not_hear_its_end_is_left_to_its_guard_after_three_seconds(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now, sent_s = SimpleNamespace(s=0.0), list[float]()

    def hears_nothing(timeout: float) -> None:
        now.s += timeout

    monkeypatch.setattr(hand_bus, "time", SimpleNamespace(monotonic=lambda: now.s))
    bus = hand_bus.HandBus({"interface": "virtual", "channel": "x"})
    bus._can = pytest.importorskip("can")
    bus._bus = SimpleNamespace(recv=hears_nothing, send=lambda _frame, timeout: sent_s.append(now.s))  # noqa: ARG005
    frames = allegro_limp_frames()
    assert not bus.switch_off(frames, device_id=0, patience_s=hand_loop.CONFIRM_S)
    assert now.s == pytest.approx(3.0, abs=0.01)
    assert len(sent_s) > 10 * len(frames)
    assert sent_s[-1] > 2.5


class _Skipping(asyncio.SelectorEventLoop):
    """A loop whose clock goes on by what it would have waited."""

    def __init__(self) -> None:
        self.now_s = 100.0
        super().__init__(_SkippingSelector(self))

    def time(self) -> float:
        return self.now_s


class _SkippingSelector(selectors.DefaultSelector):
    def __init__(self, loop: _Skipping) -> None:
        super().__init__()
        self._loop = loop

    def select(self, timeout: float | None = None) -> Any:
        self._loop.now_s += timeout or 0.0
        return super().select(0)


def test_a_bluetooth_vest_that_takes_no_zeros_is_left_to_its_guard_after_a_second_and_a_half() -> None:
    loop, said_s = _Skipping(), list[float]()

    class Silent:
        """Takes frames and answers nothing."""

        async def read_gatt_char(self, _name: str) -> bytes:
            said_s.append(loop.now_s)
            return await loop.create_future()  # type: ignore[no-any-return]

        async def disconnect(self) -> None:
            said_s.append(loop.now_s)

    watch = vest_ble_guard.VestWatch()
    link = vest_ble._BleLink(vest_ble.BleOptions(), watch)
    link._runner, link._client = asyncio.Runner(loop_factory=lambda: loop), Silent()
    link._rests = link._confirms = True
    watch.silent = False
    link.close()
    assert said_s[1] - said_s[0] == pytest.approx(1.5, abs=0.11)
    assert not watch.silent
    assert not watch.confirmed


def test_a_silent_hand_is_let_go_within_30_ms_and_a_slow_one_within_a_second() -> None:
    link, t_ms = _hand(333.0)
    assert link.phase == "running"
    waited_ms = next(
        ms for ms in range(1000) if link.exchange([], round((t_ms + ms) * MS), 5) and link.phase == "silent"
    )
    assert link.phase == "silent"
    assert 29 <= waited_ms <= 33
    slow, t_ms = _hand(200.0)
    assert slow.fault is not None
    assert t_ms <= 2000


@pytest.mark.parametrize("guarded", ["hand", "vest"])
def test_a_program_that_stands_still_is_taken_over_from_within_a_second(stands_still, guarded) -> None:
    bus = {"interface": "virtual", "channel": "x", "bitrate": 1}
    words: Any = hand_guard, hand_guard._Hand, [json.dumps({"bus": bus, "frames": [], "device_id": 0})]
    if guarded == "vest":
        pytest.importorskip("bleak")
        words = vest_ble_guard, vest_ble_guard, ["C0:FF:EE:00:40:01", ""]
    assert stands_still(*words) == pytest.approx(1.0, abs=0.11)


@pytest.mark.skipif(sys.platform == "win32", reason="no process is stopped there")
def test_a_guard_that_stands_still_is_replaced_within_two_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    """A real process, stopped; the program's clock is the test's, so that no time is waited for."""
    now_s = [100.0]
    monkeypatch.setattr(guard_process, "time", SimpleNamespace(monotonic=lambda: now_s[0], sleep=time.sleep))
    guard = guard_hand({"interface": "virtual", "channel": "x", "bitrate": 1_000_000}, [], device_id=0)
    try:
        first: subprocess.Popen[bytes] = guard._process
        os.kill(first.pid, signal.SIGSTOP)
        for _ in range(60):
            guard.beat()
            now_s[0] += 0.101
            if guard._requested_s - guard._received_s > guard_process.DEAF_S:
                break
        guard.beat()
        assert now_s[0] - 100.0 <= 2.3
        # Until another has taken its place; that one starts in the machine's own time.
        until(lambda: guard._process is not first and not guard.problem)
        assert first.returncode == -signal.SIGKILL
        assert guard.n_lost == 1
    finally:
        guard.dismiss()
