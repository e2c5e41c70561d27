"""Studies, results and objects that older versions wrote: read where they made no use of what was taken out."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

pytest.importorskip("mujoco", reason="needs the extra tega[sim]")

from reference.results import trial_result
from tega.errors import ConfigError, RecordingError
from tega_sim.trials import read_results
from tega_sim.world import OBJECTS
from tega_sim.world.objects import read_objects
from tega_study.silico.assumptions import assume, assumption_files, read_assumptions


def older_study(folder: Path, shear: str) -> Path:
    """Write the statement of a study as version 0.2 did: with shear, and with reliefs of its objects."""
    stated, people = assume({"bag": OBJECTS["bag"]})
    for name, content in assumption_files(stated, people).items():
        (folder / name).write_bytes(content)
    path = folder / "simulation.toml"
    text = path.read_text(encoding="utf-8").replace(
        "[objects.bag]\n", "[objects.bag]\nrelief_counts = 0.0\nrelief_mm = 0.6\n"
    )
    path.write_text(f'shear = "{shear}"\n{text}', encoding="utf-8")
    return folder


def test_an_older_study_is_read_where_its_gels_did_not_give_way_and_named_where_they_did(
    tmp_path: Path,
) -> None:
    stated = read_assumptions(older_study(tmp_path, "off"))
    assert stated is not None
    assert stated.spec("bag") == OBJECTS["bag"]
    with pytest.raises(
        RecordingError, match=r"simulation\.toml: shear was taken out in 0\.3: simulated gels"
    ):
        read_assumptions(older_study(tmp_path, "texture"))


def test_older_results_are_read_as_before(tmp_path: Path) -> None:
    result = trial_result()
    path = tmp_path / "results.jsonl"
    tree = msgspec.to_builtins(result)
    spec = msgspec.to_builtins(OBJECTS["bag"])
    spec |= {"relief_counts": 0.0, "relief_mm": 0.6}
    older = tree | {"shear": "off", "hand": "decoder", "beside": [], "spec": spec}
    result = msgspec.structs.replace(result, spec=OBJECTS["bag"])
    path.write_bytes(msgspec.json.encode(older) + b"\n")
    assert read_results(path) == {result.plan: result}
    path.write_bytes(msgspec.json.encode(tree | {"shear": "dots"}) + b"\n")
    with pytest.raises(RecordingError, match=r"shear was taken out in 0\.3"):
        read_results(path)


def test_an_objects_file_with_a_relief_is_refused_by_its_name(tmp_path: Path) -> None:
    text = """[cup]
mass_kg = 0.3
stiffness_n_m = 400
friction = 0.5
diameter_m = 0.08
height_m = 0.2
relief_counts = {counts}

[cup.source]
mass_kg = "scale"
stiffness_n_m = "rig"
friction = "slope"
harm_m = "eye"
"""
    path = tmp_path / "objects.toml"
    path.write_text(text.format(counts=0.0), encoding="utf-8")
    assert read_objects(path)["cup"].spec.mass_kg == 0.3
    path.write_text(text.format(counts=1.5), encoding="utf-8")
    with pytest.raises(ConfigError, match=r"relief_counts was taken out in 0\.3"):
        read_objects(path)
