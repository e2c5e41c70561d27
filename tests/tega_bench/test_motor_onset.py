"""How long a motor takes to start: found in what an emulated motor sounds like, for what it really took."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from random import Random
from typing import Any

import msgspec
import numpy as np
import pytest

from reference.command import call
from reference.processes import until
from tega.config import check_tree
from tega.config.calibration.folder import CalibrationFolder
from tega.config.calibration.records import OnsetRecord, read_record
from tega.config.person import motor_onset
from tega.devices import driver_class
from tega.errors import CalibrationError, DeviceUnavailableError, InvalidValueError, RecordingError
from tega.loop.session import run_session
from tega.loop.worn_vest import NAMELESS
from tega.recording.inspection import inspect_file
from tega.runtime.clock import SystemClock
from tega_bench.vest_latency.detect import find_onsets
from tega_bench.vest_latency.log import ClockMap, OnsetLog, by_clicks, read_log, read_wav, write_log
from tega_bench.vest_latency.measure import play_bursts, record_of
from tega_bench.vest_latency.microphone import Microphone
from tega_emulators.lab import PRESSED, emulated_lab, pressing
from tega_emulators.motor_sound import RATE_HZ
from tega_emulators.process import Emulator
from tega_emulators.sound_port import SoundPort
from tega_emulators.vest_bench import seen_by, vest_bench

pytest.importorskip("scipy")

WITHIN_MS = 10.0
"""What docs/device-vest.md promises of motors like the emulated one."""
ON_S = 0.5


@pytest.fixture(scope="module")
def motor() -> Iterator[Emulator]:
    with Emulator("motor_sound") as made:
        yield made


def recorded(motor: Emulator, folder: Path, *, bursts: int = 8, percent: int = 60, **settings: float) -> Any:
    """Let the emulated motor be told some bursts, and return the sound and when they were."""
    motor.say("forget")
    for name, value in settings.items():
        motor.say(f"set {name} {value}")
    rests, t_s, commands_s = Random(1), 0.8, []
    for _ in range(bursts):
        commands_s.append(t_s)
        motor.say(f"drive {t_s} {percent}")
        motor.say(f"drive {t_s + ON_S} 0")
        t_s += ON_S + rests.uniform(0.9, 1.3)
    motor.say(f"wav {folder / 'sound.wav'} {t_s}")
    samples, rate_hz = read_wav(folder / "sound.wav")
    assert rate_hz == RATE_HZ
    return samples, commands_s


@pytest.mark.slow
@pytest.mark.parametrize(
    ("delay_ms", "how"),
    [
        (15.0, {}),
        (200.0, {}),
        (60.0, {"percent": 20}),
        (130.0, {"percent": 100}),
        (15.0, {"noise": 0.02}),
        (200.0, {"hum": 0.2}),
        (60.0, {"rise_ms": 15}),
        (130.0, {"rise_ms": 50, "full_hz": 240}),
        (60.0, {"loud": 0.02, "percent": 30}),
    ],
    ids=str,
)
def test_the_delay_is_found_whatever_noise_hum_and_intensity(
    motor: Emulator, tmp_path: Path, delay_ms: float, how: dict[str, Any]
) -> None:
    samples, commands_s = recorded(motor, tmp_path, delay_ms=delay_ms, **how)
    onsets = find_onsets(samples, RATE_HZ, commands_s, on_s=ON_S)
    assert onsets.problem == ""
    assert len(onsets.delays_s) == len(onsets.bursts) == 8
    assert float(np.median(onsets.delays_s)) * 1e3 == pytest.approx(delay_ms, abs=WITHIN_MS)
    assert np.median(onsets.halves_s) > np.median(onsets.delays_s)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("how", "text"),
    [
        ({"gain": 0}, "the recording is silent"),
        ({"noise": 0.15}, "no vibration detected|not four times as loud"),
        ({"loud": 0}, "no vibration detected|not four times as loud"),
        ({"loud": 3}, "the sound clips"),
    ],
)
def test_what_cannot_be_heard_gives_no_number(
    motor: Emulator, tmp_path: Path, how: dict[str, Any], text: str
) -> None:
    samples, commands_s = recorded(motor, tmp_path, **how)
    assert find_onsets(samples, RATE_HZ, commands_s, on_s=ON_S).delays_s.size == 0
    clock = ClockMap(began_s=0, rate_hz=RATE_HZ, uncertainty_ms=8.0, how="stamps")
    log = msgspec.structs.replace(LOG, bursts_s=tuple(commands_s), clock=clock)
    with pytest.raises(CalibrationError, match=f"no result: .*({text})") as error:
        record_of(samples, RATE_HZ, log)
    assert error.value.hint


@pytest.mark.slow
def test_knocks_cost_their_bursts_and_are_told(motor: Emulator, tmp_path: Path) -> None:
    commands_s = recorded(motor, tmp_path)[1]
    motor.say(f"knock {commands_s[2] - 0.1}")
    motor.say(f"knock {commands_s[5] + 0.35}")
    motor.say(f"wav {tmp_path / 'sound.wav'} {commands_s[-1] + 1.5}")
    onsets = find_onsets(read_wav(tmp_path / "sound.wav")[0], RATE_HZ, commands_s, on_s=ON_S)
    assert onsets.problem == ""
    assert sum(onsets.left_out().values()) == 2
    assert onsets.bursts[2].why
    assert onsets.bursts[5].why
    assert float(np.median(onsets.delays_s)) * 1e3 == pytest.approx(60, abs=WITHIN_MS)


def test_clicks_place_a_recording_that_began_at_any_time(motor: Emulator, tmp_path: Path) -> None:
    recorded(motor, tmp_path, bursts=3)
    clicks_s = [0.2, 0.55, 5.1, 5.45, 6.1]
    for t_s in clicks_s:
        motor.say(f"click {t_s}")
    motor.say(f"wav {tmp_path / 'sound.wav'} 6.5")
    samples, rate_hz = read_wav(tmp_path / "sound.wav")
    clock = by_clicks(samples, rate_hz, [t + 93.0 for t in clicks_s], source="speaker")
    assert clock.began_s == pytest.approx(93.0, abs=0.003)
    assert clock.uncertainty_ms < 15
    with pytest.raises(InvalidValueError, match=r"of the log's 4 clicks are in the recording"):
        by_clicks(samples, rate_hz, [1.0, 1.9, 3.1, 3.6], source="keys")
    with pytest.raises(InvalidValueError, match="2 clicks are in the log"):
        by_clicks(samples, rate_hz, [1.0, 1.9], source="keys")


LOG = OnsetLog(
    made=datetime(2026, 11, 21, 15, 4, 5, tzinfo=UTC),
    driver="bhaptics-player",
    device="127.0.0.1_15881",
    layout="x40",
    motor=21,
    percent=60,
    on_s=ON_S,
    bursts_s=(0.8,),
)


def test_a_phone_s_recording_with_its_log(
    motor: Emulator, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    samples, commands_s = recorded(motor, tmp_path, delay_ms=90.0)
    # Where no burst is played nothing is found.
    assert find_onsets(samples, RATE_HZ, [c - 0.45 for c in commands_s], on_s=ON_S).problem
    clicks_s = [0.15, 0.5, commands_s[-1] + 1.0, commands_s[-1] + 1.4]
    for t_s in clicks_s:
        motor.say(f"click {t_s}")
    motor.say(f"wav {tmp_path / 'phone.wav'} {clicks_s[-1] + 0.5}")
    times = {"bursts_s": tuple(c + 40 for c in commands_s), "clicks_s": tuple(c + 40 for c in clicks_s)}
    log = msgspec.structs.replace(LOG, **times, clicks="keys")
    write_log(log, tmp_path / "bursts.json")
    assert read_log(tmp_path / "bursts.json") == log
    words = ("vest", "onset", "--wav", tmp_path / "phone.wav", "--log", tmp_path / "bursts.json")
    text = json.loads(call(capsys, *words, "--set", f"calibration.folder={tmp_path / 'kept'}", "--json")[0])
    record = read_record(Path(text[0]["file"]), OnsetRecord)
    assert record.onset_ms == pytest.approx(90, abs=WITHIN_MS)
    assert (record.motor, record.used, record.bursts, record.clock) == (21, 8, 8, "clicks")
    assert Path(text[0]["file"]).parent == tmp_path / "kept" / "vests" / "127.0.0.1_15881"
    assert "from the frame's hand-over" in Path(text[0]["file"]).read_text(encoding="utf-8")

    out, _ = call(capsys, *words, "--set", f"calibration.folder={tmp_path / 'kept'}")
    assert "motor 21 (back, row 1 of 5" in out
    _, err = call(capsys, *words[:4], code=2)
    assert "needs the --log" in err


def test_what_is_no_recording_or_no_log_is_told(tmp_path: Path) -> None:
    (tmp_path / "x.wav").write_bytes(b"no sound at all")
    with pytest.raises(RecordingError, match=r"x\.wav: is no WAV file") as error:
        read_wav(tmp_path / "x.wav")
    assert "ffmpeg" in error.value.hint
    with pytest.raises(RecordingError, match=r"x\.wav: is no log of a motor"):
        read_log(tmp_path / "x.wav")
    with pytest.raises(CalibrationError, match="nothing says how log and recording lie in time"):
        record_of(np.zeros(RATE_HZ), RATE_HZ, LOG)


@pytest.mark.slow
@pytest.mark.parametrize("driver", ["bhaptics-player", "bhaptics-ble"])
def test_through_driver_and_microphone(
    driver: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with vest_bench(driver) as bench:
        peer = bench.peer
        peer.say("limit 60 0.5")
        peer.say("sound delay_ms 80")
        port = SoundPort(peer)
        # Nobody knows of these 40 ms, but for the clicks.
        port.speaker_ms, port.latency_s = 3.0, 0.04
        where = ["--set", f"vest.options.port={peer.address['port']}"] if "port" in peer.address else []
        with port.installed():
            text, _ = call(
                capsys, "vest", "onset", "--motor", 7, "--bursts", 6, "--set",
                f"vest.driver={driver}", *where, "--set", f"calibration.folder={tmp_path}", "--json",
                "--keep", tmp_path / "raw",
            )  # fmt: skip
        # A Player that has no time to answer is not waited for: what it was told last ends after 0.2 s.
        until(lambda: not any(seen_by(peer).motors))
        seen = seen_by(peer)
    (record,) = [one["record"] for one in json.loads(text)]
    # The vest's link takes a millisecond or two of its own.
    assert record["onset_ms"] == pytest.approx(80, abs=WITHIN_MS + 5)
    assert record["clock"] == "clicks"
    assert record["used"] >= 5
    assert seen.over == 0
    assert {max(values) for _, values in seen.history} <= {0, *range(55, 61)}
    assert {i for _, values in seen.history for i, v in enumerate(values) if v} == {7}
    # Nobody was named, and the day counts all the same.
    (worn,) = json.loads((tmp_path / NAMELESS).read_bytes())
    assert {i for i, dose_s in enumerate(worn["dose_s"]) if dose_s} == {7}
    (wav,) = (tmp_path / "raw").glob("*.wav")
    again = record_of(*read_wav(wav), read_log(wav.with_suffix(".json")))
    assert again.onset_ms == pytest.approx(record["onset_ms"], abs=1.0)


@pytest.mark.slow
def test_a_microphone_that_is_not_there_goes_away_or_loses_samples() -> None:
    with Emulator("bhaptics_player", "--port", "0") as peer:
        port = SoundPort(peer)
        with port.installed():
            port.present = False
            with pytest.raises(DeviceUnavailableError, match="no microphone"), Microphone():
                pass
            port.present = True
            with Microphone() as ear:
                port.present = False
                with pytest.raises(DeviceUnavailableError, match="went away while it recorded"):
                    ear.received()
            port.present, port.overflows = True, True
            with Microphone() as ear:
                until(lambda: ear._lost > 0)
                with pytest.raises(DeviceUnavailableError, match="lost samples"):
                    ear.received()


@pytest.mark.slow
def test_a_vest_that_goes_away_gives_no_number_and_one_that_limits_does_not_count() -> None:
    with vest_bench("bhaptics-player", limit=30) as bench, bench.vest as opened:
        vest: Any = opened
        left_s, unsent = play_bursts(vest, 0, layout="x40", percent=60, bursts=1, clock=SystemClock())
        assert (left_s, unsent) == ([], 1)
        timer = threading.Timer(0.9, bench.peer.say, ["close"])
        timer.start()
        with pytest.raises(DeviceUnavailableError, match="did not show motor 0 all the time"):
            play_bursts(vest, 0, layout="x40", percent=20, bursts=3, clock=SystemClock())
        timer.join()


def test_a_vest_that_does_not_tell_when_a_frame_leaves_is_refused(tmp_path: Path) -> None:
    recorder: Any = driver_class("vest-recorder", "vest")
    made = recorder(recorder.options_type(file=tmp_path / "v.csv"))
    with made as vest, pytest.raises(DeviceUnavailableError, match="does not report when a frame leaves"):
        play_bursts(vest, 0, layout="x40", percent=60, bursts=1, clock=SystemClock())


@pytest.mark.slow
def test_a_run_adds_what_was_measured_and_says_when(tmp_path: Path) -> None:
    pytest.importorskip("mcap")
    with emulated_lab(tmp_path, emg_hz=250.0, vest=True, fingers=("thumb",), touch=PRESSED) as lab:
        assert lab.vest is not None
        lab.tree["session"] = {"duration_s": 2.5}
        lab.tree["recording"] = {"dir": "rec"}
        config = check_tree(lab.tree, {}, base=tmp_path).config
        with pressing(lab):
            without: dict[str, Any] = run_session(config)
        assert without["motor_onset"] is None
        assert "skin" not in without["latency_ms"]["touch"]
        device = f"127.0.0.1_{lab.vest.address['port']}"
        home, earlier = CalibrationFolder(tmp_path / "calibrations"), LOG.made.replace(hour=3)
        for number, made, ms in ((0, earlier, 1.0), (0, LOG.made, 80.0), (7, LOG.made, 90.0)):
            home.keep_onset(  # the newer one of a motor counts
                OnsetRecord(
                    device=device, driver="bhaptics-player", made=made, layout="x40", motor=number, percent=60,
                    onset_ms=ms, middle_half_ms=(ms, ms), worst_ms=ms, half_strength_ms=ms, bursts=15,
                    used=15, spin_hz=150.0, clock="clicks", clock_uncertainty_ms=8.0,
                )
            )  # fmt: skip
        known = motor_onset(config)
        assert known is not None
        assert known.ms == 85.0
        with pressing(lab):
            summary: dict[str, Any] = run_session(config)
    touch = summary["latency_ms"]["touch"]
    for figure in touch["whole"].keys() - {"n"}:
        assert touch["skin"][figure] == pytest.approx(touch["whole"][figure] + 85.0, abs=0.002)
    assert "measured 2026-11-21: 85 ms ± 8 (motors 0, 7 of" in summary["motor_onset"]["said"]
    first, second = sorted((tmp_path / "rec").glob("*.mcap"))
    assert not any("motor onset" in stage.stage for stage in inspect_file(first).latency)
    stages = {stage.stage: stage for stage in inspect_file(second).latency}
    assert stages["motor onset, measured 2026-11-21"].worst_ms == 85.0
    whole, skin = stages["camera to vest: whole"], stages["camera to skin, with that"]
    assert skin.worst_ms == pytest.approx(whole.worst_ms + 85.0)
    assert (skin.p99_ms is None) == (skin.n < 100)
