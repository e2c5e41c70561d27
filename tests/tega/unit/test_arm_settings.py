"""What is refused of an arm's settings, in words."""

from __future__ import annotations

import sys

import pytest

from tega.config import load_config
from tega.errors import ConfigError
from tega.loop import run_session
from tega.recording.replay.play import _settings

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs Linux or macOS")


_HELD = ("input.dead_man.driver=spacemouse", "input.dead_man.options.silent_after_ms=1000")
_LED = ("input.motion.driver=spacemouse", "arm.mapping.frame=base", "arm.mapping.absolute=true")
_TRACKED = ("arm.tracker.driver=hololens", "arm.tracker.options.host=h", "arm.mapping.frame=base")


@pytest.mark.parametrize(
    ("sets", "text"),
    [
        (_HELD, "nothing leads it"),
        (_HELD + _LED, "absolute is for programs"),
        ((), "no dead-man switch is set"),
        (("session.pace=fast",), "an arm moves in real time"),
        (_HELD + _TRACKED, "set arm.mapping.frame = 'openxr'"),
    ],
)
def test_settings_of_an_arm_that_do_not_fit_are_said_in_words(
    sets: tuple[str, ...], text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    from tega.devices.input.spacemouse import SpaceMouse

    monkeypatch.setattr(SpaceMouse, "open", lambda _self: None)
    config = load_config(None, environ={}, sets=["arm.driver=simulated-arm", *sets]).config
    with pytest.raises(ConfigError, match=text):
        run_session(config)


def test_a_recording_that_is_played_moves_no_arm() -> None:
    then = load_config(None, environ={}, sets=["arm.driver=simulated-arm"]).config
    assert then.arm is not None
    assert _settings(then, then, speed=1.0, vest_pace="steady").arm is None


@pytest.mark.parametrize(
    ("key", "value", "text"),
    [
        ("arm.limits.low_m", "[0.8, -0.4, 0.0]", "workspace's x goes from 0.8 to 0.7 m"),
        ("arm.options.speed", "1", "did you mean 'speed_m_s'"),
        ("arm.tracker.driver", "spacemouse", "kind 'input', not 'tracker'"),
    ],
)
def test_a_wrong_setting_of_the_arm_is_named(key: str, value: str, text: str) -> None:
    with pytest.raises(ConfigError, match=text):
        load_config(None, environ={}, sets=["arm.driver=simulated-arm", f"{key}={value}"])
