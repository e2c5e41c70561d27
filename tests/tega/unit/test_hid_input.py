"""SpaceMouse and pedals against their emulators in other processes, and their pure parts with time as a number."""

from __future__ import annotations

import struct
import sys
import threading
import time
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference.held import MS, ONE, PEDAL, TWO, emulated, holds, moves, pedal, spacemouse
from reference.processes import until
from tega.config import check_tree
from tega.devices.input import hid_input
from tega.devices.input.hid_input import AT_REST, Debounce, HidInput
from tega.devices.input.pedal import Pedal
from tega.devices.input.spacemouse import MODELS, NOT_SIX_AXES, SpaceMouse
from tega.errors import ConfigError, DeviceUnavailableError
from tega_emulators.hid_input import InputDevice
from tega_emulators.hid_port import HidBoard, HidPort
from tega_emulators.process import Emulator

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the emulators need Linux")

# The cap pushed or turned along one of its own axes, and what the robot's base makes of it: looking along x, the cap's
# x is right (-y), its y towards the operator (-x), its z down (-z).
AXES = [(0, 1, -1), (1, 0, -1), (2, 2, -1), (3, 4, -1), (4, 3, -1), (5, 5, -1)]


@pytest.mark.parametrize(("device", "numbers"), [("spacemouse", TWO), ("spacemouse-wireless", ONE)])
def test_every_axis_of_both_layouts_arrives_with_its_sign(device: str, numbers: tuple[int, int]) -> None:
    with emulated(device, numbers) as peer, spacemouse() as mouse:
        assert mouse.info.label == MODELS[numbers]
        assert mouse.state().motion == AT_REST
        for axis, robot, sign in AXES:
            for counts in (350, -350, 176):
                wanted = [0.0] * 6
                wanted[robot] = sign * (1 if counts > 0 else -1) * (min(abs(counts) / 350, 1) - 0.06) / 0.94
                peer.say("push " + " ".join(str(counts * (i == axis)) for i in range(6)))
                until(moves(mouse, wanted))
            peer.say("push 0 0 0 0 0 0")
            until(lambda: mouse.state().motion == AT_REST)
        assert mouse.state().live
        assert mouse.info.notes == ()


def test_a_frozen_cap_is_at_rest_after_its_watchdog_and_says_no_data() -> None:
    with emulated("spacemouse", TWO) as peer, spacemouse() as mouse:
        peer.say("press 0")
        peer.say("push 0 -300 0 0 0 100")
        until(lambda: mouse.state().motion[0] > 0.8 and mouse.state().held == {"left"})
        peer.say("freeze")
        until(lambda: not mouse.state().live)
        assert mouse.state().motion == AT_REST
        assert mouse.state().held == frozenset()
        assert [(e.button, e.pressed) for e in mouse.events()] == [("left", True), ("left", False)]
        assert "fell silent in the middle" in mouse.info.notes[0]
        peer.say("clear")
        until(lambda: mouse.state().live and mouse.state().motion[0] > 0.8)
        # A button that was down all the time has to be let go before it counts again.
        assert mouse.state().held == frozenset()


def report(mouse: HidInput, t_ms: int, body: bytes) -> bool:
    took = mouse._take(body, t_ms * MS)
    mouse._pass_time(t_ms * MS)
    return took


def test_each_half_of_the_two_reports_has_its_own_watchdog() -> None:
    mouse = spacemouse(dead_zone=0.0)
    assert report(mouse, 0, b"\x01" + struct.pack("<3h", 0, -350, 0))
    assert report(mouse, 0, b"\x02" + struct.pack("<3h", 0, 0, -175))
    for t_ms in range(10, 101, 10):
        assert report(mouse, t_ms, b"\x01" + struct.pack("<3h", 0, -350, 0))
        assert mouse._motion() == (1.0, 0, 0, 0, 0, 0.5)
    report(mouse, 101, b"\x01" + struct.pack("<3h", 0, -350, 0))
    assert mouse._motion() == (1.0, 0, 0, 0, 0, 0)
    assert not mouse._is_stalled
    mouse._pass_time(201 * MS)
    assert mouse._motion()[0] == 1.0
    mouse._pass_time(202 * MS)
    assert mouse._motion() == AT_REST
    assert mouse._is_stalled
    mouse._pass_time(10_000 * MS)
    assert mouse.counts.stalled == 1


def test_a_cap_at_rest_may_be_silent_for_ever_and_half_a_report_of_buttons_releases_it() -> None:
    mouse = spacemouse()
    report(mouse, 0, b"\x01" + bytes(6))
    mouse._pass_time(10**9 * MS)
    assert not mouse._is_stalled
    assert report(mouse, 0, b"\x03\x01\x00")
    assert mouse._buttons.held == {"left"}
    assert not report(mouse, 1, b"\x03")
    assert mouse._buttons.held == frozenset()


BROKEN = [
    b"\x01\x00\x01",
    b"\x01" + bytes(8),
    b"\x02" + bytes(12),
    b"\x09" + bytes(6),
    b"\x03",
    b"\x01" + struct.pack("<3h", 0, 701, 0),
    b"\x01" + struct.pack("<6h", 0, 0, 0, 0, 0, -32768),
]


@pytest.mark.parametrize("body", BROKEN, ids=lambda b: b.hex())
def test_what_is_no_report_moves_nothing(body: bytes) -> None:
    mouse = spacemouse()
    assert not report(mouse, 0, body)
    assert mouse._motion() == AT_REST


@given(st.binary(min_size=1, max_size=64))
def test_any_bytes_leave_motion_within_its_range(body: bytes) -> None:
    mouse, stepper = spacemouse(), pedal()
    mouse._take(body, 0)
    stepper._take(body, 0)
    assert all(-1 <= share <= 1 for share in mouse._motion())


def test_buttons_battery_and_a_flood_of_reports() -> None:
    with emulated("spacemouse-wireless", ONE) as peer, spacemouse() as mouse:
        for button, name in ((0, "left"), (1, "right"), (4, "button 5")):
            peer.say(f"press {button}")
            until(holds(mouse, name))
            peer.say(f"lift {button}")
            until(lambda: mouse.state().held == frozenset())
        events = mouse.events()
        assert [e.seq for e in events] == list(range(6))
        assert [e.pressed for e in events] == [True, False] * 3
        assert mouse.events() == ()
        before = mouse.counts.reports
        peer.say("flood 100")
        until(lambda: mouse.counts.reports > before and mouse.state().motion == AT_REST)
    low = spacemouse()
    low._take(b"\x17\x09", 0)
    assert low.info.notes == ("its battery is at 9 %",)


@pytest.mark.parametrize("how", ["unplug", "power-cycle", "a bug"])
def test_an_unplugged_cap_is_at_rest_and_comes_back(how: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with emulated("spacemouse", TWO) as peer, spacemouse() as mouse:
        peer.say("push 200 0 0 0 0 0")
        peer.say("press 1")
        until(lambda: mouse.state().motion != AT_REST and bool(mouse.state().held))
        if how == "a bug":
            monkeypatch.setattr(mouse, "_pass_time", lambda _t_ns: 1 / 0)
        peer.say("plug" if how == "a bug" else how)
        until(lambda: mouse.counts.lost > 0)
        assert (mouse.state().motion, mouse.state().held) == (AT_REST, frozenset())
        monkeypatch.undo()
        peer.say("plug")
        until(lambda: mouse.state().live)
        peer.say("push 0 0 350 0 0 0")
        until(lambda: mouse.state().motion == (0, 0, -1.0, 0, 0, 0))
        assert f"lost {mouse.counts.lost} times" in mouse.info.notes[0]
    with pytest.raises(DeviceUnavailableError, match="not open"):
        _ = mouse.state()


@pytest.mark.parametrize("fault", ["garbage", "half"])
def test_bad_reports_are_counted_and_never_move(fault: str) -> None:
    with emulated("spacemouse-wireless", ONE) as peer, spacemouse() as mouse:
        peer.say("push 300 0 0 0 0 0")
        until(lambda: mouse.state().motion[1] < -0.8)
        peer.say(fault)
        until(lambda: mouse.counts.odd > 20)
        until(lambda: not mouse.state().live and mouse.state().motion == AT_REST)
        peer.say("clear")
        until(lambda: mouse.state().motion[1] < -0.8)
        assert "could not be read" in mouse.info.notes[0]


def test_which_device_is_taken() -> None:
    with Emulator("hid_input", "--device", "spacemouse-wireless") as peer:
        cad = HidBoard(peer.port, 0x256F, 0xC650)
        keys = HidBoard(peer.port + ".none", *ONE, usage=(1, 6))
        without = "256f:c650 is a mouse or keyboard without six axes"
        with HidPort(cad).installed(), pytest.raises(DeviceUnavailableError, match=without):
            spacemouse().open()
        with HidPort(HidBoard(peer.port, 0x256F, 0xC6FF)).installed():
            with pytest.raises(DeviceUnavailableError, match=r"found 256f:c6ff.*set product_id"):
                spacemouse().open()
            with spacemouse(product_id=0xC6FF) as mouse:
                assert mouse.info.label == "256f:c6ff"
        with HidPort(keys, HidBoard(peer.port, *ONE, usage=(1, 8))).installed():
            spacemouse().open()
        locked = HidPort(HidBoard(peer.port, *ONE), can_open=False).installed()
        with locked, pytest.raises(DeviceUnavailableError, match=r"does not open.*udev rule"):
            spacemouse().open()
        absent: tuple[tuple[HidInput, str], ...] = (
            (spacemouse(), "no SpaceMouse is there"),
            (spacemouse(serial="X"), "with the serial number X is there"),
            (pedal(), r"no pedal that is known.*set vendor_id"),
            (pedal(vendor_id=0x05F3, product_id=0x00FF), "no device 05f3:00ff is there"),
        )
        for source, says in absent:
            with HidPort().installed(), pytest.raises(DeviceUnavailableError, match=says):
                source.open()
        twice = HidBoard(peer.port, *ONE, "A")
        with HidPort(twice, twice, HidBoard(peer.port, *PEDAL, ""), HidBoard(peer.port)).installed():
            (cap,), (foot,) = SpaceMouse.discover(1.0), Pedal.discover(1.0)
        assert (cap.label, cap.options["serial"]) == ("SpaceMouse Wireless (cable) A", "A")
        assert foot.label == "PCsensor FootSwitch"
        assert foot.options == {"vendor_id": PEDAL[0], "product_id": PEDAL[1]}
    assert not set(MODELS) & NOT_SIX_AXES


def test_the_emulator_s_reports_are_those_of_the_fact_sheet() -> None:
    device = InputDevice("spacemouse")
    device.axes, device.buttons = [1, -2, 3, -4, 5, 350], {0, 1}
    assert [r.hex() for r in device.motion()] == ["010100feff0300", "02fcff05005e01"]
    assert device.pressed().hex() == "030300"
    device = InputDevice("spacemouse-wireless")
    device.axes = [1, -2, 3, -4, 5, 350]
    assert [r.hex() for r in device.motion()] == ["010100feff0300fcff05005e01"]


PEDALS = [
    ("pedal-keyboard", PEDAL, {}, "b"),
    ("pedal-keyboard-numbered", (0x3553, 0xB001), {}, "b"),
    ("pedal-joystick", (0x05F3, 0x00FF), {"report": "joystick", "vendor_id": 0x05F3, "button_byte": 3}, "1"),
]


@pytest.mark.parametrize(("device", "numbers", "options", "button"), PEDALS)
def test_a_step_is_one_press_and_letting_go_releases(device, numbers, options, button, monkeypatch) -> None:
    with emulated(device, numbers) as peer, pedal(**options) as foot:
        assert foot.state().held == frozenset()
        with monkeypatch.context() as stopped:  # however late a busy machine sends and reads each bounce
            stopped.setattr(
                hid_input, "time", SimpleNamespace(monotonic_ns=partial(int, time.monotonic_ns()))
            )
            peer.say("chatter 0 4")
            until(lambda: foot.counts.reports == 9)
        until(lambda: foot.state().held == {button})
        peer.say("lift 0")
        until(lambda: foot.state().held == frozenset())
        assert [(e.button, e.pressed) for e in foot.events()] == [(button, True), (button, False)]
        assert foot.state().motion == AT_REST
        peer.say("press 0")
        until(lambda: foot.state().held == {button})
        peer.say("unplug")
        until(lambda: not foot.state().live)
        assert foot.state().held == frozenset()
        assert [e.pressed for e in foot.events()] == [True, False]
        peer.say("plug")
        until(lambda: foot.state().live)
        assert foot.state().held == frozenset()


def test_a_pedal_that_repeats_itself_is_released_when_it_freezes() -> None:
    options = {"report": "joystick", "vendor_id": 0x05F3, "button_byte": 3, "silent_after_ms": 100.0}
    with emulated("pedal-repeating", (0x05F3, 0x00FF)) as peer, pedal(**options) as foot:
        peer.say("press 1")
        until(lambda: foot.state().held == {"2"})
        peer.say("freeze")
        until(lambda: not foot.state().live)
        assert foot.state().held == frozenset()
        peer.say("clear")
        until(lambda: foot.counts.reports > 0 and foot._buttons.held == frozenset())
        peer.say("lift 1")
        until(lambda: foot.state().live)
        peer.say("press 1")
        until(lambda: foot.state().held == {"2"})


@pytest.mark.parametrize(("device", "numbers"), [("pedal-keyboard", PEDAL), ("spacemouse", TWO)])
def test_one_that_only_tells_of_changes_has_to_be_pressed_anew(device: str, numbers: tuple[int, int]) -> None:
    make = pedal if numbers == PEDAL else spacemouse
    with emulated(device, numbers) as peer, make(silent_after_ms=300.0) as source:
        for _ in range(2):
            peer.say("press 0")
            until(lambda: len(source.state().held) == 1)
            until(lambda: not source.state().live)  # nobody can tell whether it froze
            assert source.state().held == frozenset()
            peer.say("lift 0")
            until(lambda: source.state().live)
        assert source.counts.stalled == 2
        assert [e.pressed for e in source.events()] == [True, False] * 2


def test_a_dead_man_that_could_freeze_unseen_is_refused() -> None:
    for driver in ("pedal", "spacemouse"):
        tree: dict[str, Any] = {"input": {"dead_man": {"driver": driver}}}
        with pytest.raises(ConfigError, match=f"a {driver} that freezes while it is held") as error:
            check_tree(tree, {}, base=Path.cwd())
        assert "silent_after_ms: 100 where it repeats" in error.value.hint
        tree["input"]["dead_man"]["options"] = {"silent_after_ms": 5000}
        check_tree(tree, {}, base=Path.cwd())
        check_tree({"input": {"marker": {"driver": driver}}}, {}, base=Path.cwd())


def test_keys_of_a_keyboard() -> None:
    pressed = {"left ctrl", "right ctrl", "a", "z", "key 0x3a"}
    assert Pedal._keys(bytes([0b00010001, 0, 4, 29, 0x3A, 0, 0, 0])) == pressed
    assert Pedal._keys(bytes(8)) == set()
    for odd in ([0, 0, 1, 1, 1, 1, 1, 1], [0, 7, 4, 0, 0, 0, 0, 0], [0] * 7, [2, 0, 0, 5, 0, 0, 0, 0, 0]):
        assert Pedal._keys(bytes(odd)) is None


steps = st.lists(st.tuples(st.integers(0, 60), st.booleans()), max_size=60)


@given(steps, st.integers(0, 40))
def test_a_release_counts_at_once_and_presses_only_when_they_hold(steps, hold) -> None:
    debounce, t, since, edges = Debounce(hold), 0, None, []
    for wait, down in steps:
        t += wait
        edges += list(debounce.take(t, {"x"} if down else set()))
        since = (t if since is None else since) if down else None
        assert bool(debounce.held) == (since is not None and t - since >= hold)
    presses = [e.t_ns for e in edges if e.pressed]
    releases = [e.t_ns for e in edges if not e.pressed]
    assert len(presses) - len(releases) in {0, 1}
    assert all(up - down >= hold for down, up in zip(presses, releases, strict=False))
    assert [e.pressed for e in edges] == [True, False] * (len(edges) // 2) + [True] * (len(edges) % 2)


def test_what_a_pedal_says_that_cannot_be_read_releases_it_until_it_is_let_go() -> None:
    foot = pedal(debounce_ms=0.0)
    pressed, lifted = bytes([0, 0, 5, 0, 0, 0, 0, 0]), bytes(8)
    foot._there, foot._thread = True, threading.current_thread()
    assert foot._take(pressed, 0)
    assert foot.state().held == {"b"}
    assert not foot._take(lifted[:4], 1)
    assert (foot.state().held, foot.state().live) == (frozenset(), False)
    assert foot._take(pressed, 2)
    assert foot.state().held == frozenset()
    assert foot._take(lifted, 3)
    assert foot.state().live
    assert foot._take(pressed, 4)
    assert foot.state().held == {"b"}
    assert [e.pressed for e in foot.events()] == [True, False, True]
    foot._thread = None
