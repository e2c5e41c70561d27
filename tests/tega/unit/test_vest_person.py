"""The vest on a person: what they feel, one wearer a time, the least pulse."""

from __future__ import annotations

import os
import subprocess
import sys
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import numpy as np
import pytest

from reference.command import call
from reference.scripted import touching
from reference.vest_bench import KeptVest
from tega.config import VestConfig, load_config
from tega.config.calibration import TouchMaxima
from tega.devices.base import BudgetedVest
from tega.devices.vest.vest_stream import VestOptions
from tega.errors import DeviceUnavailableError, InvalidValueError, ShapeError
from tega.haptics import FeltMap, vest_frame
from tega.haptics.motor_layout import find_layout
from tega.loop.touch import TouchLoop
from tega.loop.worn_vest import NAMELESS, dose_file, worn_vest
from tega.records import Contact, Event
from tega.runtime.files.toml_text import tree_text
from tega.stages.base import VestSetup
from tega.stages.pulses import PulsesMapping, PulsesOptions
from tega_emulators.lab import emulated_lab


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


def test_the_weakest_motor_sets_how_far_all_go() -> None:
    threshold = [10.0] * 40
    threshold[5] = 70.0
    felt = FeltMap(threshold=threshold, step=5).apply(vest_frame([100] * 4, [100] * 4, layout="x40"))
    assert felt.intensities[5] == 100
    assert set(np.delete(felt.intensities, 5).tolist()) == {40}


@pytest.mark.parametrize(
    ("how", "error", "message"),
    [
        ({"threshold": 100}, InvalidValueError, r"threshold = 100 is out of range: 0 to 99 percent"),
        ({"step": 0}, InvalidValueError, r"step = 0 is out of range"),
        ({"step": float("nan")}, InvalidValueError, r"step = nan"),
        ({"threshold": [1, 2, 3]}, ShapeError, r"threshold has shape \(3,\)"),
    ],
)
def test_what_nobody_can_feel_is_refused(how: dict[str, Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        FeltMap(**how)


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
    _, err = call(capsys, "vest", "identify", *words, "--set", "vest.layout=x16", "--motor", 4, code=1)
    assert "motor 4 is not one of layout 'x16'" in err
    assert "it has 0, 1, 2, 3, 8" in err
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


MS = 1_000_000
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
