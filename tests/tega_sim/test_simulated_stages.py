"""Stages chosen and beside in everything that is simulated: demo, sim-trials, a study and its rehearsal."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

import pytest

from reference.command import call
from tega.config import file_sets, load_config
from tega.errors import ConfigError

pytest.importorskip("mujoco", reason="needs the extra tega[sim]")

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


def verb(*words: object, capsys: Any) -> Any:
    return json.loads(call(capsys, *words)[0])


@pytest.mark.slow
def test_stages_beside_a_lift_are_told_and_change_nothing() -> None:
    import msgspec

    from tega_sim.streams import Streams
    from tega_sim.trial import TrialPlan, run_trial

    plan = TrialPlan(object="bottle", operator="scripted", seed=3, preset="paper")
    alone = run_trial(plan)
    streams = Streams()
    both = run_trial(msgspec.structs.replace(plan, settings=(BESIDE,)), streams=streams)
    assert len(streams.rows["beside-levels"]) >= len(streams.rows["levels"])
    assert msgspec.structs.replace(both, settings=()) == alone
    # The metric beside calls contact what the chosen one would, were it chosen.
    assert {row[1] for row in streams.rows["beside-contacts"]} == {"reading"}


@pytest.mark.slow
def test_a_demo_writes_what_stages_beside_say(tmp_path: Path, capsys: Any) -> None:
    verb(
        "demo", "--objects", "bottle", "--operator", "scripted", "--fast", "--preset", "paper",
        "--out", tmp_path / "demo", "--set", BESIDE, "--json", capsys=capsys,
    )  # fmt: skip
    contacts = (tmp_path / "demo" / "1-bottle" / "beside-contacts.csv").read_text().splitlines()
    levels = (tmp_path / "demo" / "1-bottle" / "beside-levels.csv").read_text().splitlines()
    assert contacts[0] == "t_s,stage,finger,in_contact,cci,eda,peak"
    assert {row.split(",")[1] for row in contacts[1:]} == {"reading"}
    assert len(contacts) > 100
    assert levels[0].endswith("fused,closure")
    assert {row.split(",")[1] for row in levels[1:]} == {"rules"}
    assert len(levels) > 50
    kept = json.loads((tmp_path / "demo" / "summary.json").read_text())
    assert kept["trials"][0]["settings"] == [BESIDE]


@pytest.mark.slow
def test_sim_trials_take_a_labs_settings_and_keep_them(tmp_path: Path, capsys: Any) -> None:
    lab, out = tmp_path / "lab.toml", tmp_path / "trials.jsonl"
    lab.write_text(LAB)
    words = ["sim", "trials", "--objects", "bottle", "--conditions", "haptic", "--seeds", "1"]
    words += ["--operator", "scripted"]
    more = ("--config", lab, "--set", "stages.metric.options.factor=1.0", "--jobs", 1, "--out", out, "--json")
    (trial,) = verb(*words, *more, capsys=capsys)["trials"]
    assert "stages.metric.options.factor=2.0" in trial["settings"]
    assert trial["settings"][-1] == "stages.metric.options.factor=1.0"
    assert any(item.startswith("stages.beside=") and "rules" in item for item in trial["settings"])
    assert json.loads(out.read_text())["settings"] == trial["settings"]


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
    from tega_study.silico.simulate import jobs_of, made_study

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
    from tega_study.silico.session import run_session
    from tega_study.silico.simulate import jobs_of, made_study

    how: dict[str, Any] = {"operators": 1, "seed": 2, "objects": ["bottle"], "trials": 1, "preset": "paper"}
    courses = []
    for name, settings in (
        ("a", ()),
        ("b", ("stages.metric.name=reading", "stages.metric.options.cci=root")),
    ):
        folder = tmp_path / name
        plan, stated = made_study(folder, **how, conditions=("haptic", "non-haptic"), settings=settings)
        (job,) = jobs_of(folder, plan, stated, plan.participants, pictures=False)
        files = run_session(job)
        courses.append({path: content for path, content in files.items() if "course" in path})
    assert courses[0].keys() == courses[1].keys()
    assert courses[0] != courses[1]


@pytest.mark.slow
def test_a_rehearsal_on_the_simulated_bench_takes_stages() -> None:
    from tega_study.lead.benches import SimulatedBench
    from tega_study.plan import make_plan

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
