"""Stages: found by name, options checked with their line, and every reading a choice of a run."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reference.command import call
from reference.sessions import synthetic
from tega.config import SessionConfig, StageConfig, StagesSection, load_config
from tega.config.choose import Chosen
from tega.errors import ConfigError, InvalidValueError
from tega.haptics.motor_layout import find_layout
from tega.records import Contact
from tega.setup.contract import check_stage
from tega.stages import FingerSetup, MuscleSetup, list_stages, stage_names
from tega.stages.decoders import RulesDecoder, RulesOptions
from tega.stages.metrics import contact_record
from tega.tactile import ContactMetrics, contact_metrics, read_contact
from tega_readings.metric import ReadingMetric, ReadingOptions


def pressed(seed: int, depth: float) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    rng = np.random.default_rng(seed)
    baseline = np.full((120, 160, 3), 90, np.uint8)
    rows, columns = np.mgrid[:120, :160]
    dent = depth * np.exp(-((columns - 70 - seed) ** 2 + (rows - 55) ** 2) / (2 * 15.0**2))
    noise = rng.normal(0, 1.5, baseline.shape)
    return np.clip(baseline + dent[:, :, None] * [1.0, 0.7, 0.4] + noise, 0, 255).astype(np.uint8), baseline


def reading(baseline: Any, **options: Any) -> ReadingMetric:
    return ReadingMetric(FingerSetup("index", baseline), ReadingOptions(**options))


def test_the_stages_of_the_package_are_found_and_described() -> None:
    assert {"live", "paper", "reading"} <= set(stage_names("metric"))
    found = {(stage.group, stage.name): stage for stage in list_stages()}
    assert all(stage.summary for stage in found.values())
    assert all(stage.ready for stage in found.values() if stage.name != "lsl")  # which needs pylsl
    options = {(stage.name, option.name): option for stage in found.values() for option in stage.options}
    factor, cutoff = options["reading", "factor"], options["rules", "cutoff_hz"]
    assert (factor.default, factor.summary) == (1.28, "The 1.28 of Eq 4.")
    assert (cutoff.default, cutoff.unit) == (50.0, "Hz")
    assert [name for name, option in options.items() if not option.summary] == []


@pytest.mark.parametrize("stage", [s for s in list_stages() if s.package == "tega"], ids=lambda s: s.name)
def test_the_stages_of_the_package_keep_the_contract(stage: Any) -> None:
    if stage.group == "layout":
        check_stage(find_layout(stage.name))
    # test_decoders.py, test_outside_decoder.py and test_onnx.py have what these need.
    elif stage.name not in {"learned", "lsl", "onnx"}:
        check_stage(Chosen(stage.group, StageConfig(name=stage.name), "live").kind)


def test_every_stage_and_option_can_be_printed(capsys: pytest.CaptureFixture[str]) -> None:
    reported = json.loads(call(capsys, "stages", "--json")[0])
    names = {stage["name"]: [option["name"] for option in stage["options"]] for stage in reported}
    assert {"columns", "x16"} <= set(names)
    out, _ = call(capsys, "stages")
    for name, options in names.items():
        assert all(word in out for word in (name, *options))


WRONG = [
    ("[stages.metric]\nname = 'papr'", r"lab\.toml:2: stages\.metric\.name: no metric .* 'papr'; did you mean 'paper'"),
    (
        "[stages.metric]\nname = 'reading'\n[stages.metric.options]\nfactor = -1",
        r"lab\.toml:4: stages\.metric\.options\.factor = -1: expected .* >= 0",
    ),
    (
        "[stages.decoder.options]\nfusion = 'mean'",
        r"lab\.toml:2: stages\.decoder\.options\.fusion = 'mean': not one of the choices; one of: floor, round, median",
    ),
    ('format = "tega-calibration"\npreset = "live"', r"lab\.toml: a tega-calibration file, no settings"),
    ("[vest]\nlayout = 'x41'", r'lab\.toml:2: vest\.layout = "x41" is not known'),
    ("[stages.metrics]\nname = 'paper'", r"stages\.metrics: unknown key; did you mean 'metric'"),
    ("[[stages.beside]]\ngroup = 'metric'\nname = 'reding'", r"beside\[0\]\.name: no metric .* did you mean 'reading'"),
    (
        "[[stages.beside]]\ngroup = 'metric'\nname = 'reading'\noptions = { factr = 1 }",
        r"stages\.beside\[0\]\.options\.factr: unknown key.*'factor'",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("text", "reported"), WRONG)
def test_a_wrong_stage_is_refused_by_line_and_nearest_name(tmp_path: Path, text: str, reported: str) -> None:
    file = tmp_path / "lab.toml"
    file.write_text(text)
    with pytest.raises(ConfigError, match=reported):
        load_config(file, environ={})


def test_options_show_their_origin(tmp_path: Path) -> None:
    file = tmp_path / "lab.toml"
    file.write_text("[stages.metric]\nname = 'reading'\n[stages.metric.options]\nfactor = 2.0\n")
    environ = {"TEGA_STAGES__DECODER__OPTIONS__ORDER": "2"}
    values = load_config(file, environ=environ, sets=["stages.mapping.options.law=linear"]).values
    assert values["stages.metric.options.factor"] == (2.0, "lab.toml:4")
    assert values["stages.metric.options.threshold"] == ("D3", "default")
    assert values["stages.decoder.options.order"] == (2, "TEGA_STAGES__DECODER__OPTIONS__ORDER")
    assert values["stages.mapping.options.law"] == ("linear", "--set")
    assert values["stages.mapping.name"] == ("equal-steps", "preset live")


def test_a_stage_of_no_name_is_the_presets() -> None:
    for preset in ("paper", "live"):
        config = load_config(None, environ={}, sets=[f"session.preset={preset}"]).config
        assert Chosen("metric", config.stages.metric, preset).name == preset
    # Another preset takes its own stage, whose options are others.
    stages = load_config(None, environ={}).config.stages
    own, plain = (Chosen("metric", one, "paper").options for one in (stages.metric, StageConfig()))
    assert own == plain
    given = load_config(None, environ={}, sets=["stages.metric.options.outline=contact"]).config.stages
    with pytest.raises(ConfigError, match=r"stages\.metric\.options\.outline: unknown key"):
        Chosen("metric", given.metric, "paper")
    assert SessionConfig().stages == StagesSection()


@pytest.mark.parametrize("depth", [0.0, 3.0, 12.0, 60.0, 150.0])
def test_the_reading_of_the_preset_is_one_of_the_readings(depth: float) -> None:
    for seed in range(4):
        frame, baseline = pressed(seed, depth)
        want, got = read_contact(frame, baseline, reading="paper"), reading(baseline).update(frame, 7)
        assert (got.finger, got.t_ns) == ("index", 7)
        assert (got.in_contact, got.eda, got.peak_xy) == (want.in_contact, want.eda, want.peak_xy)
        for name in ("mass", "spread", "threshold", "cci", "peak", "centroid_xy"):
            assert getattr(got, name) == pytest.approx(getattr(want, name), rel=1e-9, nan_ok=True), name


def test_the_printed_readings_are_the_kernels() -> None:
    frame, baseline = pressed(1, 80.0)
    for options, kernel in (
        ({"threshold": "D1"}, {}),
        ({"threshold": "D2", "factor": 0.7}, {"difference": "rectified", "factor": 0.7}),
        ({"spread": "intensity", "threshold": "D1"}, {"spread": "intensity"}),
        ({"threshold": "D2", "weights": (0.2, 0.5, 0.3)}, {"difference": "rectified", "weights": (0.2, 0.5, 0.3)}),
    ):  # fmt: skip
        want: ContactMetrics = contact_metrics(frame, baseline, **kernel)
        got = reading(baseline, **options).update(frame, 0)
        assert repr(got) == repr(contact_record(got.finger, 0, want))


def test_every_threshold_is_what_its_name_says() -> None:
    frame, baseline = pressed(2, 100.0)
    names = ("D3", "D4", "D5", "D6", "D7", "D8")
    area = {name: reading(baseline, threshold=name).update(frame, 0) for name in names}
    peak = area["D6"].peak
    assert area["D6"].threshold == 6.0
    assert area["D7"].threshold == max(0.1 * peak, 6.0)
    assert area["D8"].threshold == 0.5 * peak
    assert area["D5"].threshold == pytest.approx(0.44 * peak, rel=0.05)
    value, spread = area["D5"].threshold / 0.44, area["D3"].spread
    assert area["D3"].threshold == pytest.approx(value - 1.28 * spread)
    assert area["D8"].eda < area["D5"].eda < area["D7"].eda <= area["D6"].eda
    narrow = reading(baseline, threshold="D4", factor=0.5).update(frame, 0)
    assert narrow.eda < area["D4"].eda
    root = reading(baseline, cci="root").update(frame, 0)
    assert root.cci == pytest.approx(peak / math.sqrt(root.eda))
    assert reading(baseline, noise_floor=200.0).update(frame, 0).in_contact is False


def test_the_rules_are_options() -> None:
    setup = MuscleSetup("envelope", 200.0, 20, ("a", "b", "c"), (1.0, 1.0, 1.0), "paper")
    samples, times = np.tile([0.85, 0.1, 0.3], (40, 1)), np.arange(1, 41) * 5_000_000

    def levels(**options: Any) -> list[tuple[int, tuple[int, ...], int]]:
        found = RulesDecoder(setup, RulesOptions(**options)).decode(samples, times)
        return [(intent.t_ns, intent.channels, intent.level) for intent in found]

    assert levels() == [(100_000_000, (4, 1, 2), 2), (200_000_000, (4, 1, 2), 2)]
    assert levels(intervals=5)[0][1:] == ((5, 1, 2), 2)
    assert levels(intervals=5, fusion="round")[0][2] == 3
    assert levels(fusion="median")[0][2] == 2
    assert levels(channel_weights=(1.0, 0.0, 0.0))[0][2] == 4
    with pytest.raises(InvalidValueError, match="2 numbers for 3 channels"):
        levels(channel_weights=(1.0, 0.0))
    assert RulesDecoder.block_s(RulesOptions(tau_s=0.2)) == 0.2
    samples = np.concatenate([np.zeros((20, 3)), np.ones((20, 3))])
    assert levels(cutoff_hz=0.5, order=1)[-1][2] < levels()[-1][2]


BESIDE = """
[[stages.beside]]
group = "decoder"
name = "rules"
options = { fusion = "median", tau_s = 0.1 }
[[stages.beside]]
group = "metric"
name = "reading"
options = { threshold = "D7" }
[[stages.beside]]
group = "metric"
name = "reading"
options = { noise_floor = 0.2 }
"""


def test_stages_beside_are_recorded_and_change_nothing(tmp_path: Path) -> None:
    pytest.importorskip("foxglove")
    from tega.loop import run_session
    from tega.recording.mcap_reader import McapReader
    from tega.recording.replay import replay_file

    def run(name: str, text: str) -> dict[str, list[Any]]:
        (tmp_path / name).mkdir()
        (tmp_path / name / "lab.toml").write_text(synthetic(0.5, "index", more=text))
        summary = run_session(load_config(tmp_path / name / "lab.toml", environ={}).config)
        file = tmp_path / name / "recorded" / summary["recording"]["file"]
        assert replay_file(file).same
        found: dict[str, list[Any]] = {}
        for message in McapReader(file).messages():
            found.setdefault(message.topic, []).append(message.value)
        return found

    alone = run("alone", "")
    both = run("both", BESIDE)
    assert {topic for topic in both if topic.startswith("/beside/")} == {
        "/beside/rules/emg", "/beside/reading/index", "/beside/reading-2/index"
    }  # fmt: skip
    for topic in ("/emg/levels", "/vest/frame", "/hand/frames"):
        assert [str(value) for value in both[topic]] == [str(value) for value in alone[topic]], topic
    # The set time ends the loop before what is complete at that moment is taken in; who looks on has seen it.
    stamps = [value.t_ns for value in both["/emg/levels"]]
    assert [value.t_ns for value in both["/beside/rules/emg"]][: len(stamps)] == stamps
    tenth, printed = both["/beside/reading/index"], both["/beside/reading-2/index"]
    stamps = [value.t_ns for value in both["/tactile/index/contact"]]
    assert [value.t_ns for value in tenth][: len(stamps)] == stamps
    assert len(tenth) == len(printed)
    assert max(value.eda for value in printed) > 0  # noise counts as contact there
    assert [value.eda for value in tenth] != [value.eda for value in printed]


def test_every_reading_of_the_list_changes_what_is_measured() -> None:
    frame, baseline = pressed(2, 100.0)
    grey = reading(baseline)._map(frame)[0]

    def read(**options: Any) -> Contact:
        return reading(baseline, **options).update(frame, 0)

    printed = read()
    for options in (
        {"difference": "l2"}, {"difference": "luminance", "weights": (1.5, -1.0, 0.5)}, {"centroid_value": "peak"},
    ):  # fmt: skip
        assert repr(read(**options)) != repr(printed), options
    assert (read(cci="peak").cci, read(cci="mass").cci) == (printed.peak, printed.mass)
    assert 0 < read(peak="median").peak < printed.peak
    assert read(peak="percentile").peak == np.percentile(grey[grey > 0], 99.9)
    floor = float(grey[grey > 6].min())
    strict, ties = (read(threshold="D6", noise_floor=floor, ties=ties).eda for ties in (False, True))
    assert ties == strict + np.count_nonzero(grey == floor)
    x, y = printed.centroid_xy
    near = read(threshold="D5", centroid_value="disc")
    rows, columns = np.ogrid[:120, :160]
    assert near.threshold == pytest.approx(0.44 * grey[(columns - x) ** 2 + (rows - y) ** 2 <= 25].max())
    for name, value in (("difference", "l2"), ("centroid_value", "disc"), ("ties", True), ("peak", "median")):
        with pytest.raises(InvalidValueError, match=f"{name} = .* take one of D3 to D8"):
            reading(baseline, threshold="D1", **{name: value})
    with pytest.raises(InvalidValueError, match="add up to"):
        reading(baseline, weights=(0.3, 0.3, 0.3))
    with pytest.raises(InvalidValueError, match="take D4"):
        reading(baseline, spread="intensity")
