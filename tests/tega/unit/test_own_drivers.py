"""Drivers of other packages, which share no class with the built-in ones, are heard like these."""

from __future__ import annotations

import time
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from reference.kept import muscle_file
from reference.parts import observed
from tega.config import check_tree
from tega.devices import registry
from tega.devices.base import DeviceInfo, EmgChunk, Found, Options, SteeredHand, optional
from tega.errors import CalibrationError
from tega.hand import CLOSURE_POSES_RAD
from tega.loop.maxima import emg_conditions
from tega.loop.session import run_session
from tega.runtime import features as plugins
from tega.setup.calibration.sitting import Times
from tega.setup.calibration.steps_emg import MuscleSteps
from tega.setup.doctor import probe_all
from tega.ui.cli.guide import LineGuide

_RATE_HZ = 500.0


class Own:
    """What a driver has to have, written from the protocol alone."""

    summary: ClassVar[str] = "somebody's device"
    extra: ClassVar[str] = ""
    requires: ClassVar[tuple[str, ...]] = ()
    options_type: ClassVar[type[Options]] = Options

    def __init__(self, _options: Options) -> None:
        self.opened_s = 0.0

    def open(self) -> None:
        self.opened_s = time.monotonic()

    def close(self) -> None:
        self.opened_s = 0.0

    def __enter__(self) -> Any:
        self.open()
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()


class OwnAmplifier(Own):
    """Every channel lies at the converter's limit, where a cable that fell out leaves it."""

    kind: ClassVar = "emg"
    limits = (0.0, 1023.0)
    measured_hz = 499.0
    faults = ("ch2: the cable is out",)
    ended = False
    n_given = 0

    @property
    def info(self) -> DeviceInfo:
        channels = ("ch1", "ch2", "ch3")
        return DeviceInfo(
            driver="own-emg", kind="emg", label="own", live=True, rate_hz=_RATE_HZ, channels=channels
        )

    def read(self, timeout_s: float) -> EmgChunk | None:
        time.sleep(min(timeout_s, 0.01))
        n = round((time.monotonic() - self.opened_s) * _RATE_HZ) - self.n_given
        if n <= 0:
            return None
        self.n_given += n
        samples = np.random.default_rng(self.n_given).normal(1023.0, 1e-3, (n, 3)).clip(1023.0)
        return EmgChunk(time.monotonic_ns(), self.n_given - n, samples)


class OwnHand(Own):
    """A hand that steers itself and has something to say."""

    kind: ClassVar = "hand"
    label: ClassVar[str] = "own hand"
    problem = "own hand: finger 2 is warm"
    angles_rad = np.array(CLOSURE_POSES_RAD[0])

    @property
    def info(self) -> DeviceInfo:
        return DeviceInfo(driver="own-hand", kind="hand", label="own", live=True)

    def step(self, _level: float, _added: float) -> tuple[()]:
        return ()

    def limp(self) -> tuple[()]:
        return ()


class PlainHand(OwnHand):
    """One that says nothing of itself, and can be found."""

    problem = property()  # as if there were none

    @classmethod
    def discover(cls, _timeout_s: float) -> list[Found]:
        return [Found(driver="plain-hand", label="plain")]

    def open(self) -> None:
        assert self.may_open, "a hand was opened that cannot be opened without force"

    may_open: ClassVar[bool] = True


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have the drivers found as those of an installed package are."""
    found = plugins.plugins
    own = {}
    for name, value in {"own-emg": "OwnAmplifier", "own-hand": "OwnHand", "plain-hand": "PlainHand"}.items():
        own[name] = EntryPoint(name, f"{__name__}:{value}", registry.GROUP)

    def with_own(group: str) -> dict[str, EntryPoint]:
        return dict(found(group)) | (own if group == registry.GROUP else {})

    monkeypatch.setattr(plugins, "plugins", with_own)
    monkeypatch.setattr(registry, "plugins", with_own)


def alerts_of(tmp_path: Path, hand: str) -> set[str]:
    tree = {
        "session": {"duration_s": 1.5, "out_dir": str(tmp_path / hand)},
        "calibration": {"file": str(muscle_file(tmp_path, 1.0, 1.0, 1.0, rate_hz=_RATE_HZ))},
        "emg": {"driver": "own-emg", "kind": "raw"},
        "hand": {"driver": hand},
    }
    seen: set[str] = set()
    run_session(
        check_tree(tree, {}, base=tmp_path).config, bus=observed(lambda view: seen.update(view.alerts))
    )
    return seen


@pytest.mark.usefixtures("installed")
@pytest.mark.raises("signal")
@pytest.mark.raises("hand")
def test_a_run_shows_what_a_hand_and_an_amplifier_of_others_have_to_say(tmp_path: Path) -> None:
    assert isinstance(OwnHand(Options()), SteeredHand)
    seen = alerts_of(tmp_path, "own-hand")
    assert "own hand: finger 2 is warm" in seen
    assert "emg: ch2: the cable is out" in seen


@pytest.mark.usefixtures("installed")
def test_a_hand_that_says_nothing_of_itself_is_run_all_the_same(tmp_path: Path) -> None:
    assert optional(PlainHand(Options()), "problem") == ""
    assert not any("hand" in alert for alert in alerts_of(tmp_path, "plain-hand"))


@pytest.mark.usefixtures("installed")
def test_a_hand_that_is_found_takes_part_in_a_check_that_does_not_open_it(monkeypatch) -> None:
    monkeypatch.setattr(PlainHand, "may_open", False)
    (finding,) = [f for f in probe_all().findings if f.driver == "plain-hand"]
    assert finding.check == "allegro"
    assert "was not opened" in finding.finding


def test_the_converters_limits_of_others_are_used_in_calibration(capsys: pytest.CaptureFixture[str]) -> None:
    source: Any = OwnAmplifier(Options())
    guide = LineGuide(yes=True, get_ready_s=0.0)
    with source, pytest.raises(CalibrationError):
        MuscleSteps(source, emg_conditions(source, "raw"), guide, Times(rest_s=0.8)).rest()
    assert "at the converter's limit" in capsys.readouterr().err
