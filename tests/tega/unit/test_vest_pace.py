"""The vest on a person and its pace: what they feel, at once, one wearer a time; no link gets more than it carries."""

from __future__ import annotations

import itertools
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, nullcontext
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from reference.command import call
from reference.processes import until
from reference.scripted import MS, Sink, touching
from reference.sessions import read_recorded
from reference.vest_bench import KeptVest
from reference.wired import FULL, wired_loop
from tega.config import VestConfig, check_tree, load_config
from tega.config.calibration import TouchMaxima
from tega.config.calibration.wearing import judge_wearing, site_face, site_motors, site_place
from tega.devices.base import BudgetedVest
from tega.devices.vest.vest_stream import VestOptions
from tega.errors import DeviceUnavailableError
from tega.haptics import FeltMap, MotorLevels, vest_frame
from tega.haptics.motor_layout import Motor, MotorLayout, find_layout
from tega.loop.inbox.reader import Reader
from tega.loop.inbox.stream import LiveStream, PulledStream
from tega.loop.outputs import VestOutput
from tega.loop.pacing import Pacer
from tega.loop.session import run_session
from tega.loop.touch import TouchLoop
from tega.loop.worn_vest import NAMELESS, dose_file, worn_vest
from tega.recording.replay import replay_file
from tega.records import Contact, Event, Intent, VestFrame
from tega.records.bus import Bus
from tega.runtime.clock import SystemClock
from tega.runtime.files.toml_text import tree_text
from tega.runtime.threads import Bell
from tega.setup.calibration.identify import Pulses
from tega.setup.calibration.sitting import Times
from tega.stages.base import VestSetup
from tega.stages.pulses import PulsesMapping, PulsesOptions
from tega_emulators.lab import PRESSED, emulated_lab, pressing
from tega_emulators.vest_bench import vest_bench

LONG_S = 60.0
TOUCH = partial(TouchLoop, {"thumb": FULL}, layout="x40")


def test_what_a_picture_changes_is_felt_at_once_and_what_it_does_not_is_not_sent() -> None:
    vest, bell = Sink(), Bell()
    pacer = Pacer(SystemClock(), bell=bell)
    felt: list[int] = []

    def camera(stopped: Callable[[], bool]) -> Iterator[Contact]:
        until(lambda: bool(vest.sent))  # the first refresh; the next one comes a minute later
        for eda in (50, 50, 80, 0):
            n = len(vest.sent)
            yield touching(eda, t_ns=pacer.elapsed_ns())
            felt.append(eda)
            if len(felt) == 2:
                continue  # nothing changes
            until(lambda n=n: len(vest.sent) > n)  # type: ignore[misc]
        until(stopped)

    pacer.start()
    stream: LiveStream[Contact] = LiveStream(on_item=bell.ring)
    reader = Reader("thumb", camera, stream.put, stream.end)
    loop = wired_loop(
        pacer, TOUCH(), contacts={"thumb": stream}, vests=[vest], by_frame=True, rate_hz=1 / LONG_S
    )
    report = loop.run(stop=lambda: len(felt) == 4)
    reader.close()
    assert report.n_contacts == {"thumb": 4}
    assert (report.n_vest_ticks, report.n_vest_between) == (1, 3)
    displayed = [int(frame.intensities[0]) for _, frame in vest.sent]
    assert displayed[0] == 0
    assert 0 < displayed[1] == displayed[2]  # the front follows CCI, which is the same
    backs = [int(frame.intensities[20]) for _, frame in vest.sent]
    assert 0 < backs[1] < backs[2]
    assert (backs[0], backs[3]) == (0, 0)
    times = [t_ns for t_ns, _ in vest.sent]
    assert times == sorted(times)
    assert times[-1] < LONG_S * 1e9


def scripted(*, by_frame: bool) -> list[int]:
    vest = Sink()
    thumb = PulledStream([touching(50, t_ns=10 * MS), touching(50, t_ns=20 * MS), touching(0, t_ns=40 * MS)])
    levels = PulledStream([Intent(t_ns=90 * MS, channels=(1, 1, 1))], end_ns=90 * MS)
    wired_loop(None, TOUCH(), contacts={"thumb": thumb}, levels=levels, vests=[vest], by_frame=by_frame).run()
    return [t_ns // MS for t_ns, _ in vest.sent]


def test_what_is_taken_in_at_a_tick_of_the_hand_does_not_wait_for_one_of_the_vest() -> None:
    assert scripted(by_frame=False) == [0, 33, 66, 90]
    assert scripted(by_frame=True) == [0, 12, 33, 42, 66, 90]


@pytest.mark.slow
def test_a_run_by_frame_is_recorded_and_computed_again_bit_for_bit(tmp_path: Path) -> None:
    fingers = ("thumb", "index")
    with emulated_lab(tmp_path, emg_hz=250.0, vest=True, fingers=fingers, touch=PRESSED) as lab:
        lab.tree["session"] = {"duration_s": 3.0}
        lab.tree["vest"]["pace"] = "by-frame"
        lab.tree["recording"] = {"dir": str(tmp_path / "recorded"), "lossless": True}
        with pressing(lab):
            summary = run_session(check_tree(lab.tree, {}, base=tmp_path).config)
    assert summary["vest"]["pace"] == "by-frame"
    file = tmp_path / "recorded" / summary["recording"]["file"]
    replay = replay_file(file)
    assert replay.same, [stream for stream in replay.streams if stream.differ]
    ticks = {round(k * 1e9 / 30) for k in range(91)}
    between = [one.t_ns for one in read_recorded(file).of(VestFrame) if one.t_ns not in ticks]
    assert between
    other = tmp_path / "other.toml"
    other.write_text('[vest]\nlayout = "x40"\npace = "steady"\n')
    again = replay_file(file, config=other)
    assert any("vest.pace" in text for text in again.changed)
    frames = next(stream for stream in again.streams if stream.stream == "/vest/frame")
    assert frames.recorded - frames.replayed == len(between)


class FineVest(KeptVest):
    """A vest that shows every percent."""

    in_steps = False


def fronts(first: float, second: float = 0) -> MotorLevels:
    """Return a frame in which so much of the first two front columns is on."""
    return vest_frame([first, second, 0, 0], [0, 0, 0, 0], layout="x40")


def new_frames(vest: KeptVest, *wanted: float) -> list[int]:
    """Write frames to a vest; return those that its driver saw something new in."""
    new = []
    with vest:
        for k, front in enumerate(wanted):
            before = vest.spared
            vest.write(k * MS, fronts(front))
            if vest.spared == before:
                new.append(int(front))
    return new


def test_a_driver_spares_frames_that_its_vest_shows_alike_but_a_motor_that_rests_is_told() -> None:
    assert new_frames(FineVest(VestOptions()), 40, 41, 42, 50, 50) == [40, 41, 42, 50]
    assert new_frames(KeptVest(VestOptions()), 40, 41, 42, 50, 50) == [40, 50]  # steps 6, 6, 6, 8
    assert new_frames(KeptVest(VestOptions()), 2, 0) == [2, 0]  # both are step 0
    reported = KeptVest(VestOptions())
    reported.keep_alive_s = 0
    assert new_frames(reported, 40, 41, 41) == [40, 41, 41]
    assert reported.counters.written == 3


FRONTS = (0, 40, 41, 41, 50, 1, 0)


@pytest.mark.parametrize(
    ("vests", "changed"),
    [
        ([], [False] * len(FRONTS)),
        ([FineVest], [True, True, True, False, True, True, True]),
        ([KeptVest], [True, True, False, False, True, True, True]),  # 16 steps, and silence is none of them
        ([KeptVest, FineVest], [True, True, True, False, True, True, True]),
    ],
)
def test_a_frame_is_traced_where_its_vest_shows_a_change(vests: list[Any], changed: list[bool]) -> None:
    given, traced = iter(FRONTS), list[bool]()
    touch: Any = SimpleNamespace(frame=lambda _t_ns: fronts(next(given)))
    trace: Any = SimpleNamespace(now_ns=lambda: 0, vest=lambda *_, changed: traced.append(changed))
    live = [kind(VestOptions()) for kind in vests]
    output = VestOutput(touch, live_vests=live, bus=Bus(), now_ns=lambda: 0, trace=trace)
    with ExitStack() as opened:
        for vest in live:
            opened.enter_context(vest)
        for k in range(len(FRONTS)):
            output.refresh(k * MS)
    assert traced == changed


def test_a_frame_that_stands_is_renewed_and_what_comes_alike_is_not_sent_beside_it() -> None:
    vest = KeptVest(VestOptions())
    with vest:
        until(lambda: bool(vest.write(0, fronts(40 + vest.counters.written % 2))) and vest.counters.sent >= 5)
        assert vest.spared + vest.counters.silenced == vest.counters.written - 1
        times = [at_s for at_s, frame in vest.wire.sent if frame.any()]
    assert all(later - sooner >= 0.099 for sooner, later in itertools.pairwise(times))


def test_the_settings_keep_alive_reaches_the_driver(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tega.loop.worn_vest.driver_class", lambda *_: lambda _o: KeptVest(VestOptions()))
    with worn_vest(VestConfig(driver="wire-vest", keep_alive_s=0.15), None) as vest:
        assert isinstance(vest, KeptVest)
        assert vest.keep_alive_s == 0.15


def test_a_link_gets_the_newest_frame_at_its_greatest_rate() -> None:
    most_hz = 20.0
    vest = FineVest(VestOptions(most_hz=most_hz))
    with vest:
        began_s = time.monotonic()
        for k in range(200):
            vest.write(k, fronts(k % 100 + 1))
            time.sleep(0.002)
        handed: list[tuple[int, int, int]] = []

        def arrived() -> bool:
            vest.write(199, fronts(100))
            handed.extend(vest.handed_over())
            return bool(handed) and handed[-1][0] == 199

        until(arrived)
        lasted_s = time.monotonic() - began_s
        n = len(vest.wire.sent)
    assert 3 <= n <= lasted_s * most_hz + 2
    assert vest.counters.held > 0
    held = [(free_ns, at_ns) for _, free_ns, at_ns in handed if free_ns]
    assert held
    assert all(free_ns <= at_ns for free_ns, at_ns in held)
    assert vest.counters.superseded > n


def test_a_frame_for_the_player_leaves_in_the_call_that_hands_it_over_unless_the_link_is_in_use() -> None:
    with vest_bench("bhaptics-player") as made, made.vest as vest:
        at_once = 0
        for k in range(1, 21):
            time.sleep(0.025)  # longer than the greatest rate asks for
            vest.handed_over()
            vest.write(k, fronts(4 * k))
            at_once += [t_ns for t_ns, _, _ in vest.handed_over()] == [k]
        assert at_once >= 10  # the driver's own thread hears the Player between them
        with vest._turn:
            time.sleep(0.025)
            vest.handed_over()
            vest.write(21, fronts(0, 90))  # returns all the same
            assert not vest.handed_over()
        until(lambda: [t_ns for t_ns, _, _ in vest.handed_over()] == [21])


def touched(**how: Any) -> list[int]:
    loop = TouchLoop({"thumb": TouchMaxima(cci_max=1.0, eda_max=1400.0)}, layout="paper32", **how)
    assert not loop.silence().intensities.any()
    loop.update("thumb", touching(700))
    frame: list[int] = loop.frame(0).intensities.tolist()
    return frame


def test_the_loop_sends_what_this_person_feels_and_rest_stays_rest() -> None:
    plain, felt = touched(), touched(felt=FeltMap(threshold=20))
    assert (plain[0], plain[16]) == (50, 50)
    assert (felt[0], felt[16]) == (60, 60)
    assert not any(felt[1:4])
    back = touched(mirror="back")  # the thumb is at the other end
    assert (back[0], back[3], back[16], back[19]) == (50, 0, 0, 50)


def test_a_person_is_asked_about_the_columns_that_a_layout_has(monkeypatch: pytest.MonkeyPatch) -> None:
    belt = MotorLayout("belt", "ten motors", [Motor("back", 0, column, 9 - column) for column in range(10)])
    monkeypatch.setattr("tega.runtime.features.find_plugin", lambda *_: None)
    monkeypatch.setattr("tega.runtime.features.load_plugin", lambda *_: belt)
    vest: Any = None
    pulses = Pulses(vest, layout="belt", ceiling=9, times=Times())
    sites = pulses.sites(each_motor=False)
    assert sites == tuple(f"b{column}" for column in range(1, 11))
    assert [site_motors(site, "belt") for site in sites] == [(9 - column,) for column in range(10)]
    assert site_place("b10", "belt") == "back, column 10 of 10 from your left"
    assert site_face("m4", "belt") == "b"
    backward = dict(zip(sites, sites[::-1], strict=True))
    assert judge_wearing(backward, "belt").notes == ('back felt mirrored: set vest.mirror = "back"',)


def test_one_motor_is_lit_for_its_time_and_then_none_and_its_place_named(tmp_path, capsys) -> None:
    out = tmp_path / "v.csv"
    words = ["--set", "vest.driver=vest-recorder", "--set", f"vest.options.file={out}", "--seconds", "0.2"]
    text, _ = call(capsys, "vest", "identify", *words, "--motor", 3, "--motor", 36)
    assert text.splitlines() == [
        "motor  3: front, row 1 of 5 from the top, column 4 of 4 from the wearer's left",
        "motor 36: back, row 5 of 5 from the top, column 1 of 4 from the wearer's left",
    ]
    header, *rows = [line.split(",") for line in out.read_text().splitlines()]
    lit = [{h for h, v in zip(header[1:], row[1:], strict=True) if v != "0"} for row in rows]
    assert lit == [*[{"m3"}] * 5, set(), *[{"m36"}] * 5, set()]
    words += ["--set", "vest.layout=x16"]
    text, _ = call(capsys, "vest", "identify", *words, "--motor", 9)
    assert text == "motor  9: front, row 2 of 2 from the top, column 2 of 4 from the wearer's left\n"
    text, err = call(capsys, "vest", "identify", *words, "--motor", 9, "--motor", 4, code=1)
    assert "motor 4 is not one of layout 'x16'; it has 0, 1, 2, 3, 8" in err.replace("\nhint: ", "; ")
    assert text == "", "refused before a motor vibrates"
    assert (
        "hint: for example --set vest.driver=bhaptics-player" in call(capsys, "vest", "identify", code=1)[1]
    )


@pytest.mark.parametrize(
    ("first", "second", "refused"),
    [(0, 0, True), (0, 1, False), (0, 2, True), (2, 0, True), (2, 2, True), (1, 0, False)],
)
def test_a_wearer_is_one_program_s(first, second, refused, tmp_path, monkeypatch) -> None:
    """Persons p01 and p02, and one without a name, who may be either."""
    assert isinstance(KeptVest(VestOptions()), BudgetedVest)
    monkeypatch.setattr("tega.loop.worn_vest.driver_class", lambda *_: lambda _o: KeptVest(VestOptions()))
    wearers = [tmp_path / "people" / name / "vest-dose.json" for name in ("p01", "p02")] + [
        tmp_path / NAMELESS
    ]

    def wear(n: int) -> AbstractContextManager[object]:
        return worn_vest(VestConfig(driver="wire-vest"), wearers[n])

    for n in (0, 1):
        with wear(n):
            pass
    in_use = pytest.raises(DeviceUnavailableError, match="is in use by another program")
    with wear(first), in_use if refused else nullcontext(), wear(second):
        pass
    with wear(second):
        pass  # free again


@pytest.mark.slow
@pytest.mark.parametrize("verb", [("vest", "identify"), ("run",)])
def test_a_vest_that_is_worn_in_a_run_is_refused_to_other_programs(verb, tmp_path) -> None:
    with emulated_lab(tmp_path, vest=True, fingers=("thumb",)) as lab:
        config = tmp_path / "lab.toml"
        config.write_text(tree_text(lab.tree), encoding="utf-8")
        loaded = load_config(config).config
        with worn_vest(loaded.vest, dose_file(loaded.calibration)):
            words = [sys.executable, "-m", "tega.ui.cli", *verb, str(config)]
            env = {**os.environ, **lab.environment}
            done = subprocess.run(words, capture_output=True, text=True, check=False, env=env)
    assert done.returncode == 3, done.stderr
    assert "is in use by another program" in done.stderr


TOUCHED = {"index": Contact(finger="index", t_ns=0, in_contact=True)}


@pytest.mark.parametrize(("second_ms", "n"), [(100, 1), (490, 1), (500, 2), (900, 2)])
def test_an_event_is_shown_again_after_pulse_and_gap(second_ms: int, n: int) -> None:
    setup = VestSetup(find_layout("x40"), ("index",), {"index": {}})
    mapping = PulsesMapping(setup, PulsesOptions(duration_s=0.2, gap_s=0.3))
    lit = 0
    for t_ms in range(0, 1200, 10):
        events = [Event(t_ns=t_ms * MS, kind="contact", finger="index")] if t_ms in {0, second_ms} else []
        lit += mapping.levels(t_ms * MS, TOUCHED, events).max() > 0
    assert mapping.n_told["contact"] == n
    assert lit == 20 * n
