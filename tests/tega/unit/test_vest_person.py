"""What one person feels: the map in the loop, its settings, and the verb that lights one motor."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reference.scripted import touching
from tega.config import load_config
from tega.config.calibration import TouchMaxima
from tega.devices.table_recorder import TableRecorderOptions
from tega.devices.vest.vest_recorder import VestRecorder
from tega.errors import ConfigError, InvalidValueError, ShapeError
from tega.haptics import FeltMap, vest_frame
from tega.loop.touch import TouchLoop
from tega.runtime.clock import ManualClock
from tega.setup.calibration.identify import light_motor, motor_place
from tega.ui.cli.main import main


def touched(loop: TouchLoop) -> list[int]:
    loop.update("thumb", touching(700))
    frame: list[int] = loop.frame(0).intensities.tolist()
    return frame


def test_the_loop_sends_what_this_person_feels_and_rest_stays_rest() -> None:
    maxima = {"thumb": TouchMaxima(cci_max=1.0, eda_max=1400.0)}
    plain = touched(TouchLoop(maxima, layout="paper32"))
    felt = touched(TouchLoop(maxima, layout="paper32", felt=FeltMap(threshold=20)))
    assert (plain[0], plain[16]) == (50, 50)
    assert (felt[0], felt[16]) == (60, 60)
    assert not any(felt[1:4])
    loop = TouchLoop(maxima, layout="paper32", felt=FeltMap(threshold=20))
    assert not loop.silence().intensities.any()


def test_mirrored_the_thumb_is_at_the_other_end() -> None:
    maxima = {"thumb": TouchMaxima(cci_max=1.0, eda_max=1400.0)}
    back = touched(TouchLoop(maxima, layout="paper32", mirror="back"))
    assert (back[0], back[3], back[16], back[19]) == (50, 0, 0, 50)


def test_the_weakest_motor_sets_how_far_all_go() -> None:
    threshold = [10.0] * 40
    threshold[5] = 70.0
    felt = FeltMap(threshold=threshold, step=5).apply(vest_frame([100] * 4, [100] * 4, layout="x40"))
    assert felt.intensities[5] == 100
    assert set(np.delete(felt.intensities, 5).tolist()) == {40}


def test_what_nobody_can_feel_is_refused() -> None:
    with pytest.raises(InvalidValueError, match=r"threshold = 100 is out of range: 0 to 99 percent"):
        FeltMap(threshold=100)
    with pytest.raises(InvalidValueError, match=r"step = 0 is out of range"):
        FeltMap(step=0)
    with pytest.raises(InvalidValueError, match=r"step = nan"):
        FeltMap(step=float("nan"))
    with pytest.raises(ShapeError, match=r"threshold has shape \(3,\)"):
        FeltMap(threshold=[1, 2, 3])


def test_the_settings_take_one_number_or_forty() -> None:
    vest = load_config(None, environ={}, sets=["vest.threshold=20", f"vest.step={[2.5] * 40}"]).config.vest
    assert (vest.threshold, vest.step) == (20.0, (2.5,) * 40)
    with pytest.raises(ConfigError, match=r"vest\.threshold = 120: expected a number <= 99"):
        load_config(None, environ={}, sets=["vest.threshold=120"])
    with pytest.raises(ConfigError, match=r"vest\.step = \[1, 2\]: expected a list of length >= 40"):
        load_config(None, environ={}, sets=["vest.step=[1, 2]"])


def test_one_motor_is_lit_for_its_time_and_then_none(tmp_path: Path) -> None:
    with VestRecorder(TableRecorderOptions(file=tmp_path / "v.csv")) as vest:
        light_motor(vest, 23, layout="x40", percent=40, duration_s=0.2, clock=ManualClock())
        with pytest.raises(
            InvalidValueError, match=r"motor 4 is not one of layout 'x16'.*it has 0, 1, 2, 3, 8"
        ):
            light_motor(vest, 4, layout="x16", percent=40, duration_s=0.2, clock=ManualClock())
    header, *rows = [line.split(",") for line in (tmp_path / "v.csv").read_text().splitlines()]
    lit = [{h for h, v in zip(header[1:], row[1:], strict=True) if v != "0"} for row in rows]
    assert lit == [{"m23"}] * 5 + [set()]
    assert motor_place(20) == "back, row 1 of 5 from the top, column 1 of 4 from the wearer's left"


def test_the_verb_names_the_place_of_every_motor_it_lights(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "v.csv"
    words = [
        "vest",
        "identify",
        "--set",
        "vest.driver=vest-recorder",
        "--set",
        f"vest.options.file={out}",
        "--motor",
        "3",
    ]
    with pytest.raises(SystemExit) as done:
        main([*words, "--motor", "36", "--seconds", "0.1"])
    assert done.value.code == 0
    text = capsys.readouterr().out
    assert text.splitlines() == [
        "motor  3: front, row 1 of 5 from the top, column 4 of 4 from the wearer's left",
        "motor 36: back, row 5 of 5 from the top, column 1 of 4 from the wearer's left",
    ]
    assert out.read_text().count("\n") == 9
    with pytest.raises(SystemExit) as done:
        main(["vest", "identify"])
    assert done.value.code == 1
    assert "hint: for example --set vest.driver=bhaptics-player" in capsys.readouterr().err
