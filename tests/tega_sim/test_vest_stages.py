"""Stages of the vest and the hand, and stages in all that is simulated: options, results, what is refused."""

from __future__ import annotations

import json
import lzma
import math
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from reference.command import call
from reference.sessions import read_recorded
from tega.config import file_sets, load_config
from tega.config.calibration import TouchMaxima
from tega.config.choose import chosen_stage
from tega.errors import ConfigError, InvalidValueError
from tega.hand import CLOSURE_POSES_RAD, ModelledHand, closure_level, joined_level, split_level
from tega.haptics import intensity
from tega.haptics.motor_layout import PAPER32, X16, Motor, MotorLayout, find_layout
from tega.loop.touch import TouchLoop
from tega.records import Contact
from tega.stages import NamedValue
from tega.stages.columns import ColumnsMapping, ColumnsOptions
from tega_figures.felt.shown import score_lifts
from tega_sim.lab import lab_of
from tega_sim.operator import ScriptedOperator
from tega_sim.operator.scripted import DEFAULT_COURSE, Step
from tega_sim.plan import TrialPlan, loop_settings
from tega_sim.streams import Streams
from tega_sim.trial import run_trial
from tega_sim.true_touch import touch_of
from tega_study.lead.benches import SimulatedBench
from tega_study.plan import make_plan
from tega_study.silico.session import run_session
from tega_study.silico.simulate import jobs_of, made_study

pytest.importorskip("mujoco", reason="needs the extra tega[sim]")


def contact(**values: Any) -> Any:
    given: Any = {"finger": "index", "cci": 0.04, "eda": 4000, "peak": 60.0, "in_contact": True}
    return Contact(t_ns=0, **given | values)


def lit(touched: Contact, layout: Any = "x16", mirror: Any = "none", **options: Any) -> tuple[Any, TouchLoop]:
    """Return all rows of front and back that a finger's contact lights, and the loop that does."""
    loop = TouchLoop(
        {touched.finger: TouchMaxima(cci_max=0.08, eda_max=8000.0)},
        layout=layout,
        mirror=mirror,
        mapping=lambda setup: ColumnsMapping(setup, ColumnsOptions(**options)),
    )
    loop.update(touched.finger, touched)
    return loop.frame(0).intensities.reshape(2, -1, 4), loop


def displayed(touched: Contact, mirror: Any = "none", **options: Any) -> list[list[int]]:
    return [rows[0].tolist() for rows in lit(touched, mirror=mirror, **options)[0]]


def test_law_routing_fingers_and_mirror_are_options() -> None:
    assert displayed(contact()) == [[0, 50, 0, 0], [0, 50, 0, 0]]
    assert displayed(contact(eda=8000), law="linear") == [[0, 50, 0, 0], [0, 100, 0, 0]]
    assert displayed(contact(cci=0.0), end_value=0.1) == [[0, 10, 0, 0], [0, 50, 0, 0]]
    high = round(intensity(0.1, 0.08))
    assert displayed(contact(cci=0.1)) == [[0, high, 0, 0], [0, 50, 0, 0]]
    assert displayed(contact(cci=0.1), saturate=True) == [[0, 99, 0, 0], [0, 50, 0, 0]]
    assert displayed(contact(), front="eda", back="cci", law="linear", front_max=40_000.0)[0] == [0, 10, 0, 0]
    assert displayed(contact(), mirror="back") == [[0, 50, 0, 0], [0, 0, 50, 0]]
    order = ("ring", "middle", "thumb", "index")
    assert displayed(contact(), mirror="all", fingers=order) == [[50, 0, 0, 0], [50, 0, 0, 0]]
    own = contact(more=(NamedValue("pc1", 3.0, "1"),))
    assert displayed(own, front="pc1", front_max=6.0, law="linear")[0] == [0, 50, 0, 0]
    with pytest.raises(ConfigError, match=r"front_max: missing: .* no maximum of 'peak'"):
        displayed(contact(), front="peak")


def test_a_layout_that_cannot_be_is_refused() -> None:
    for motors, sentence in (
        ([], "has 0 motors"),
        ([Motor("front", 0, 0, 0), Motor("front", 0, 0, 1)], "one place"),
        ([Motor("front", 0, 0, 0), Motor("front", 0, 1, 0)], "one number"),
        ([Motor("side", 0, 0, 0)], "neither front nor back"),  # type: ignore[arg-type]
        ([Motor("front", 0, 0, 40)], "0 to 39"),
    ):
        with pytest.raises(InvalidValueError, match=sentence):
            MotorLayout("mine", "made here", motors)
    with pytest.raises(InvalidValueError, match="is not known"):
        find_layout("mine")
    assert PAPER32.mirrored("all").motors[0] == Motor("front", 0, 3, 0)


def test_a_mapping_that_goes_wrong_moves_nothing() -> None:
    class Broken(ColumnsMapping):
        def levels(self, t_ns: int, contacts: Any, events: Any) -> Any:  # noqa: ARG002
            return np.full(len(X16.motors), math.nan)

    loop = TouchLoop(
        {"index": TouchMaxima()}, layout="x16", mapping=lambda setup: Broken(setup, ColumnsOptions())
    )
    with pytest.raises(InvalidValueError, match="not finite"):
        loop.frame(0)
    assert not loop.silence().intensities.any()


def test_a_contact_goes_through_the_loop_with_all_its_values() -> None:
    given = contact(more=(NamedValue("pc1", 3.0, "1"),), force_n=4.5, strength=0.5)
    felt = TouchLoop({"index": TouchMaxima(cci_max=0.08, eda_max=8000.0)}, layout="x16").update(
        "index", given
    )
    assert (felt.cci_norm, felt.eda_norm, felt.front) == (0.5, 0.5, intensity(0.04, 0.08))
    assert repr(replace(felt, cci_norm=0.0, eda_norm=0.0, front=0.0, back=0.0)) == repr(given)


def test_the_hand_goes_to_a_place_between_two_levels() -> None:
    level = closure_level(0.6)
    hand, whole = ModelledHand(), ModelledHand()
    for _ in range(1500):
        hand.step(level)
        whole.step(3)
    low, high = CLOSURE_POSES_RAD[2], CLOSURE_POSES_RAD[3]
    reached = hand.controller.target_rad
    assert reached is not None
    np.testing.assert_allclose(reached, low + 0.4 * (high - low), atol=1e-7)
    np.testing.assert_array_equal(whole.controller.target_rad, low)
    with pytest.raises(InvalidValueError, match=r"level = 5\.01 is out of range"):
        hand.step(5.01)
    for requested in (0, 1, 3, 5, 3.4, 1.0001, closure_level(1 / 3)):
        assert joined_level(*split_level(requested)) == requested


def test_every_reading_of_the_vest_s_law_is_an_option() -> None:
    assert displayed(contact(eda=2000), law="power")[1] == [0, 50, 0, 0]
    assert displayed(contact(eda=2000), law="power", exponent=1.0)[1] == [0, 25, 0, 0]
    ends = displayed(contact(cci=0.0, eda=0), end_value=0.1, back_end_value=0.2)
    assert ends == [[0, 10, 0, 0], [0, 20, 0, 0]]
    assert displayed(contact(in_contact=False), at_rest="law") == [[0, 1, 0, 0], [0, 1, 0, 0]]
    assert displayed(contact(in_contact=False)) == [[0, 0, 0, 0], [0, 0, 0, 0]]

    levels, loop = lit(contact(finger="thumb", cci=0.04, eda=8000), "x40", rows="bar", law="linear")
    assert levels[0, :, 0].tolist() == [0, 0, 50, 100, 100]
    assert levels[1, :, 0].tolist() == [100] * 5
    assert not levels[:, :, 1:].any()
    assert loop.mapping.levels(0, {"thumb": contact(cci=0.08, eda=8000)}, ()).max() == 100


GOLDEN = Path(__file__).parent.parent / "golden"


@pytest.mark.slow
@pytest.mark.parametrize("seeds", [[52], pytest.param([51, 52], marks=pytest.mark.deep)])
def test_a_loaded_finger_is_felt_and_an_untouched_one_is_silent(seeds: list[int]) -> None:
    found = score_lifts(seeds)
    loaded, free = sum(one.loaded for one in found), sum(one.free for one in found)
    assert loaded > 2500 * len(seeds)
    assert sum(one.felt for one in found) >= 0.97 * loaded
    assert min(one.felt / one.loaded for one in found if one.loaded > 50) >= 0.9
    assert sum(one.false for one in found) <= 0.005 * free
    assert np.median([one.rank for one in found]) >= 0.85


def test_a_simulated_trial_takes_the_wearer_s_thresholds() -> None:
    lowest = []
    for settings in ((), ("vest.threshold=45",)):
        lab = lab_of(3, "live", settings)
        touch = touch_of(lab, TrialPlan(object="bag", seed=3, settings=settings), layout="x40")
        faint = Contact(finger="thumb", t_ns=0, in_contact=True, cci=1e-9, eda=0)
        frame = touch.displayed(0, {"thumb": faint}, ())
        lowest.append(int(frame.intensities[frame.intensities > 0].min()))
    assert lowest == [26, 59]


def test_the_paper_and_recordings_of_the_earlier_default_keep_the_printed_law(tmp_path: Path) -> None:
    chosen = {p: chosen_stage("mapping", loop_settings(p, ()).stages, p).name for p in ("paper", "live")}
    assert chosen == {"paper": "columns", "live": "equal-steps"}
    path = tmp_path / "live.mcap"
    path.write_bytes(lzma.decompress((GOLDEN / "1-live.mcap.xz").read_bytes()))
    recorded = read_recorded(path)
    assert recorded.head.config.session.preset == "live"
    assert recorded.head.config.stages.mapping.name == "columns"


BESIDE = (
    'stages.beside=[{ group = "metric", name = "reading", options = { threshold = "D7" } }, '
    '{ group = "decoder", name = "rules", options = { fusion = "median" } }]'
)
LAB = """
[vest]
layout = "x16"
rate_hz = 20
[stages.metric]
name = "reading"
options = { threshold = "D6", factor = 2.0 }
[stages.decoder.options]
fusion = "round"
[[stages.beside]]
group = "decoder"
name = "rules"
options = { intervals = 5 }
"""


@pytest.mark.slow
def test_stages_beside_a_lift_are_written_down_and_change_nothing(tmp_path: Path) -> None:
    plan = TrialPlan(object="bottle", operator="scripted", seed=3, preset="paper")
    course = (*DEFAULT_COURSE[:3], Step(3.8, "done", 3, (0.0, 0.0), 0.0))  # reach, and close on the object
    alone = run_trial(plan, person=ScriptedOperator(course))
    streams, beside = Streams(), replace(plan, settings=(BESIDE,))
    both = run_trial(beside, person=ScriptedOperator(course), streams=streams)
    assert replace(both, settings=()) == alone
    streams.write_tables(tmp_path)
    contacts, levels, own = (
        (tmp_path / f"{table}.csv").read_text().splitlines()
        for table in ("beside-contacts", "beside-levels", "levels")
    )
    assert contacts[0] == "t_s,stage,finger,in_contact,cci,eda,peak"
    # The metric beside calls contact what the chosen one would, were it chosen.
    assert {row.split(",")[1] for row in contacts[1:]} == {"reading"}
    assert len(contacts) > 100
    assert levels[0].endswith("fused,closure")
    assert {row.split(",")[1] for row in levels[1:]} == {"rules"}
    assert len(levels) >= len(own) > 30


@pytest.mark.slow
def test_sim_trials_take_a_labs_settings_keep_them_and_print_trials_and_means(
    tmp_path: Path, capsys: Any
) -> None:
    lab, out = tmp_path / "lab.toml", tmp_path / "trials.jsonl"
    lab.write_text(LAB)
    words = ["sim", "trials", "--objects", "bottle", "--conditions", "non-haptic", "--seeds", "1"]
    words += ["--operator", "scripted", "--config", str(lab), "--out", str(out)]
    words += ["--set", "stages.metric.options.factor=1.0"]
    report = json.loads(call(capsys, *words, "--jobs", 1, "--json")[0])
    assert set(report) == {"trials", "table", "wall_s", "simulated_s", "jobs"}
    (trial,) = report["trials"]
    assert trial["condition"] == report["table"][0]["condition"] == "non-haptic"
    assert "stages.metric.options.factor=2.0" in trial["settings"]
    assert trial["settings"][-1] == "stages.metric.options.factor=1.0"
    assert any(item.startswith("stages.beside=") and "rules" in item for item in trial["settings"])
    assert json.loads(out.read_text())["settings"] == trial["settings"]
    assert "trials: 1; simulated persons: 1; took" in call(capsys, *words)[0]
    assert "brick" in call(capsys, "sim", "trials", "--objects", "brick", "--seeds", 1, code=1)[1]


def test_a_files_settings_of_the_loop_are_all_that_is_taken(tmp_path: Path) -> None:
    lab = tmp_path / "lab.toml"
    lab.write_text(LAB)
    sets = file_sets(lab)
    assert not any(item.startswith(("vest.rate_hz", "session")) for item in sets)
    again, given = (
        load_config(path, environ={}, sets=more).config for path, more in ((None, sets), (lab, ()))
    )
    assert again.stages == given.stages
    assert again.vest.layout == "x16"
    lab.write_text("[stages.metric]\nname = 'reading'\noptions = { factr = 1 }\n")
    with pytest.raises(ConfigError, match=r"lab\.toml:3: stages\.metric\.options\.factr: unknown key"):
        file_sets(lab)


def test_a_study_in_silico_is_run_with_the_stages_it_says(tmp_path: Path, capsys: Any) -> None:
    how: dict[str, Any] = {"operators": 1, "seed": 2, "objects": ["bottle"], "trials": 1}
    arms = ("haptic", "non-haptic")
    settings = ("stages.metric.name=paper", "stages.decoder.options.fusion=median")
    plan, stated = made_study(tmp_path / "s", **how, conditions=arms, settings=settings, preset="paper")
    assert (stated.settings, stated.preset) == (settings, "paper")
    kept = tomllib.loads((tmp_path / "s" / "simulation.toml").read_text())
    assert kept["settings"] == list(settings)
    (job,) = jobs_of(tmp_path / "s", plan, stated, plan.participants)
    assert job.assumptions.settings == settings
    words = ["study", "simulate", "--operators", "1", "--objects", "bottle", "--trials", "1"]
    words += ["--out", str(tmp_path / "t")]
    for item, message in (
        ("stages.metric.nme=paper", "did you mean 'name'"),
        ("safety.hold_s=1", "has no such setting"),
    ):
        assert message in call(capsys, *words, "--set", item, code=1)[1]


@pytest.mark.slow
def test_a_session_in_silico_reads_as_its_settings_say(tmp_path: Path) -> None:
    how: dict[str, Any] = {"operators": 1, "seed": 2, "objects": ["bottle"], "trials": 1, "preset": "paper"}
    courses = []
    for name, settings in (
        ("a", ()),
        ("b", ("stages.metric.name=reading", "stages.metric.options.cci=root")),
    ):
        folder = tmp_path / name
        # Vests of which nobody learns anything before.
        plan, stated = made_study(folder, **how, conditions=("event-gated", "non-haptic"), settings=settings)
        (job,) = jobs_of(folder, plan, stated, plan.participants, pictures=False)
        run_session(job)
        courses.append({file.name: file.read_bytes() for file in folder.glob("courses/*/*")})
    assert courses[0].keys() == courses[1].keys()
    assert courses[0] != courses[1]


@pytest.mark.slow
def test_a_rehearsal_on_the_simulated_bench_takes_stages() -> None:
    plan = make_plan(
        participants=1,
        seed=1,
        objects=["bottle"],
        conditions=("haptic", "non-haptic"),
        trials=1,
        simulated=True,
    )
    settings = ("stages.metric.name=reading", "stages.metric.options.threshold=D8", "vest.layout=x16")
    bench = SimulatedBench(plan, plan.participants[0], preset="paper", settings=settings)
    assert bench.config.stages.metric.name == "reading"
    assert bench.config.vest.layout == "x16"
    with pytest.raises(ConfigError, match="no such setting"):
        SimulatedBench(plan, plan.participants[0], settings=("session.preset=live",))
