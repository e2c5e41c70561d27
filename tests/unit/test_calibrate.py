"""``tega-teleop calibrate`` against emulators in other processes: what it keeps, refuses, warns of, and how it goes on."""

from __future__ import annotations

import json
import tomllib
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from reference.wizard import Wizard, presses, records

from tega.calibration.folder import CalibrationFolder
from tega.calibration.records import EmgRecord, TouchRecord, VestRecord, utc_now, write_record
from tega.cli.main import main
from tega.testing.emulators.digit import DigitProcess
from tega.testing.emulators.process import Emulator

RESTING, WORKING = 0.04, 1.0


def lab(path: Path, *parts: str) -> Path:
    file = path / "lab.toml"
    file.write_text("\n".join(parts))
    return file


def thumb(sensor: DigitProcess, serial: str = "D20641") -> str:
    return (
        '[tactile.thumb]\ndriver = "digit"\n'
        f'options = {{ source = "{sensor.source}/{serial}", warm_up_s = 0.1 }}\n'
    )


def muscles(board: Emulator, more: str = "") -> str:
    return (
        '[emg]\ndriver = "serial-emg"\nkind = "raw"\n'
        f'options = {{ port = "{board.port}", rate_hz = 500.0, bits = 10, measure_s = 0.5{more} }}\n'
    )


def teleop(*words: str) -> int:
    with pytest.raises(SystemExit) as done:
        main(list(words))
    code: int = done.value.code  # type: ignore[assignment]
    return code


class Presser:
    """Does with a fingertip what the wizard asks for."""

    def __init__(self, sensor: DigitProcess, firmness: list[float] | None = None) -> None:
        self._sensor = sensor
        self._firmness = [0.8, 0.9, 1.0, 0.9, 0.8] if firmness is None else firmness

    def __call__(self, prompt: str) -> str | None:
        if "press firmly" in prompt:
            presses(self._sensor.command, self._firmness)
        return "q" if prompt.startswith("?") else ""


class Mover:
    """Does with muscles what the wizard asks for; ``wired`` says which muscle each channel really sits on."""

    def __init__(self, board: Emulator, wired: tuple[int, ...] = (1, 2, 3)) -> None:
        self._board = board
        self._wired = wired
        self.full = WORKING

    def __call__(self, prompt: str) -> str | None:
        self._board.say(f"effort {RESTING}")
        if "fist" in prompt:
            self._board.say(f"effort {self.full}")
        for k, channel in enumerate(self._wired):
            if f"ch{k + 1} sits on" in prompt:
                self._board.say(f"effort 0.5 {channel}")
        return "q" if prompt.startswith("?") else ""


def calibrate(file: Path, answer: Any, *more: str) -> Wizard:
    words = ["calibrate", str(file), "--person", "p01", "--json", "--time-scale", "0.2", *more]
    wizard = Wizard(words, answer)
    wizard.code = wizard.run()  # type: ignore[attr-defined]
    return wizard


def test_a_finger_is_calibrated_and_a_run_uses_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with DigitProcess() as sensor:
        file = lab(tmp_path, thumb(sensor))
        assert teleop("run", str(file), "--set", "session.duration_s=1") == 1
        assert f"hint: tega-teleop calibrate {file} --person ID" in capsys.readouterr().err
        wizard = calibrate(file, Presser(sensor))
        assert wizard.code == 0, wizard.said
        kept = list(records(tmp_path / "calibrations"))
        assert [name.split("/")[0] for name in kept] == ["gels", "gels", "people"]
        assert kept[-1] == "people/p01/touch-D20641.toml"
        tree = tomllib.loads((tmp_path / "calibrations" / kept[-1]).read_text())
        assert (tree["person"], tree["finger"], tree["n_presses"]) == ("p01", "thumb", 5)
        assert tree["live"]["eda_max"] > 4000
        assert tree["live"]["cci_max"] > 10 * tree["paper"]["cci_max"] > 0
        assert wizard.told["files"][0]["record"]["device"] == "D20641"
        sensor.command("press 1")
        assert teleop("run", str(file), "--person", "p01", "--set", "session.duration_s=1", "--json") == 0
        summary = json.loads(capsys.readouterr().out)
        assert summary["tactile"]["thumb"]["eda_max"] == tree["live"]["eda_max"]
        assert summary["calibration"]["file"] == "calibration of p01"
        assert not summary["calibration"]["self_calibrated"]
        assert not [note for note in summary["notes"] if "old" in note]
        # Another person, another sensor, an old record.
        assert teleop("run", str(file), "--person", "p02") == 1
        said = capsys.readouterr().err
        assert "p02 has no calibration on D20641 (there is one of p01)" in said
        assert f"hint: tega-teleop calibrate {file} --person p02 --only tactile" in said
        other = lab(tmp_path, thumb(sensor, "D99999"))
        assert teleop("run", str(other), "--person", "p01") == 1
        assert "no calibration on D99999 (p01 was calibrated on D20641)" in capsys.readouterr().err


def test_muscles_are_calibrated_and_a_run_refuses_what_does_not_fit(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with Emulator("ascii_board", "--signal", "emg") as board:
        file = lab(tmp_path, muscles(board))
        wizard = calibrate(file, Mover(board))
        assert wizard.code == 0, wizard.said
        (found,) = wizard.told["files"]
        record = found["record"]
        assert record["channels"] == ["ch1", "ch2", "ch3"]
        assert all(m > 3 * r > 0 for m, r in zip(record["live_max"], record["rest"], strict=True))
        assert all(p >= m for p, m in zip(record["paper_max"], record["live_max"], strict=True))
        assert record["answers"][1][1] == max(record["answers"][1])
        assert 500 < min(record["offset"]) < 525
        assert teleop("run", str(file), "--person", "p01", "--set", "session.duration_s=1", "--json") == 0
        assert json.loads(capsys.readouterr().out)["emg"]["maxima"] == record["live_max"]
        paper = ("--set", "session.preset=paper", "--set", "session.duration_s=1", "--json")
        assert teleop("run", str(file), "--person", "p01", *paper) == 0
        assert json.loads(capsys.readouterr().out)["emg"]["maxima"] == record["paper_max"]
        command = f"hint: tega-teleop calibrate {file} --person p01 --only emg"
        for change, said in (
            ("emg.options.channels=[1,2]", "with channels = ch1, ch2, ch3, the run has ch1, ch2"),
            ("emg.kind=rectified", "with kind = raw, the run has rectified"),
            ("emg.options.bits=12", "bits=10, columns=3, leading=0, the run has"),
        ):
            assert teleop("run", str(file), "--person", "p01", "--set", change) == 1
            err = capsys.readouterr().err
            assert said in err
            assert command in err
        made = utc_now() - timedelta(hours=30)
        folder = CalibrationFolder(tmp_path / "calibrations")
        path = Path(found["file"])
        old = folder.record("p01", EmgRecord, path.stem.removeprefix("emg-"))
        assert old is not None
        import msgspec

        write_record(msgspec.structs.replace(old, made=made), path)
        assert teleop("run", str(file), "--person", "p01", "--set", "session.duration_s=1", "--json") == 0
        (note,) = [n for n in json.loads(capsys.readouterr().out)["notes"] if "old" in n]
        assert note == (
            f"EMG: 30 hours old, warned of after 12 hours: tega-teleop calibrate {file} --person p01 --refresh"
        )


_ = (TouchRecord, VestRecord, Any)
