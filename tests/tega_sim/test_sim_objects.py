"""Objects by file, factorial plans of them, and what a study's frozen hash covers."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import Any

import msgspec
import pytest

pytest.importorskip("mujoco", reason="needs the extra tega[sim]")
from reference.results import trial_result
from tega.errors import ConfigError, InvalidValueError, RecordingError, UnsafeNameError
from tega.ui.cli.main import main
from tega_sim.plan import TrialPlan
from tega_sim.trials import plan_trials, read_results, summarise_trials
from tega_sim.world import OBJECTS, crossed, read_objects
from tega_study.silico.assumptions import assume, code_sha256, read_assumptions
from tega_study.silico.simulate import made_study

TIN = """
[tin]
mass_kg = 0.45
stiffness_n_m = 6000.0
friction = 0.4
diameter_m = 0.075
height_m = 0.15
harm_m = 0.004
[tin.range]
mass_kg = [0.3, 0.9]
[tin.source]
mass_kg = "weighed"
stiffness_n_m = "a probe"
friction = "a slope"
harm_m = "the lid springs open"
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "things.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_bench_s_own_objects_lie_in_their_ranges_and_say_where_their_harm_rule_is_from() -> None:
    records = read_objects()
    assert {name: record.spec for name, record in records.items()} == OBJECTS
    assert list(OBJECTS) == ["bottle", "container", "bag"]
    for record in records.values():
        assert record.source["harm_m"]
        assert set(record.range) == {"mass_kg", "stiffness_n_m", "friction"}


def test_an_object_of_a_file_is_planned_and_travels_with_its_plan(tmp_path: Path) -> None:
    spec = read_objects(written(tmp_path, TIN))["tin"].spec
    plan = TrialPlan.checked({"object": "tin", "spec": spec, "mass_kg": 0.6})
    assert plan.object_spec == spec.with_(mass_kg=0.6)
    assert msgspec.json.decode(msgspec.json.encode(plan), type=TrialPlan) == plan
    assert TrialPlan(object="bag").object_spec == OBJECTS["bag"]
    for refused in ({"object": "tin"}, {"object": "bag", "spec": spec}):
        with pytest.raises(InvalidValueError, match="is not known"):
            TrialPlan.checked(refused)
    for mass_kg in (99.0, float("nan")):
        with pytest.raises(InvalidValueError, match="mass_kg"):
            TrialPlan.checked({"object": "bag", "mass_kg": mass_kg})


@pytest.mark.parametrize(
    ("old", "new", "error", "message"),
    [
        ('harm_m = "the lid springs open"', "", ConfigError, "'tin' has no source for harm_m"),
        ("mass_kg = [0.3, 0.9]", "mass_kg = [0.5, 0.9]", ConfigError, "mass_kg is not within its range 0.5"),
        ("harm_m = 0.004", "harm_m = 4", ConfigError, "harm_m"),
        ("height_m", "hieght_m", ConfigError, "hieght_m"),
        ("[tin", '["../tin"', UnsafeNameError, "tin"),
        (TIN, "", ConfigError, "has no object"),
        (TIN, "tin = 3", ConfigError, "one table an object"),
    ],
)
def test_a_file_that_is_no_objects_says_what_is_wrong(
    tmp_path: Path, old: str, new: str, error: type[Exception], message: str
) -> None:
    text = TIN.replace(old, new)
    with pytest.raises(error, match=message):
        read_objects(written(tmp_path, text))


def test_a_factorial_plan_has_every_combination_once_with_the_same_chance() -> None:
    plans = plan_trials(["bag"], ["haptic", "non-haptic"], [7], mass_kg=[0.3, 0.6], friction=[0.4, 0.8])
    assert len({(plan.mass_kg, plan.friction, plan.condition) for plan in plans}) == len(plans) == 8
    assert {plan.object for plan in plans} == {"bag"}, "streams of chance are by the object's name"
    results = [trial_result(**msgspec.structs.asdict(plan)) for plan in plans]
    rows = summarise_trials(results)
    first_two = [(row.object, row.condition) for row in rows][:2]
    assert first_two == [("bag_300g_mu40", "haptic"), ("bag_300g_mu40", "non-haptic")]
    assert [row.n for row in rows] == [1] * 8


def test_objects_are_crossed_under_names_that_tell_them_apart() -> None:
    variants = crossed([OBJECTS["bag"], OBJECTS["bottle"]], mass_kg=[0.3, 0.6], stiffness_n_m=[400, 800])
    assert len(variants) == 8
    assert variants["bottle_600g_400npm"].mass_kg == 0.6
    assert variants["bottle_600g_400npm"].name == "bottle_600g_400npm"
    assert crossed([OBJECTS["bag"]]) == {"bag": OBJECTS["bag"]}
    with pytest.raises(InvalidValueError, match="friction"):
        crossed([OBJECTS["bag"]], friction=[9.0])


def test_a_study_s_hash_covers_all_it_depends_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def digest(where: str, *, masses_kg: tuple[float, float] = (0.3, 0.6), **how: Any) -> str:
        made: dict[str, Any] = {
            "operators": 1,
            "seed": 1,
            "trials": 1,
            "conditions": ["oracle", "non-haptic"],
        }
        objects = crossed([OBJECTS["bag"]], mass_kg=masses_kg)
        plan, stated = made_study(tmp_path / where, objects=objects, **made, **how)
        assert len(plan.trials) == 2 * len(stated.objects)
        read = read_assumptions(tmp_path / where)
        assert read is not None
        assert read.digest == stated.digest
        return stated.digest

    people = tmp_path / "people.toml"
    frozen = files("tega_sim.operator").joinpath("parameters.toml").read_text(encoding="utf-8")
    people.write_text(frozen.replace("value = 215,", "value = 216,"), encoding="utf-8")
    first = digest("a")
    assert digest("a") == first
    changes: list[dict[str, Any]] = [{"masses_kg": (0.3, 0.7)}, {"view": "hidden"}, {"preset": "paper"}]
    others = [digest(str(n), **how) for n, how in enumerate([*changes, {"parameters": people}])]
    monkeypatch.setattr("tega_study.silico.assumptions.code_sha256", lambda: "0" * 64)
    others.append(digest("g"))
    assert len({first, *others}) == 6
    with pytest.raises(InvalidValueError, match=r"begun with another simulation\.toml"):
        digest("a")


def test_the_program_s_hash_covers_its_python_its_data_and_its_extension(tmp_path: Path) -> None:
    covered = ("tega/a.py", "tega_sim/world/objects.toml", "tega/_native.abi3.so")
    others = ("tega/__pycache__/a.cpython-311.pyc", "tega-0.2.dist-info/RECORD", "numpy/a.py")
    for name in (*covered, *others):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("1", encoding="utf-8")
    before = code_sha256(tmp_path)
    for name in (*covered, *others):
        (tmp_path / name).write_text("2", encoding="utf-8")
        assert (code_sha256(tmp_path) == before) == (name in others)
        (tmp_path / name).write_text("1", encoding="utf-8")
    (tmp_path / "tega/a.py").rename(tmp_path / "tega/b.py")
    assert code_sha256(tmp_path) != before


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["sim", "trials", "--objects", "bag", "--objects-file", "things.toml"], "object 'bag' is not known"),
        (["study", "simulate", "--operators", "1", "--out", "s", "--mass-kg", "0.3,99"], "mass_kg"),
        (["sim", "trials", "--mass-kg", "a,b"], "'a,b' is not a list of numbers"),
        (["sim", "trials", "--view", "closed"], "closed"),
    ],
)
def test_the_commands_refuse_objects_and_factors_that_cannot_be(
    arguments: list[str],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    written(tmp_path, TIN)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code
    assert message in capsys.readouterr().err
    assert not (tmp_path / "s").exists()


def older_study(folder: Path, shear: str) -> Path:
    """Write the statement of a study as version 0.2 did: with shear, and with reliefs of its objects."""
    for name, content in assume({"bag": OBJECTS["bag"]})[1].items():
        (folder / name).write_bytes(content)
    path = folder / "simulation.toml"
    bag = "[objects.bag]\n"
    text = path.read_text(encoding="utf-8").replace(bag, f"{bag}relief_counts = 0.0\nrelief_mm = 0.6\n")
    path.write_text(f'shear = "{shear}"\n{text}', encoding="utf-8")
    return folder


def test_an_older_study_is_read_unless_its_gels_gave_way(tmp_path: Path) -> None:
    stated = read_assumptions(older_study(tmp_path, "off"))
    assert stated is not None
    assert stated.spec("bag") == OBJECTS["bag"]
    with pytest.raises(
        RecordingError, match=r"simulation\.toml: shear was taken out in 0\.3: simulated gels"
    ):
        read_assumptions(older_study(tmp_path, "texture"))


def test_older_results_are_read_as_before(tmp_path: Path) -> None:
    result, path = trial_result(), tmp_path / "results.jsonl"
    tree = msgspec.to_builtins(result)
    spec = msgspec.to_builtins(OBJECTS["bag"]) | {"relief_counts": 0.0, "relief_mm": 0.6}
    older = tree | {"shear": "off", "hand": "decoder", "beside": [], "spec": spec}
    result = msgspec.structs.replace(result, spec=OBJECTS["bag"])
    path.write_bytes(msgspec.json.encode(older) + b"\n")
    assert read_results(path) == {result.plan: result}
    path.write_bytes(msgspec.json.encode(tree | {"shear": "dots"}) + b"\n")
    with pytest.raises(RecordingError, match=r"shear was taken out in 0\.3"):
        read_results(path)


def test_an_objects_file_with_a_relief_is_refused_by_its_name(tmp_path: Path) -> None:
    flat, relief = (TIN.replace("[tin]", f"[tin]\nrelief_counts = {counts}") for counts in (0.0, 1.5))
    assert read_objects(written(tmp_path, flat))["tin"].spec.mass_kg == 0.45
    with pytest.raises(ConfigError, match=r"relief_counts was taken out in 0\.3"):
        read_objects(written(tmp_path, relief))
