"""``tega-teleop calibrate`` against emulators in other processes: what it keeps, refuses, warns of, leaves silent."""

from __future__ import annotations

import json
import re
import shutil
import signal
import threading
import tomllib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta
from pathlib import Path
from typing import NamedTuple

import msgspec
import pytest

from reference.chromium import launched, opened
from reference.command import call
from reference.processes import until
from reference.wizard import RESTING, Mover, OnScreen, Wizard, calibrate, lab, presses, records, teleop
from tega.config.calibration.folder import CalibrationFolder
from tega.config.calibration.records import EmgRecord, utc_now, write_record
from tega_emulators.participant import Wearer
from tega_emulators.process import Emulator
from tega_emulators.vest_bench import seen_by

pytestmark = pytest.mark.slow

P01, SECOND = ("--person", "p01"), ("--set", "session.duration_s=1")


def thumb(sensor: Emulator, serial: str = "D20641") -> str:
    return (
        '[tactile.thumb]\ndriver = "digit"\n'
        f'options = {{ source = "{sensor.address["source"]}/{serial}", warm_up_s = 0.1 }}\n'
    )


def muscles(board: Emulator) -> str:
    return (
        '[emg]\ndriver = "serial-emg"\nkind = "raw"\n'
        f'options = {{ port = "{board.port}", rate_hz = 500.0, bits = 10, measure_s = 0.25 }}\n'
    )


class Presser:
    def __init__(self, sensor: Emulator, firmness: list[float] | None = None) -> None:
        self._sensor = sensor
        self._firmness = [0.8, 0.9, 1.0] if firmness is None else firmness

    def __call__(self, prompt: str) -> str | None:
        if "press firmly" in prompt:
            presses(self._sensor.say, self._firmness)
        return "q" if prompt.startswith("?") else ""


def test_a_finger_is_calibrated_and_a_run_uses_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with Emulator("digit") as sensor:
        file = lab(tmp_path, thumb(sensor))
        _, err = call(capsys, "run", file, *SECOND, code=1)
        assert f"hint: tega-teleop calibrate {file} --person ID" in err
        wizard = calibrate(file, Presser(sensor))
        kept = list(records(tmp_path / "calibrations"))
        assert [name.split("/")[0] for name in kept] == ["gels", "gels", "people"]
        assert kept[-1] == "people/p01/touch-D20641.toml"
        tree = tomllib.loads((tmp_path / "calibrations" / kept[-1]).read_text())
        assert (tree["person"], tree["finger"], tree["n_presses"]) == ("p01", "thumb", 6)
        assert tree["live"]["eda_max"] > 4000
        assert tree["live"]["cci_max"] > 10 * tree["paper"]["cci_max"] > 0
        assert wizard.reported["files"][0]["record"]["device"] == "D20641"
        sensor.say("press 1")
        summary = json.loads(call(capsys, "run", file, *P01, *SECOND, "--json")[0])
        assert summary["tactile"]["thumb"]["eda_max"] == tree["live"]["eda_max"]
        assert summary["calibration"]["file"] == "calibration of p01"
        assert not summary["calibration"]["self_calibrated"]
        assert not [note for note in summary["notes"] if "old" in note]
        # Another person, another sensor, an old record.
        _, err = call(capsys, "run", file, "--person", "p02", code=1)
        assert "p02 has no calibration on D20641 (there is one of p01)" in err
        assert f"hint: tega-teleop calibrate {file} --person p02 --only tactile" in err
        _, err = call(capsys, "run", lab(tmp_path, thumb(sensor, "D99999")), *P01, code=1)
        assert "no calibration on D99999 (p01 was calibrated on D20641)" in err


class Muscles(NamedTuple):
    board: Emulator
    folder: Path
    wizard: Wizard

    def copied(self, folder: Path) -> Path:
        shutil.copytree(self.folder, folder, dirs_exist_ok=True)
        self.board.say(f"effort {RESTING}")
        return folder / "lab.toml"


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Muscles]:
    folder = tmp_path_factory.mktemp("muscles")
    with Emulator("ascii_board", "--signal", "emg") as board:
        yield Muscles(board, folder, calibrate(lab(folder, muscles(board)), Mover(board)))


def test_muscles_are_calibrated_and_a_run_refuses_what_does_not_fit(
    calibrated: Muscles, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wizard = calibrated.wizard
    file = calibrated.copied(tmp_path)
    (found,) = wizard.reported["files"]
    record = found["record"]
    assert record["channels"] == ["ch1", "ch2", "ch3"]
    assert all(m > 3 * r > 0 for m, r in zip(record["live_max"], record["rest"], strict=True))
    assert all(p >= m for p, m in zip(record["paper_max"], record["live_max"], strict=True))
    assert record["answers"][1][1] == max(record["answers"][1])
    assert 500 < min(record["offset"]) < 525
    for preset in ("live", "paper"):
        words = ("run", file, *P01, *SECOND, "--set", f"session.preset={preset}", "--json")
        assert json.loads(call(capsys, *words)[0])["emg"]["maxima"] == record[f"{preset}_max"]
    command = f"hint: tega-teleop calibrate {file} --person p01 --only emg"
    for change, text in (
        ("emg.options.channels=[1,2]", "with channels = ch1, ch2, ch3, the settings have ch1, ch2"),
        ("emg.kind=rectified", "with kind = raw, the settings have rectified"),
        ("emg.options.bits=12", "settings = bits=10, columns=3, leading=0, the settings have"),
    ):
        _, err = call(capsys, "run", file, *P01, "--set", change, code=1)
        assert text in err
        assert command in err
    made = utc_now() - timedelta(hours=30)
    folder = CalibrationFolder(tmp_path / "calibrations")
    path = tmp_path / "calibrations/people/p01" / Path(found["file"]).name
    old = folder.record("p01", EmgRecord, path.stem.removeprefix("emg-"))
    assert old is not None
    write_record(msgspec.structs.replace(old, made=made), path)
    out, _ = call(capsys, "run", file, *P01, *SECOND, "--json")
    (note,) = [n for n in json.loads(out)["notes"] if "old" in n]
    assert note == (
        f"EMG: 30 hours old, warned of after 12 hours: tega-teleop calibrate {file} --person p01 --refresh"
    )


def test_too_few_presses_are_told_and_gone_on_with(tmp_path: Path) -> None:
    with Emulator("digit") as sensor:
        file = lab(tmp_path, thumb(sensor))
        wizard = calibrate(file, Presser(sensor, [0.9]), "--time-scale", "0.05", code=130)
        assert "only 1 of 3 firm presses were seen" in wizard.said
        assert "Left: tactile.thumb" in wizard.said
        # The baseline is kept, and not asked for again.
        again = calibrate(file, Presser(sensor))
        assert "done: tactile.thumb.baseline" in again.said
        assert not [line for line in again.lines if "take everything off" in line]


def test_a_touched_baseline_is_asked_for_again_and_gels_are_compared(tmp_path: Path) -> None:
    with Emulator("digit") as sensor:
        file = lab(tmp_path, thumb(sensor))
        sensor.say("press 0.9")
        refused = calibrate(file, Presser(sensor), "--yes", code=1)
        assert "does something touch the gel?" in refused.said
        assert not (tmp_path / "calibrations" / "gels").exists()
        requested: list[str] = []

        def lets_go(prompt: str) -> str | None:
            if "what now" in prompt:
                requested.append(prompt)
                sensor.say("press 0")
                return "a"
            return presser(prompt)

        presser = Presser(sensor)
        calibrate(file, lets_go)
        assert len(requested) == 1
        sensor.say("wear dimmer")
        sensor.say("wear dark-spot")
        keeps = calibrate(file, lambda prompt: "k" if "what now" in prompt else presser(prompt), "--refresh")
        assert "counts darker than on 2" in keeps.said
        assert "a dark spot of " in keeps.said
        record = keeps.reported["files"][0]["record"]
        assert record["dark_px"] > 40
        assert max(record["shift_counts"]) < -5


def test_exchanged_electrodes_and_half_hearted_squeezes_are_told(tmp_path: Path) -> None:
    with Emulator("ascii_board", "--signal", "emg") as board:
        file = lab(tmp_path, muscles(board))
        wizard = calibrate(file, Mover(board, wired=(2, 1, 3)), code=130)
        assert "ch1 and ch2 look swapped: each rises with the muscle of the other" in wizard.said
        assert wizard.reported["done"] == ["emg.rest", "emg.squeezes"]
        wizard = calibrate(file, Mover(board, full=2 * RESTING), "--restart", code=130)
        assert "a strong squeeze is only" in wizard.said


def test_a_refresh_follows_the_day_and_practice_is_scored(calibrated: Muscles, tmp_path: Path) -> None:
    board, first = calibrated.board, calibrated.wizard
    (tmp_path / "new").mkdir()
    nothing = calibrate(lab(tmp_path / "new", muscles(board)), Mover(board), "--refresh", code=1)
    assert "p01 has no calibration on" in nothing.said
    file = calibrated.copied(tmp_path)
    today = Mover(board, full=1.5)
    wizard = calibrate(file, today, "--refresh")
    before, after = (w.reported["files"][0]["record"] for w in (first, wizard))
    assert 1.15 < after["scale"] < 1.95
    assert after["made"] == before["made"]
    assert "refreshed" in after
    assert after["live_max"][0] > 1.05 * before["live_max"][0]
    assert len(list((tmp_path / "calibrations/people/p01/before").iterdir())) == 1
    today.full = 0.2
    changed = calibrate(file, today, "--refresh", code=1)
    assert "times its signal at the calibration" in changed.said
    board.say(f"effort {RESTING}")
    tracked = Wizard(["practice", str(file), *P01, "--seconds", "10", "--json"], lambda _prompt: "").run()
    # Hand at rest all the time: right only while the curve asks for level 1.
    assert 20 < tracked.reported["in_target_percent"] < 70
    assert tracked.reported["rms_error_levels"] > 0.5
    assert tracked.reported["delay_s"] is None
    assert tracked.reported["decoder"] == "rules"
    assert Path(tracked.reported["file"]).is_file()


def test_a_fitts_test_of_a_hand_at_rest_hits_nothing_and_is_kept(calibrated: Muscles, tmp_path: Path) -> None:
    file = calibrated.copied(tmp_path)
    calibrated.board.say(f"effort {RESTING}")
    reported = []
    for decoder in ("rules", "proportional"):
        chosen = f"stages.decoder.name={decoder}"
        words = ["--movements=1", "--dwell-s=0.3", "--timeout-s=0.5", "--set", chosen]
        tested = Wizard(["emg", "fitts", str(file), *P01, "--json", *words], lambda _prompt: "").run()
        reported.append(tested.reported)
    # Six distances and widths, once each; whatever the rest twitches, nobody squeezed to level 3.
    assert [(one["decoder"], one["movements"]) for one in reported] == [("rules", 6), ("proportional", 6)]
    assert all(one["completion"] < 0.5 and one["throughput_bits_s"] == 0 for one in reported)
    kept = sorted((tmp_path / "calibrations/people/p01/fitts").iterdir())
    assert [str(path) for path in kept] == [one["file"] for one in reported]


def test_a_fitts_test_is_done_on_a_page(calibrated: Muscles, tmp_path: Path) -> None:
    file = calibrated.copied(tmp_path)
    words = ["--movements=1", "--dwell-s=0.3", "--timeout-s=2", "--view", "--view-port=0", "--json"]
    # The browser first, since the test is skipped where there is none.
    with launched() as browser, ThreadPoolExecutor(1) as pool:
        tested = Wizard(["emg", "fitts", str(file), *P01, *words], lambda _prompt: "")
        running = pool.submit(tested.run)
        until(lambda: any(line.startswith("http") for line in tested.lines) or running.done())
        address = next(line for line in tested.lines if line.startswith("http"))
        with opened(browser, address.strip()) as page:
            page.get_by_role("button", name="Ready").click()
            page.get_by_text(re.compile(r"± 0\.\d\d level")).wait_for()
            page.get_by_text("bits/s").wait_for()
        running.result(30)
    assert tested.reported["movements"] == 6


def vest(peer: Emulator, *more: str) -> str:
    options = f"options = {{ port = {peer.address['port']}, limit = 40 }}"
    return "\n".join(['[vest]\ndriver = "bhaptics-player"', options, *more])


THRESHOLD = {"f1": 9, "f2": 9, "f3": 15, "f4": 9, "b1": 9, "b2": 9, "b3": 200, "b4": 9}


def test_a_vest_keeps_its_ceiling_and_ends_at_0(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with Emulator("bhaptics_player", "--port", "0") as peer:
        file = lab(tmp_path, vest(peer))
        wearer = Wearer(lambda: seen_by(peer).history, THRESHOLD)
        how = "--person", "p01", "--json", "--time-scale", "0.2", "--ceiling", "90"
        words = ["calibrate", str(file), *how]

        def interrupted(line: str) -> None:
            if "ok front, column 3" in line:
                first.interrupt()

        first = Wizard(words, wearer, interrupted)
        first.run(130)
        until(lambda: not any(seen_by(peer).motors))
        assert f"Go on with: tega-teleop calibrate {file} --person p01 (with --restart" in first.said
        assert first.reported["finished"] is False
        assert first.reported["done"] == ["vest.places", "vest.threshold"]
        assert "vest: 8 of 8 places named right" in first.said
        wearer.requested.clear()
        second = Wizard(words, wearer).run()
        assert "done: vest.places, vest.threshold" in second.said
        assert "f1" not in wearer.requested[: wearer.requested.index("b4")]
        until(lambda: not any(seen_by(peer).motors))
        # 40 percent is the driver's limit; level 6 is the highest below it.
        assert wearer.loudest == 37
        assert not seen_by(peer).errors
        # At the end all columns at once, in steps.
        displayed = [max(motors) for _, motors in seen_by(peer).history if all(motors)]
        assert displayed == sorted(set(displayed))
        assert (len(displayed), displayed[-1]) == (5, 37)
        record = second.reported["files"][0]["record"]
        # Both parts count to the person's day.
        worn = json.loads((tmp_path / "calibrations/people/p01/vest-dose.json").read_bytes())
        assert [sum(run["dose_s"]) > 0 for run in worn] == [True, True]
        by_site = dict(zip(record["sites"], record["threshold_percent"], strict=True))
        assert by_site == {s: {9: 10.0, 15: 17.0, 200: -1.0}[t] for s, t in THRESHOLD.items()}
        assert record["step_percent"][0] == pytest.approx(200 / 15, abs=0.01)
        assert record["step_percent"][6] == -1
        assert record["step_sites"] == ["f4", "b2"]
        assert teleop("config", "show", str(file), "--set", "calibration.person=p01") == 0
        (line,) = [x for x in capsys.readouterr().out.splitlines() if x.startswith("vest.threshold")]
        assert "10, 10, 17, 10" in line
        assert line.endswith(f"people/p01/vest-127.0.0.1_{peer.address['port']}.toml")
        explicit = lab(tmp_path, vest(peer, "threshold = 5"))
        assert teleop("config", "show", str(explicit), "--set", "calibration.person=p01") == 0
        (line,) = [x for x in capsys.readouterr().out.splitlines() if x.startswith("vest.threshold")]
        assert " 5 " in line
        assert re.search(r"lab\.toml.* \(wins over people/p01/vest-", line)


def test_single_keys_on_a_terminal_answer_every_question_once(tmp_path: Path) -> None:
    with Emulator("bhaptics_player", "--port", "0") as peer:
        file = lab(tmp_path, vest(peer))
        wearer = Wearer(lambda: seen_by(peer).history, dict.fromkeys(THRESHOLD, 9))
        words = ["calibrate", str(file), "--person", "p01", "--time-scale", "0.1", "--ceiling", "24"]
        person = OnScreen(words, wearer)
        assert person.run(limit_s=10.0) == 0, person.screen[-3000:]
        (kept,) = (tmp_path / "calibrations/people/p01").glob("vest-*.toml")
        record = tomllib.loads(kept.read_text())
        # On a busy machine so short a vibration may be missed, which makes a threshold higher, never lower.
        assert min(record["threshold_percent"]) >= 10
        assert record["named_right"] == record["named"] == 8
        until(lambda: not any(seen_by(peer).motors))
        # One key for each vibration that was asked about, none for nothing.
        n_bursts = len(wearer.requested)
        assert n_bursts > 40
        assert person.n_keys >= n_bursts


def test_a_mirrored_back_is_told_and_the_vest_rests_after_sigterm(tmp_path: Path) -> None:
    with Emulator("bhaptics_player", "--port", "0") as peer:
        file = lab(tmp_path, vest(peer))
        wizard = calibrate(file, Wearer(lambda: seen_by(peer).history, THRESHOLD, mirrored=True), code=130)
        assert 'back felt mirrored: set vest.mirror = "back"' in wizard.said

        def while_it_vibrates() -> None:
            until(lambda: any(seen_by(peer).motors))
            again.terminate()

        def begins(prompt: str) -> str:
            assert "Something will vibrate" in prompt
            threading.Thread(target=while_it_vibrates).start()
            return ""

        again = Wizard(["calibrate", str(file), "--person", "p02", "--time-scale", "4"], begins)
        again.run(128 + signal.SIGTERM)
        until(lambda: not any(seen_by(peer).motors))
        wizard = calibrate(file, Wearer(lambda: seen_by(peer).history, THRESHOLD), "--yes", code=1)
        assert "its questions need a person to answer them" in wizard.said
