"""Parts of the calibration with examples: muscles, real gels, records that must not be used."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import timedelta
from pathlib import Path

import msgspec
import numpy as np
import pytest

from reference.kept import NOW, muscles, touch, worn
from reference.scripted import touching
from tega.arm import StampedPose
from tega.arm.frames import ToBase
from tega.config import LoadedConfig, SessionConfig, SettingValue, load_config
from tega.config.calibration.folder import CalibrationFolder, device_name
from tega.config.calibration.records import EmgRecord, TouchRecord, VestCalibration, read_record
from tega.config.calibration.store import EmgMaxima
from tega.devices.base import DeviceInfo, EmgChunk
from tega.errors import CalibrationError, ConfigError, DeviceUnavailableError, TegaError
from tega.runtime.opencv import read_image
from tega.setup.calibration.effort import judge_muscles, judge_quiet, judge_squeezes
from tega.setup.calibration.gel import judge_rest, suspect_contact
from tega.setup.calibration.presses import PressMeter
from tega.setup.calibration.sitting import Sitting, Times, Unfinished, unfinished
from tega.setup.calibration.wizard import Calibrating, parts_of
from tega.ui.cli.guide import LineGuide
from tega.ui.cli.main import main

ARM = [
    "arm.driver=simulated-arm",
    "input.motion.driver=spacemouse",
    "input.dead_man.driver=spacemouse",
    "input.dead_man.options.silent_after_ms=1000",
]
CHAIN = EmgMaxima(kind="raw", rate_hz=500.0, tau=50, channels=("ch1", "ch2", "ch3"), maxima=())


def read(sets: Sequence[str] = ()) -> LoadedConfig:
    return load_config(None, environ={}, sets=sets)


def calibrating(folder: CalibrationFolder, config: SessionConfig) -> Calibrating:
    """Return the wizard, with nobody there to answer."""
    guide = LineGuide(yes=True, get_ready_s=0.0)
    return Calibrating(Sitting(config, "p01", folder, guide, Times(), lambda: NOW))


def emg(*efforts: float, seconds: float = 4.0, seed: int = 0) -> list[EmgChunk]:
    random = np.random.default_rng(seed)
    n = round(500 * seconds)
    return [EmgChunk(0, 0, 512 + random.normal(0, 60, (n, 3)) * np.array(efforts))]


def test_muscles_in_order_have_no_problem() -> None:
    quiet = judge_quiet(emg(0.04, 0.04, 0.04, seconds=5), CHAIN)
    assert not quiet.notes
    np.testing.assert_allclose(quiet.offset, 512, atol=0.5)
    found = judge_squeezes([emg(1, 1, 1, seed=k) for k in range(3)], quiet.rest, CHAIN)
    assert not found.notes
    live = np.array(found.live)
    assert (np.array(found.paper) >= live).all()
    # A tenth of a second of rectified noise of 60 has a mean of about 48.
    assert (live > 48).all()
    assert (live < 80).all()
    drives, problems = judge_muscles(
        [emg(0.5, 0.1, 0.1), emg(0.1, 0.5, 0.1), emg(0.1, 0.1, 0.5)], np.array(quiet.rest), live, CHAIN
    )
    assert not problems
    assert (drives.argmax(axis=1) == [0, 1, 2]).all()


def test_what_is_wrong_with_muscles_is_said_by_channel() -> None:
    restless = emg(0.04, 0.04, 0.04, seconds=5)
    restless[0].samples[1000:1250, 1] += np.random.default_rng(1).normal(0, 60, 250)
    assert judge_quiet(restless, CHAIN).notes == (
        "ch2: not at rest all the time: let the arm lie, hand open",
    )
    rest = judge_quiet(emg(0.04, 0.5, 0.04), CHAIN).rest
    squeezes = [emg(1, 1, 1, seed=1), emg(0.3, 0.3, 0.3, seed=2), emg(1, 1, 1, seed=3)]
    message = judge_squeezes(squeezes, rest, CHAIN).notes
    assert any(s.startswith("ch2: a strong squeeze is only ") for s in message)
    assert any(s.startswith("squeeze 2 reached 3") for s in message)
    bridged = emg(1, 1, 1)
    bridged[0].samples[:, 1] = bridged[0].samples[:, 0]
    message = judge_squeezes([bridged] * 3, (1.0, 1.0, 1.0), CHAIN).notes
    assert "ch1 and ch2: the same signal: electrodes bridged by gel or sweat" in message
    _, message = judge_muscles([emg(0.05, 0.05, 0.05)] * 3, np.full(3, 2.0), np.full(3, 60.0), CHAIN)
    assert sum("no channel answered" in s for s in message) == 3
    with pytest.raises(CalibrationError, match="no EMG sample came"):
        judge_quiet([], CHAIN)


@pytest.mark.slow
def test_real_gels_at_rest_and_pressed(recordings: Path) -> None:
    folder = recordings / "digit" / "digit_ball_D20641"
    background = read_image(folder / "background.png", driver="test")
    assert suspect_contact(background, None) == ""
    presses = [read_image(path, driver="test") for path in sorted(folder.rglob("frame_*.png"))]
    assert len(presses) > 25
    # The first baseline of a sensor is compared with a surface fitted to itself, every later one with the last.
    assert all("does something touch the gel?" in suspect_contact(p, None) for p in presses)
    against = [suspect_contact(p, background) for p in presses]
    assert sum("that the last baseline does not have" in message for message in against) >= len(presses) - 1


def test_pictures_that_make_no_baseline() -> None:
    with pytest.raises(CalibrationError, match="0 pictures of no size make no baseline"):
        judge_rest([])
    flat = np.full((60, 80, 3), 90, np.uint8)
    with pytest.raises(CalibrationError, match=r"80×60 and 90×60"):
        judge_rest([flat, np.full((60, 90, 3), 90, np.uint8)])
    assert "only 3 good pictures came, 20 are needed" in judge_rest([flat] * 3).problems


def test_records_that_must_not_be_used(tmp_path: Path) -> None:
    folder = CalibrationFolder(tmp_path)
    path = folder.keep(touch(device="D1"))
    assert folder.record("p01", TouchRecord, "D1") == touch(device="D1")
    # A copied file is another person's.
    theirs = folder.file("p02", "touch", "D1")
    theirs.parent.mkdir()
    theirs.write_bytes(path.read_bytes())
    with pytest.raises(CalibrationError, match="was made for p01 on D1, not for p02 on D1"):
        folder.record("p02", TouchRecord, "D1")
    good = path.read_text()
    for change, message in (
        (("version = 1", "version = 2"), "version 2 of the format is not known here"),
        (("eda_max = 9000.0", "eda_max = -1.0"), "live.eda_max = -1: expected"),
        (('person = "p01"', 'person = "p01"\nowner = "x"'), "owner: unknown key"),
        (("n_presses", "n presses"), "not valid TOML"),
    ):
        path.write_text(good.replace(*change))
        with pytest.raises(CalibrationError, match=message):
            folder.record("p01", TouchRecord, "D1")
    kept = folder.keep(muscles())
    kept.write_text(kept.read_text().replace("lowpass_hz = 50.0", "lowpass_hz = 20.0"))
    with pytest.raises(CalibrationError, match="lowpass_hz = 20 Hz, where a run's filter has 50 Hz"):
        read_record(kept, EmgRecord)
    path.write_text(good)
    with pytest.raises(CalibrationError):
        read_record(path, VestCalibration)
    assert folder.record("p01", TouchRecord, "D2") is None
    assert folder.others("p03", "touch", "D1") == "there is one of p01, p02"


def test_a_device_s_name_cannot_leave_the_folder() -> None:
    info = DeviceInfo(driver="d", kind="vest", label="../../etc: x", live=True)
    assert "/" not in device_name(info)
    assert not device_name(info).startswith(".")


def interrupted(folder: CalibrationFolder, steps: Mapping[str, object], **devices: str) -> Path:
    """Write the journal of an interrupted calibration."""
    begun = Unfinished(started=NOW, steps=dict(steps), devices=devices)
    path = folder.person("p01") / "unfinished.json"
    path.parent.mkdir(parents=True)
    path.write_bytes(msgspec.json.encode(begun))
    return path


def test_an_interrupted_calibration_is_too_old_after_four_hours(tmp_path: Path) -> None:
    path = interrupted(CalibrationFolder(tmp_path), {"emg.rest": {"rest": [1.0]}})
    found = unfinished(path, NOW + timedelta(hours=3))
    assert found is not None
    assert found.steps == {"emg.rest": {"rest": [1.0]}}
    assert unfinished(path, NOW + timedelta(hours=5)) is None
    path.write_text("{")
    assert unfinished(path, NOW) is None


def test_a_person_s_thresholds_are_no_part_of_the_paper_preset(tmp_path: Path) -> None:
    sets = ["vest.driver=bhaptics-player", "calibration.person=p01", f"calibration.folder={tmp_path}"]
    CalibrationFolder(tmp_path).keep(
        worn(sites=("f1", "b4"), threshold_percent=(20.0, -1.0), step_percent=(7.0, -1.0))
    )
    live = read(sets)
    assert live.config.vest.threshold == (20.0,) * 40
    assert live.values["vest.step"].origin == "people/p01/vest-127.0.0.1_15881.toml"
    paper = read([*sets, "session.preset=paper"])
    assert paper.config.vest.threshold == 0.0
    nobody = read([*sets, "calibration.person=p02"])
    assert nobody.config.vest.threshold == 0.0


def test_what_was_found_on_another_device_is_not_gone_on_with(tmp_path: Path) -> None:
    folder = CalibrationFolder(tmp_path)
    steps = {"tactile.thumb": "people/p01/touch-D1.toml", "tactile.thumb.baseline": {}, "emg.rest": {}}
    interrupted(folder, steps, **{"tactile.thumb": "D1", "emg": "ttyUSB0"})
    sets = ["tactile.thumb.driver=digit", "tactile.thumb.options.source=http://127.0.0.1:9/D2"]
    config = read(sets).config
    work = calibrating(folder, config)
    with pytest.raises(DeviceUnavailableError, match="does not open"):
        work.run(parts_of(config))
    assert work.left == ["tactile.thumb"]
    assert work.done == ("emg.rest",)
    with pytest.raises(ConfigError, match=r"--only vest: .* no \[vest\] device; they have no device"):
        parts_of(SessionConfig(), ["vest"])


@pytest.mark.parametrize("kept", ["forged", [], {"made": "low"}, {"file": 1}, None])
def test_a_damaged_step_of_an_interrupted_calibration_is_told(tmp_path: Path, kept: object) -> None:
    folder, step = CalibrationFolder(tmp_path), "tactile.thumb.baseline"
    interrupted(folder, {step: kept})
    config = read([]).config
    work = calibrating(folder, config)
    work.run([])
    with pytest.raises(CalibrationError, match=rf"step {step} is damaged") as reported:
        work._baseline(step)
    assert "--restart" in reported.value.hint


def test_a_weak_press_and_an_accident_do_not_count() -> None:
    meter, t_ns = PressMeter(76_800), 0
    judged = []
    for eda, seconds in ((9000, 0.6), (800, 0.6), (8000, 0.1), (9500, 0.6), (3000, 0.6)):
        for found, n in ((eda, round(60 * seconds)), (0, 20)):
            for _ in range(n):
                live = touching(found, t_ns=t_ns)
                if (press := meter.take({"live": live, "paper": live})) is not None:
                    judged.append(meter.judge(press))
                t_ns += 16_666_667
    assert judged == [
        "",
        "too weak: it dented 1.0% of the picture, 1.5% are needed; press harder",
        "",
        "much weaker than the others; it does not count",
    ]
    assert meter.problems() == ("2 of 3 firm presses; 2 were too weak",)


def test_a_person_s_hand_is_set_once_and_forearm_and_columns_follow_it(tmp_path: Path) -> None:
    folder = CalibrationFolder(tmp_path)
    sets = [*ARM, "vest.driver=bhaptics-player", f"calibration.folder={tmp_path}"]

    def follows(person: str, *more: str) -> tuple[str, str]:
        config = read([*sets, f"calibration.person={person}", *more]).config
        assert config.arm is not None
        return config.vest.mirror, config.arm.mapping.forearm

    assert follows("p01") == ("none", "right")
    assert folder.hand("p01") is None
    folder.keep_hand("p01", "left")
    folder.keep_hand("p02", "right")
    assert follows("p01") == ("all", "left")
    assert follows("p02") == ("none", "right")
    assert follows("p01", 'vest.mirror="back"') == ("back", "left"), "what is given wins"
    loaded = read([*sets, "calibration.person=p01", "stages.decoder.name=learned"])
    assert loaded.config.stages.decoder.options.person == "p01", "another person's model is refused"
    assert loaded.values["vest.mirror"].origin == "people/p01/person.toml"
    assert loaded.values["arm.mapping.forearm"].origin == "people/p01/person.toml"
    folder.keep_hand("p01", "left")
    with pytest.raises(CalibrationError, match="hand is kept as the left one"):
        folder.keep_hand("p01", "right")
    for damaged in ("hand = 'both'", "[", "hand = 'left'\nversion = 2"):
        (tmp_path / "people/p01/person.toml").write_text(damaged)
        with pytest.raises(CalibrationError, match="set the hand again"):
            folder.hand("p01")


@pytest.mark.parametrize("person", [None, "p01"])
def test_the_arm_is_mirrored_for_the_hand_that_is_mounted(tmp_path: Path, person: str | None) -> None:
    CalibrationFolder(tmp_path).keep_hand("p01", "left")
    sets = [*ARM, f"calibration.folder={tmp_path}"]
    sets += ["hand.driver=allegro", "hand.options.interface=slcan", "hand.options.channel=/dev/ttyX"]
    sets += [] if person is None else [f"calibration.person={person}"]

    def mirrored(*more: str) -> bool:
        config = read([*sets, *more]).config
        assert config.arm is not None
        pose = StampedPose(0, (0.0, 0.1, 0.0), (0.0, 0.0, 0.0, 1.0))
        reported = msgspec.structs.replace(config.arm.mapping, frame="base")
        return bool(ToBase(reported)(pose).position_m[1] < 0)

    left_person = person is not None
    assert mirrored() == left_person, "a right hand, and a left forearm where the person's is known"
    assert mirrored("hand.options.side=left") != left_person
    loaded = read([*sets, "hand.options.side=left"])
    assert loaded.values["arm.mapping.robot_hand"] == SettingValue("left", "hand.options.side")
    with pytest.raises(ConfigError, match=r"robot_hand is 'right', but hand\.options\.side is 'left'"):
        mirrored("hand.options.side=left", "arm.mapping.robot_hand=right")


def test_the_wizard_shows_the_drawing_of_the_person_s_hand(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config = read(["vest.driver=bhaptics-player", "vest.options.port=9"]).config
    for hand, drawn in (("left", "-left.svg"), ("right", "placement-vest.svg"), (None, "")):
        folder = CalibrationFolder(tmp_path / str(hand))
        if hand is not None:
            folder.keep_hand("p01", hand)  # type: ignore[arg-type]
        with pytest.raises(TegaError):  # there is no vest
            calibrating(folder, config).run(["vest"])
        message = capsys.readouterr().err
        assert drawn in message
        assert ("placement" in message) == (hand is not None)


def test_the_wizard_keeps_the_hand_before_anything_is_opened(tmp_path: Path) -> None:
    lab = tmp_path / "lab.toml"
    lab.write_text('[vest]\ndriver = "bhaptics-player"\noptions = {port = 9, open_timeout_s = 0.2}\n')
    with pytest.raises(SystemExit) as ended:
        main(["calibrate", str(lab), "--person", "p01", "--hand", "left", "--yes", "--time-scale", "0.05"])
    assert ended.value.code != 0
    assert load_config(lab, environ={}, sets=["calibration.person=p01"]).config.vest.mirror == "all"
