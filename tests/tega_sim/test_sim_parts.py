"""Parts between the loop and the simulated world, each for itself, and what is not there costs nothing."""

from __future__ import annotations

import csv
import threading
from collections import deque
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reference.parts import observed
from reference.scripted import MS, Sink, touching
from reference.wired import wired_loop
from tega.config import check_tree
from tega.config.calibration import TouchMaxima
from tega.devices.base import DeviceInfo, TactileFrame
from tega.devices.vest.vest_recorder import VestRecorder
from tega.errors import DeviceUnavailableError
from tega.haptics import vest_frame
from tega.loop import run_session
from tega.loop.inbox.picture_votes import is_repeat, kept_picture
from tega.loop.inbox.stream import NEVER_NS, LiveStream, PulledStream
from tega.loop.loop import DualLoop
from tega.loop.pacing import Pacer
from tega.loop.snapshot import LoopView
from tega.loop.touch import TouchLoop
from tega.records import Contact, Intent
from tega.runtime.clock import ManualClock, PausableClock
from tega.wire import CanFrame, allegro_limp_frames, allegro_torque_frames
from tega_sim.conditions import ARMS, CONDITIONS, SESSION_CONDITIONS, sham_vest
from tega_sim.gel import Gel
from tega_sim.hand import SimulatedBus
from tega_sim.rig import SimulatedPacer
from tega_sim.score import TrialScorer
from tega_sim.seams import WorldTruth
from tega_sim.synthetic import SyntheticTouch, SyntheticTouchOptions

Course = Sequence[tuple[float, Mapping[str, object]]]
"""Times, and what is so from then on."""

NOTHING = WorldTruth(0.0, 0.0, False, (0.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0, False, 0.1)


def score(course: Course, *, placing_from_s: float = np.inf) -> TrialScorer:
    scorer = TrialScorer(harm_m=0.01)
    truth, left = NOTHING, deque(course)
    for tick in range(round((course[-1][0] + 1.0) * 100) + 1):
        t_s = tick / 100
        while left and t_s >= left[0][0] - 1e-9:
            truth = truth._replace(**left.popleft()[1])  # type: ignore[arg-type]
        moved_m = truth.slip_m + truth.slip_m_s / 100
        truth = truth._replace(slip_m=moved_m)
        scorer.take(t_s, truth, placing=t_s >= placing_from_s)
    scorer.close()
    return scorer


def test_lifted_is_a_second_at_the_height() -> None:
    up: Course = [
        (1.0, {"lift_off": True, "object_height_m": 0.1}),
        (2.0, {"object_height_m": 0.21}),
        (3.1, {}),
    ]
    scorer = score(up)
    assert scorer.time_of("lift_off") == 1.0
    assert scorer.time_of("lifted") == pytest.approx(3.0)
    down: Course = [*up[:2], (2.9, {"object_height_m": 0.19}), (3.0, {"object_height_m": 0.21})]
    assert score([*down, (3.5, {})]).time_of("lifted") == pytest.approx(4.0)


@pytest.mark.parametrize(
    ("speed_m_s", "lasting_s", "slips"),
    [(0.02, 0.2, 1), (0.0002, 2.0, 0), (0.004, 2.0, 0), (0.02, 0.1, 0), (0.2, 0.02, 0), (0.2, 0.05, 1)],
    ids=["seen", "creep", "too slow", "too short a way", "a jerk too short", "fast"],
)
def test_a_slip_counts_when_it_can_be_seen(speed_m_s: float, lasting_s: float, slips: int) -> None:
    scorer = score(
        [(1.0, {"lift_off": True, "slip_m_s": speed_m_s}), (1.0 + lasting_s, {"slip_m_s": 0.0}), (4.0, {})]
    )
    assert scorer.count("slip") == slips
    assert scorer.slid_m == pytest.approx(speed_m_s * lasting_s, rel=0.1)


@pytest.mark.parametrize(("rest_s", "slips"), [(0.1, 1), (0.5, 2)])
def test_two_slips_are_one_without_a_rest_in_between(rest_s: float, slips: int) -> None:
    speeds = ((1.0, 0.05), (1.1, 0.0), (1.1 + rest_s, 0.05), (1.2 + rest_s, 0.0))
    scorer = score([(t_s, {"lift_off": True, "slip_m_s": speed}) for t_s, speed in speeds])
    assert scorer.count("slip") == slips
    assert sum(event.size_m for event in scorer.events) == pytest.approx(0.01, abs=0.0011)


def test_a_slip_counts_to_the_end_but_not_on_the_table_or_while_it_is_put_down() -> None:
    events = score([(1.0, {"lift_off": True, "slip_m_s": 0.02})]).events
    assert [event.size_m for event in events if event.kind == "slip"] == [pytest.approx(0.02, abs=0.001)]
    assert score([(1.0, {"slip_m_s": 0.05})]).count("slip") == 0
    put_down: Course = [(1.0, {"lift_off": True}), (2.0, {"slip_m_s": 0.05, "dropped": True})]
    assert score(put_down, placing_from_s=1.5).count("slip") == 0
    assert score(put_down, placing_from_s=1.5).count("drop") == 0
    assert score(put_down).count("drop") == 1


def test_a_deformation_is_over_when_the_object_has_eased() -> None:
    courses = ((1.0, 0.012), (1.2, 0.009), (1.4, 0.015), (1.6, 0.005), (1.8, 0.011))
    scorer = score([(t_s, {"deformation_m": narrow_m}) for t_s, narrow_m in courses])
    assert [(event.t_s, event.size_m) for event in scorer.events] == [(1.0, 0.015), (1.8, 0.011)]
    assert scorer.deformation_m == 0.015
    strongest = score([(0.1, {"pad_force_n": (1.0, 4.5, 0.0, 2.0)}), (0.2, {"pad_force_n": (0.0,) * 4})])
    assert strongest.peak_force_n == 4.5


def test_a_live_stream_gives_items_when_their_time_has_come() -> None:
    stream = LiveStream[Intent](due_ns=10)
    assert (stream.due_ns, stream.next_until(50)) == (10, None)
    first, second = Intent(t_ns=10), Intent(t_ns=20)
    stream.put(first, next_ns=20)
    stream.put(second, next_ns=30)
    assert stream.next_until(9) is None
    assert stream.next_until(25) is first
    assert stream.due_ns == 20
    assert stream.next_until(25) is second
    assert (stream.due_ns, stream.next_until(25)) == (30, None)
    stream.put(Intent(t_ns=30), next_ns=40)
    stream.end(31)
    stream.close()
    assert (stream.ended, stream.end_ns, stream.due_ns, stream.next_until(99)) == (True, 31, NEVER_NS, None)


def test_a_picture_that_cannot_change_is_known_without_looking_and_one_that_can_is_looked_at() -> None:
    class Counted(np.ndarray):
        n_read = 0

        def tobytes(self, *_: object, **__: object) -> bytes:
            Counted.n_read += 1
            return super().tobytes()

    constant = Counted((80, 80, 3), np.uint8)
    constant.fill(7)
    constant.flags.writeable = False
    last, n_read = kept_picture(constant, Contact(finger="thumb", t_ns=0, in_contact=False)), Counted.n_read
    assert is_repeat(constant, last)
    assert Counted.n_read == n_read
    assert is_repeat(constant.copy(), last)
    assert Counted.n_read > n_read


class LateClock(ManualClock):
    def __init__(self, late_ns: int) -> None:
        super().__init__()
        self.late_ns = late_ns

    def sleep_until(self, t_ns: int) -> None:
        super().sleep_until(t_ns + self.late_ns)


def test_a_late_simulation_leaves_no_tick_out_and_shifts_what_is_left() -> None:
    times: list[int] = []
    clock = LateClock(150_000_000)
    pacer = SimulatedPacer(clock, times.append)
    pacer.start()
    assert pacer.wait(0)
    clock.late_ns = 0
    assert pacer.wait(1_000_000_000)
    assert times == [0, 1_000_000_000]
    assert clock.now_ns() == 1_150_000_000
    assert pacer.n_skipped == 1


def test_a_pause_holds_the_world_and_goes_on_from_there() -> None:
    times: list[int] = []
    machine, looks = ManualClock(5_000_000_000), iter(range(3))

    def paused() -> bool:
        """Hold the world after its first tick; a second passes before somebody goes on."""
        check = next(looks) if times else 2
        if times and check > 0:
            machine.sleep_until(machine.now_ns() + 500_000_000)
        return check < 2

    clock = PausableClock(paused, machine)
    pacer = SimulatedPacer(clock, times.append)
    assert pacer.wait(2_000_000)
    assert clock.held_ns == 0
    assert pacer.wait(3_000_000)
    assert times == [2_000_000, 3_000_000]
    assert clock.held_ns == 1_000_000_000
    assert machine.now_ns() == 6_003_000_000
    assert pacer.n_overruns == 0


def test_the_bus_does_what_the_frames_say() -> None:
    applied: list[np.ndarray] = []
    bus = SimulatedBus(applied.append, full_duty=0.7)
    torques = np.linspace(-0.1, 0.1, 16)
    bus.write(0, allegro_torque_frames(torques))
    assert np.abs(applied[-1] / 0.7 - torques).max() <= 0.5 / 1200 + 1e-12
    bus.write(0, [CanFrame(0x7FF, b"")])
    assert bus.n_rejected == 1
    assert applied[-1].any()
    bus.write(0, allegro_limp_frames()[-1:])
    assert not applied[-1].any()


def test_every_condition_has_a_vest() -> None:
    frame = vest_frame([80.0] * 4, [20.0] * 4, layout="x40")
    other = vest_frame([10.0] * 4, [90.0] * 4, layout="x40")
    displayed = {
        condition: sham_vest(arm.sham, seed=1, recorded=[(0.0, other)])(0.5, frame)
        for condition, arm in ARMS.items()
    }
    for condition in ("haptic", "unfelt", "oracle", "true-force", "true-steps"):
        assert displayed[condition] == frame
    assert displayed["replayed"] == other
    assert displayed["non-haptic"] is None
    assert len({None if f is None else f.intensities.tobytes() for f in displayed.values()}) >= 7
    assert tuple(ARMS) == CONDITIONS
    assert [one for one in CONDITIONS if one not in SESSION_CONDITIONS] == ["unfelt", "ideal-vest"]


def test_pictures_are_shown_by_what_makes_frames_of_them_and_by_nothing_else() -> None:
    one, other = (vest_frame([percent] * 4, [90.0 - percent] * 4, layout="x40") for percent in (20.0, 70.0))
    for condition, arm in ARMS.items():
        displayed = [sham_vest(arm.sham, seed=1, recorded=[(0.0, one)])(0.5, frame) for frame in (one, other)]
        of_pictures = arm.reports in {"touch", "events"} and displayed[0] != displayed[1]
        assert arm.hangs_on_pictures == (of_pictures or arm.reflex == "touch"), condition


class Waits(ManualClock):
    def __init__(self) -> None:
        super().__init__()
        self.times: list[int] = []

    def sleep_until(self, t_ns: int) -> None:
        self.times.append(t_ns)
        super().sleep_until(t_ns)


def run_parts(
    *, touch: bool, emg: bool, live: Sink | None = None, recorder: Sink | None = None, **how: Any
) -> tuple[DualLoop, Waits, Sink, Sink]:
    clock, vest, hand = Waits(), recorder or Sink(), Sink()
    contacts = [touching(50, t_ns=k * 16 * MS) for k in range(61)] if touch else []
    levels = [Intent(t_ns=k * 100 * MS, channels=(2,), level=2) for k in range(1, 10)]
    streams = {"thumb": PulledStream(contacts, end_ns=1000 * MS)} if touch else {}
    loop = wired_loop(
        Pacer(clock),
        TouchLoop(dict.fromkeys(streams, TouchMaxima(cci_max=1.0, eda_max=100.0)), layout="x40"),
        contacts=streams,
        levels=PulledStream(levels, end_ns=1000 * MS) if emg else None,
        vests=[vest],
        hands=[hand],
        live_vests=[live or vest],
    )
    loop.run(**how)
    return loop, clock, vest, hand


def test_a_vest_that_fails_does_not_keep_the_others_from_silence() -> None:
    recorder = Sink()
    with pytest.raises(DeviceUnavailableError, match="cable"):
        run_parts(touch=True, emg=False, live=Sink(fail_at_ns=50 * MS), recorder=recorder)
    assert not recorder.sent[-1][1].intensities.any()


VEST_TIMES = [round(k * 1e9 / 30) for k in range(30)]


def test_without_emg_no_hand_ticks_and_nobody_wakes_for_it() -> None:
    loop, clock, _, hand = run_parts(touch=True, emg=False)
    assert [t for t, _ in hand.sent] == [1000 * MS]  # the way out
    assert (loop.report.n_hand_ticks, loop.report.n_vest_ticks) == (0, 30)
    assert (loop.report.n_contacts, loop.report.end_ns) == ({"thumb": 61}, 1000 * MS)
    assert clock.times == sorted({*VEST_TIMES, *range(0, 1001 * MS, 100 * MS)})


def test_without_touch_no_vest_ticks_and_nobody_wakes_for_it() -> None:
    loop, clock, vest, hand = run_parts(touch=False, emg=True)
    assert [t for t, _ in vest.sent] == [1000 * MS] * 2  # the way out of both sinks
    assert (loop.report.n_hand_ticks, loop.report.n_vest_ticks) == (334, 0)
    assert clock.times == [*range(0, 1000 * MS, 3 * MS), 1002 * MS]
    assert len(hand.sent) == 335


def test_a_set_duration_is_kept_and_takes_in_all_that_came_before_it() -> None:
    loop, clock, vest, _ = run_parts(touch=True, emg=False, duration_ns=97 * MS)
    assert (loop.report.ended, loop.report.end_ns) == ("duration", 97 * MS)
    assert clock.times[-1] == 97 * MS
    assert loop.report.n_contacts == {"thumb": 7}  # at 0, 16, … 96 ms
    assert vest.sent[-1][0] == 97 * MS
    loop, *_ = run_parts(touch=True, emg=False, duration_ns=1000 * MS)
    assert (loop.report.ended, loop.report.end_ns) == ("duration", 1000 * MS)
    loop, *_ = run_parts(touch=True, emg=False, duration_ns=1001 * MS)
    assert (loop.report.ended, loop.report.end_ns) == ("complete", 1000 * MS)


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> tuple[list[Any], list[Any]]:
    """Return the simulated fingertips that were made, and those that were read from, again for every picture."""
    made, read = list[Any](), list[Any]()

    class Counted(SyntheticTouch):
        def __init__(self, options: SyntheticTouchOptions) -> None:
            super().__init__(options)
            made.append(self)

        def read(self, timeout_s: float) -> TactileFrame | None:
            read.append(self)
            return super().read(timeout_s)

    monkeypatch.setattr("tega_sim.synthetic.SyntheticTouch", Counted)
    return made, read


def session(tmp_path: Path, out: str, **tables: Any) -> Any:
    tree = {
        "session": {"pace": "fast", "out_dir": str(tmp_path / out)},
        "tactile": {"index": {"driver": "synthetic-touch", "options": {"duration_s": 2.0}}},
        **tables,
    }
    return check_tree(tree, {}, base=tmp_path).config


def our_threads() -> set[str]:
    return {t.name for t in threading.enumerate() if t.name.startswith("tega-")}


def test_a_session_of_one_finger_knows_no_other(counted: tuple[list[Any], list[Any]], tmp_path: Path) -> None:
    made, read = counted
    while_measuring: set[str] = set()
    views: list[LoopView] = []
    running: set[str] = set()
    others = our_threads()  # of what ran before in this process

    def progress(_subject: str, _done: int, _total: int) -> None:
        while_measuring.update(our_threads() - others)

    def observer(view: LoopView) -> None:
        views.append(view)
        running.update(our_threads() - others)

    first = run_session(session(tmp_path, "one"), progress=progress, bus=observed(observer))
    assert len(made) == 1
    assert read == made * len(read)
    assert while_measuring == {"tega-index"}  # the finger's own
    assert running == set()  # all was measured beforehand

    made.clear()
    read.clear()
    calibration = {"file": str(tmp_path / "one" / "calibration.toml")}
    np.save(tmp_path / "gel.npy", Gel(0).still())
    finger = {"driver": "synthetic-touch", "baseline": "gel.npy", "options": {"duration_s": 2.0}}
    config = session(tmp_path, "two", calibration=calibration, tactile={"index": finger})
    second = run_session(config, bus=observed(observer))
    assert len(made) == 1
    assert len(read) == 120 + 5  # each once, and five before to compare the baseline with
    assert running <= {"tega-index", "tega-recordings"}  # one reads, one measures
    assert our_threads() <= others
    for summary in (first, second):
        assert list(summary["tactile"]) == ["index"]
        assert (summary["emg"], summary["hand"]["ticks"]) == (None, 0)
    assert set().union(*(view.contacts for view in views)) == {"index"}
    rows = csv.DictReader((tmp_path / "two" / "contacts.csv").read_text().splitlines())
    assert {row["finger"] for row in rows} == {"index"}
    assert "[tactile.index]" in (tmp_path / "one" / "calibration.toml").read_text()
    assert "thumb" not in (tmp_path / "one" / "calibration.toml").read_text()


@pytest.mark.parametrize(("live", "n_sent"), [(True, 60), (False, 0)])
def test_a_vest_that_does_not_spare_itself_gets_every_frame(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, live: bool, n_sent: int
) -> None:
    info = DeviceInfo(driver="vest-recorder", kind="vest", label="written down", live=live)
    monkeypatch.setattr(VestRecorder, "info", info)
    monkeypatch.setattr("tega.loop.sinks._DISPLAYED", ("vest-recorder",))
    vest = {"driver": "vest-recorder", "options": {"file": "mine.csv"}}
    text = run_session(session(tmp_path, "out", vest=vest))["vest"]
    assert text["sinks"] == ["vest-recorder"] * 2
    assert (text["frames"], text["sent"], text["skipped"]) == (60, n_sent, 0)
    assert (tmp_path / "mine.csv").read_bytes() == (tmp_path / "out" / "vest.csv").read_bytes()
