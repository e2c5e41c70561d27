"""Pedals against their emulators in other processes, and their pure parts with time as a number."""

from __future__ import annotations

import sys
import threading
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference.held import PEDAL, TWO, emulated, pedal, spacemouse
from reference.processes import until
from tega.config import check_tree
from tega.devices.input.hid_input import AT_REST, Debounce
from tega.devices.input.pedal import Pedal
from tega.errors import ConfigError

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the emulators need Linux")

PEDALS = [
    ("pedal-keyboard", PEDAL, {}, "b"),
    ("pedal-keyboard-numbered", (0x3553, 0xB001), {}, "b"),
    ("pedal-joystick", (0x05F3, 0x00FF), {"report": "joystick", "vendor_id": 0x05F3, "button_byte": 3}, "1"),
]


@pytest.mark.parametrize(("device", "numbers", "options", "button"), PEDALS)
def test_a_step_is_one_press_and_letting_go_releases(
    device: str, numbers: tuple[int, int], options: dict[str, Any], button: str
) -> None:
    with emulated(device, numbers) as peer, pedal(**options) as foot:
        assert foot.state().held == frozenset()
        peer.say("chatter 0 4")
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
def test_a_release_counts_at_once_and_presses_only_when_they_hold(
    steps: list[tuple[int, bool]], hold: int
) -> None:
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
