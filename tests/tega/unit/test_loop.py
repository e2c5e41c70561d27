"""The loop's parts and the loop itself, on a clock that stands still until it is told to move."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from reference.scripted import MS, Sink, touching
from reference.wired import wired_loop
from tega.config.calibration import TouchMaxima
from tega.devices import driver_names
from tega.errors import DeviceUnavailableError, RecordingError
from tega.haptics import MotorLevels, intensity
from tega.loop.inbox.stream import PulledStream
from tega.loop.loop import DualLoop
from tega.loop.pacing import LATE_EDGES_NS, Pacer
from tega.loop.snapshot import LoopView, Snapshot
from tega.loop.touch import TouchLoop
from tega.records import Contact, Intent
from tega.records.bus import Bus
from tega.runtime.clock import ManualClock

LIMP = [(0x180, bytes(8)), (0x184, bytes(8)), (0x188, bytes(8)), (0x18C, bytes(8)), (0x104, b"")]


def run_loop(
    *,
    contacts: dict[str, Any] | None = None,
    clock: Any = None,
    levels: Any = None,
    vest: Sink | None = None,
    hand: Sink | None = None,
    bus: Bus | None = None,
    **how: Any,
) -> DualLoop:
    sinks: Any = {"vests": [vest or Sink()], "hands": [hand or Sink()]}
    loop = wired_loop(Pacer(clock or ManualClock()), contacts=contacts or {}, levels=levels, bus=bus, **sinks)
    loop.run(**how)
    return loop


def pressed(n: int, *, every_ns: int = 10 * MS) -> Any:
    return PulledStream(touching(100, 1.0, t_ns=k * every_ns) for k in range(n))


def steady(level: int, *, end_ns: int) -> Any:
    return PulledStream([Intent(t_ns=0, channels=(level,), level=level)], end_ns=end_ns)


def is_limp(hand: Sink) -> bool:
    return [(frame.id, frame.data) for frame in hand.sent[-1][1]] == LIMP


def is_silent(frame: MotorLevels) -> bool:
    return not frame.intensities.any()


def test_ticks_come_at_their_deadlines_and_the_way_out_is_last() -> None:
    vest, hand = Sink(), Sink()
    thumb = PulledStream([touching(50, t_ns=0), touching(50, t_ns=50 * MS)], end_ns=100 * MS)
    levels = PulledStream([Intent(t_ns=10 * MS, channels=(1, 1, 1), level=1)], end_ns=40 * MS)
    report = run_loop(contacts={"thumb": thumb}, levels=levels, vest=vest, hand=hand).report
    assert [t for t, _ in vest.sent] == [0, 33_333_333, 66_666_667, 100 * MS]
    assert [t for t, _ in hand.sent] == [*range(0, 100 * MS, 3 * MS), 100 * MS]
    assert is_silent(vest.sent[-1][1])
    assert is_limp(hand)
    assert (report.ended, report.end_ns) == ("complete", 100 * MS)
    assert (report.n_vest_ticks, report.n_hand_ticks) == (3, 34)


def test_a_level_steers_from_its_stamp_on() -> None:
    hand = Sink()
    levels = PulledStream([Intent(t_ns=30 * MS, channels=(4,), level=4)], end_ns=600 * MS)
    bus, views = Bus(), list[LoopView]()
    bus.subscribe(Snapshot, lambda snapshot: views.append(snapshot.view), vital=True)
    report = run_loop(levels=levels, hand=hand, bus=bus).report
    assert report.level_ticks == {1: 10, 2: 0, 3: 0, 4: 190, 5: 0}
    assert [v.intent and v.intent.level for v in views[:3]] == [None, 4, 4]
    assert any(any(f.data) for f in hand.sent[-2][1])
    assert is_limp(hand)


def test_a_finger_falls_silent_100_ms_after_its_last_frame() -> None:
    vest = Sink()
    thumb = PulledStream([touching(100, 1.0, t_ns=0)], end_ns=5 * MS)
    report = run_loop(contacts={"thumb": thumb, "ring": pressed(40)}, vest=vest).report
    columns = {t: (f.intensities[0], f.intensities[3]) for t, f in vest.sent}
    assert columns[66_666_667] == (99, 99)
    assert columns[100 * MS] == (99, 99)
    assert columns[133_333_333] == (0, 99)
    assert report.n_stale_ticks["ring"] == 0
    assert report.n_stale_ticks["thumb"] == 8


def test_without_contact_or_maximum_nothing_is_felt() -> None:
    touch = TouchLoop({"thumb": TouchMaxima(), "index": TouchMaxima(cci_max=2.0)}, layout="paper32")

    def felt(finger: str, contact: Contact) -> tuple[float, ...]:
        one = touch.update(finger, contact)
        return one.cci_norm, one.eda_norm, one.front, one.back

    assert felt("thumb", touching(50)) == (0.0, 0.0, 0.0, 0.0)
    assert felt("index", touching(0)) == (0.0, 0.0, 0.0, 0.0)
    assert felt("index", touching(50, 4.0)) == (1.0, 0.0, intensity(4.0, 2.0), 0.0)


def test_frames_of_fingers_are_taken_in_by_time_then_thumb_first() -> None:
    bus, order = Bus(), list[tuple[int, str]]()
    bus.subscribe(Contact, lambda contact: order.append((contact.t_ns, contact.finger)))
    streams = {
        "thumb": PulledStream([touching(1, t_ns=t * MS) for t in (0, 20, 21, 40)]),
        "ring": PulledStream([touching(1, t_ns=t * MS) for t in (0, 10, 21, 39)]),
    }
    run_loop(contacts=streams, bus=bus)
    assert order == [
        (0, "thumb"), (0, "ring"), (10 * MS, "ring"), (20 * MS, "thumb"),
        (21 * MS, "thumb"), (21 * MS, "ring"), (39 * MS, "ring"), (40 * MS, "thumb"),
    ]  # fmt: skip


def test_when_one_sink_fails_the_others_are_still_left_silent() -> None:
    broken, hand, levels = Sink(fail_at_ns=50 * MS), Sink(), steady(3, end_ns=300 * MS)
    with pytest.raises(DeviceUnavailableError, match="cable") as caught:
        run_loop(contacts={"thumb": pressed(30)}, levels=levels, vest=broken, hand=hand)
    assert is_limp(hand)
    assert any("on the way out" in note for note in caught.value.__notes__)


@pytest.mark.parametrize("error", [KeyboardInterrupt, RecordingError, ZeroDivisionError])
def test_every_exception_takes_the_way_out(error: type[BaseException]) -> None:
    def items() -> Iterator[Contact]:
        yield touching(100)
        yield touching(100, t_ns=40 * MS)
        raise error("on purpose")

    vest, hand = Sink(), Sink()
    with pytest.raises(error):
        run_loop(contacts={"thumb": PulledStream(items())}, vest=vest, hand=hand)
    assert not is_silent(vest.sent[0][1])
    assert is_silent(vest.sent[-1][1])
    assert is_limp(hand)


@pytest.mark.parametrize("error", [KeyboardInterrupt, SystemExit])
def test_what_is_no_exception_on_the_way_out_keeps_nobody_from_it(error: type[BaseException]) -> None:
    """A panic of native code passes ``except Exception``: the vest is silenced all the same."""

    class Panics(Sink):
        def write(self, t_ns: int, sent: Any) -> None:
            super().write(t_ns, sent)
            if is_limp(self):
                raise error("on purpose")

    vest, levels = Sink(), steady(3, end_ns=100 * MS)
    with pytest.raises(error, match="on purpose"):
        run_loop(contacts={"thumb": pressed(10)}, levels=levels, vest=vest, hand=Panics())
    assert not is_silent(vest.sent[-2][1])
    assert is_silent(vest.sent[-1][1])


def test_a_problem_only_on_the_way_out_is_raised() -> None:
    with pytest.raises(DeviceUnavailableError, match="cable"):
        run_loop(contacts={"thumb": pressed(3)}, vest=Sink(fail_at_ns=20 * MS))


def test_being_told_to_stop_and_a_set_duration_end_it_cleanly() -> None:
    requested = iter([False] * 20 + [True] * 100)
    vest = Sink()
    report = run_loop(contacts={"thumb": pressed(10**9)}, vest=vest, stop=lambda: next(requested)).report
    assert report.ended == "stopped"
    assert is_silent(vest.sent[-1][1])
    report = run_loop(contacts={"thumb": pressed(10**9)}, vest=vest, duration_ns=50 * MS).report
    assert (report.ended, report.end_ns) == ("duration", 50 * MS)


class Jumpy(ManualClock):
    def __init__(self, late_ns: dict[int, int]) -> None:
        super().__init__()
        self._late_ns = late_ns

    def sleep_until(self, t_ns: int) -> None:
        super().sleep_until(t_ns + self._late_ns.get(t_ns, 0))


def test_a_late_tick_is_made_up_for_and_counted() -> None:
    loop = run_loop(levels=steady(1, end_ns=60 * MS), clock=Jumpy({9 * MS: 20 * MS}))
    assert loop.report.n_hand_ticks == 20
    pacing = loop._pacer
    assert (pacing.n_skipped, pacing.worst_ns) == (0, 20 * MS)
    assert pacing.n_overruns == 6  # those due at 9, 12, 15, 18, 21, 24 ms come at 29
    bins = {edge_ns // MS: n for edge_ns, n in zip(LATE_EDGES_NS, pacing.n_late, strict=False) if n}
    # 29 ms is 20, 17, 14, 11, 8, 5 and 2 ms late; all other ticks are in time.
    assert bins == {0: pacing.n_ticks - 7, 2: 1, 5: 1, 10: 1, 20: 4}


def test_after_a_long_stall_old_commands_are_left_out() -> None:
    hand = Sink()
    loop = run_loop(levels=steady(1, end_ns=900 * MS), hand=hand, clock=Jumpy({30 * MS: 500 * MS}))
    times = [t // MS for t, _ in hand.sent]
    assert times[:11] == [*range(0, 30, 3), 432]
    assert loop._pacer.n_skipped > 0


def test_nothing_of_the_loop_names_a_device() -> None:
    text = Path(inspect.getfile(DualLoop)).read_text(encoding="utf-8")
    assert not [name for name in driver_names() if name in text]
