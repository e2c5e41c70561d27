"""The page on readings: its table is generated, and every setting in it does what it says it can."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest

from reference.sessions import synthetic
from tega.config import check_tree, load_config
from tega.loop import run_session
from tega.recording.mcap_reader import McapReader
from tega.recording.replay import replay_file
from tega.stages import list_stages
from tega.ui.cli.main import main
from tega_figures.places import PLACES, OpenPlace, places_table

PROJECT = Path(__file__).resolve().parents[2]
PAGE = PROJECT / "docs" / "readings.md"

# A press within the first half second, and muscles that work.
SHORT = synthetic(0.3, "thumb", more="stop_free_mib = 0.0\n")
CHOICES = [(place, item) for place in PLACES for item in place.sets]


@pytest.mark.words
@pytest.mark.skipif(not PAGE.is_file(), reason="not a checkout")
def test_the_table_is_the_generated_one() -> None:
    assert places_table() in PAGE.read_text("utf-8"), "python -m tega_figures.places docs/readings.md"


def check_value(values: Any, item: str) -> None:
    key, _, message = item.partition("=")
    value = values[key].value
    plain = message.replace("[", "(").replace("]", ")").lower()
    assert str(value).lower().replace("'", '"') == plain or float(message) == value


@pytest.mark.parametrize(("place", "item"), CHOICES, ids=lambda one: getattr(one, "number", one))
def test_a_setting_of_the_table_is_taken_and_told(place: OpenPlace, item: str) -> None:
    from tega_sim.plan import loop_settings

    loaded = load_config(None, environ={}, sets=[*place.needs, item])
    check_value(loaded.values, item)
    assert loaded.values[item.partition("=")[0]].origin == "--set"
    if "everywhere" in next(row for row in places_table().splitlines() if place.what in row):
        assert loop_settings("live", [*place.needs, item]).stages == loaded.config.stages


# One of each group at every turn; the others, a minute and more of them, by make slow.
OFTEN = ("front=trend_mm_s", "before=band", "pose_base=0", "threshold=D7", "fusion=median", "layout=x16")
RUN_WITH = [
    pytest.param(*choice, marks=[] if choice[1].endswith(OFTEN) else pytest.mark.slow)
    for choice in CHOICES
    if not choice[1].startswith("emg.")
]


@pytest.mark.slow
@pytest.mark.parametrize(("place", "item"), RUN_WITH, ids=lambda one: getattr(one, "number", one))
def test_a_setting_of_the_table_is_run_recorded_and_replayed(place, item, tmp_path):
    (tmp_path / "lab.toml").write_text(SHORT)
    sets = [*place.needs, item]
    config = load_config(tmp_path / "lab.toml", environ={}, sets=sets).config
    file = tmp_path / "recorded" / run_session(config)["recording"]["file"]
    reader = McapReader(file)
    assert list(reader.messages())
    recorded = check_tree(tomllib.loads(reader.files["session.toml"].decode()), {}, base=tmp_path).values
    for reported in sets:
        check_value(recorded, reported)
    assert replay_file(file).same
    # The same recording through the other choice: named as changed, or the same where it makes no difference.
    again = replay_file(file, sets=[reported for reported in sets if reported.startswith("stages.")])
    assert again.changed == []


@pytest.mark.words
def test_every_option_of_a_shipped_stage_is_in_the_table_or_no_reading() -> None:
    named = {
        item.partition("=")[0].rpartition(".")[2] for place in PLACES for item in (*place.needs, *place.sets)
    }
    no_reading = {"mm_per_px", "contact", "release", "slip", "duration_s", "gap_s"}
    shipped = {
        (stage.name, option.name)
        for stage in list_stages()
        if stage.name in {"paper", "live", "reading", "rules", "columns", "pulses"}
        for option in stage.options
    }
    assert {(stage, option) for stage, option in shipped if option not in named | no_reading} == set()


LAB = "[stages.metric]\nname = 'reading'\n[stages.metric.options]\nfactr = 1.0\n"
VERBS = [
    ("config show FILE", "FILE"), ("config check FILE", "FILE"), ("run FILE", "FILE"),
    ("demo --config FILE --fast", "FILE"), ("sim trials --config FILE", "FILE"),
    ("study simulate --operators 1 --out OUT --config FILE", "FILE"),
    ("replay --emg EMG --emg-rate-hz 250 --emg-kind raw --out OUT", "set"), ("demo --fast --out OUT", "set"),
    ("sim trials --seeds 1", "set"), ("study simulate --operators 1 --out OUT", "set"),
    ("study run STUDY p01 --simulated", "set"), ("study run STUDY p01 --simulated --config FILE", "FILE"),
    ("audit PICTURES", "set"),
]  # fmt: skip
# Its settings are those of emulated devices, which are started first.
EMULATED = pytest.param("study run STUDY p01 --emulated", "set", marks=pytest.mark.slow)


@pytest.mark.parametrize(("words", "how"), [*VERBS, EMULATED], ids=lambda value: value.partition(" -")[0])
def test_every_verb_refuses_an_unknown_option_with_its_place_and_the_nearest_name(
    words: str, how: str, tmp_path: Path, capsys: Any
) -> None:
    import numpy as np

    from tega_study.plan import make_plan, write_plan

    if "study" in words or "demo" in words or "sim" in words:
        pytest.importorskip("mujoco", reason="needs the extra tega[sim]")
    (tmp_path / "lab.toml").write_text(LAB)
    np.save(tmp_path / "squeeze.npy", np.random.default_rng(1).standard_normal((500, 3)))
    plan = make_plan(
        participants=1, objects=["bottle"], conditions=("haptic", "non-haptic"), trials=1, simulated=True
    )
    write_plan(plan, tmp_path / "study", {})
    cv2 = pytest.importorskip("cv2", reason="needs the extra tega[lab]")
    (tmp_path / "pictures").mkdir()
    for number in range(3):
        cv2.imwrite(str(tmp_path / "pictures" / f"{number}.png"), np.full((60, 80, 3), 90, np.uint8))
    paths = {"FILE": "lab.toml", "OUT": "out", "EMG": "squeeze.npy", "STUDY": "study", "PICTURES": "pictures"}
    args = [str(tmp_path / paths[word]) if word in paths else word for word in words.split()]
    if how == "set":
        args += ["--set", "stages.metric.name=reading", "--set", "stages.metric.options.factr=1"]
    with pytest.raises(SystemExit) as done:
        main(args)
    message = capsys.readouterr().err
    assert done.value.code == 1, message
    assert "stages.metric.options.factr: unknown key" in message
    assert ("lab.toml:4" if how == "FILE" else "--set") in message
    assert "did you mean 'factor'" in message


def test_options_of_stages_beside_show_their_own_lines(tmp_path: Path, capsys: Any) -> None:
    file = tmp_path / "lab.toml"
    file.write_text(
        "[[stages.beside]]\ngroup = 'metric'\nname = 'live'\n[[stages.beside]]\ngroup = 'decoder'\nname = 'rules'\n"
        "options = { fusion = 'median' }\n"
    )
    values = load_config(file, environ={}).values
    assert values["stages.beside[0].name"] == ("live", "lab.toml:3")
    assert values["stages.beside[1].options.fusion"] == ("median", "lab.toml:7")
    assert values["stages.beside[1].options.tau_s"] == (0.1, "default")
    with pytest.raises(SystemExit):
        main(["config", "show", str(file)])
    assert "stages.beside[1].options.fusion" in capsys.readouterr().out
    given = 'stages.beside=[{ group = "decoder", name = "rules", options = { order = 2 } }]'
    values = load_config(None, environ={}, sets=[given]).values
    assert values["stages.beside[0].options.order"] == (2, "--set")
