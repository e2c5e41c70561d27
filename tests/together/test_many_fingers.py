"""A session's fingers are those of its settings: two hands and palms are run, recorded, verified and exported."""

from __future__ import annotations

import csv
import json
import tomllib
from itertools import chain
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference.played import finger
from reference.sessions import read_recorded
from reference.sessions import tree as sessions_tree
from tega.config import FINGERS, SessionConfig, check_tree
from tega.config.attached import config_text
from tega.config.calibration import TouchMaxima
from tega.config.calibration.store import Calibration, calibration_text, parse_calibration
from tega.errors import CalibrationError, ConfigError
from tega.haptics.motor_layout import find_layout
from tega.loop import run_session
from tega.loop.snapshot import Snapshot
from tega.recording.export import export_file
from tega.recording.replay import replay_file
from tega.records import Contact, Event, Picture
from tega.records.bus import Bus
from tega.safety.guard import Guard, Watched
from tega.stages.base import VestSetup
from tega.stages.pulses import PulsesMapping, PulsesOptions

SECONDS = 0.5
PARTS = (*FINGERS, "little", "palm", "palm_edge", "palm_heel")
names = st.from_regex(r"[a-z][a-z0-9]{0,8}(_[a-z0-9]{1,8}){0,2}", fullmatch=True).filter(
    lambda name: name not in {*SessionConfig.__struct_fields__, "forearm"}
)


# Left and right of one kind share a column, further kinds the next ones.
COLUMNS = [[f"{side}_{part}" for part in PARTS[k::4] for side in ("left", "right")] for k in range(4)]
NAMES = sorted(chain(*COLUMNS))


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fingers")
    touch = {name: finger(SECONDS, seed, (40, 32)) for seed, name in enumerate(NAMES)}
    stages = {"mapping": {"options": {"fingers": COLUMNS}}}
    settings = sessions_tree(folder) | {"tactile": touch, "stages": stages}
    bus, views = Bus(), list[Snapshot]()
    bus.subscribe(Snapshot, views.append, name="test")
    summary = run_session(check_tree(settings, {}, base=folder).config, bus=bus)
    assert list(summary["tactile"]) == list(views[-1].view.fingers) == NAMES
    return folder / str(summary["recording"]["file"])


def test_every_finger_is_recorded_computed_again_bit_for_bit_and_exported(recorded, tmp_path):
    contacts = read_recorded(recorded, Contact, Picture).contacts
    assert sorted(contacts) == NAMES
    assert all(any(contact.front > 0 for contact in rows) for rows in contacts.values())
    replay = replay_file(recorded)
    assert replay.complete
    rows = {stream.stream: (stream.recorded, stream.differ) for stream in replay.streams}
    assert {f"/tactile/{name}/{what}" for name in NAMES for what in ("image", "contact")} <= set(rows)
    assert all(recorded and not differ for recorded, differ in rows.values())
    export_file(recorded, tmp_path / "out")
    for name in NAMES:
        with (tmp_path / "out" / f"tactile.{name}.contact.csv").open(newline="") as file:
            assert len(list(csv.DictReader(file))) == round(SECONDS * 60)


def test_every_finger_is_a_camera_of_a_lerobot_dataset(recorded: Path, tmp_path: Path) -> None:
    pytest.importorskip("av", reason="needs the extra tega[lerobot]")
    pytest.importorskip("pyarrow.parquet", reason="needs the extra tega[lerobot]")
    from tega_lerobot.dataset import export_lerobot

    dataset = export_lerobot([recorded], tmp_path / "dataset", fps=30)
    features = json.loads((dataset / "meta" / "info.json").read_text())["features"]
    cameras = {name.removeprefix("observation.images.") for name in features if ".images." in name}
    assert cameras == set(NAMES)


@given(st.lists(names, min_size=1, max_size=6, unique=True))
def test_any_names_are_kept_by_settings_and_calibration(fingers: list[str]) -> None:
    stages = {"mapping": {"options": {"fingers": [fingers]}}}
    tactile = {name: {"driver": "synthetic-touch", "options": {"seed": k}} for k, name in enumerate(fingers)}
    settings = {"tactile": tactile, "stages": stages}
    loaded = check_tree(settings, {}, base=Path.cwd())
    assert set(loaded.config.tactile) == set(fingers)
    again = check_tree(tomllib.loads(config_text(loaded.config)), {}, base=Path.cwd())
    assert again.config == loaded.config
    assert all(loaded.values[f"tactile.{name}.options.seed"].value == k for k, name in enumerate(fingers))
    maxima = {name: TouchMaxima(cci_max=1.0 + k) for k, name in enumerate(fingers)}
    calibration = Calibration(preset="live", origin="a test", tactile=maxima)
    assert parse_calibration(calibration_text(calibration), "c.toml") == calibration


@pytest.mark.parametrize("name", ["Thumb", "1st", "left-thumb", "left__thumb", "palm_", "a/b", "", "x" * 33])
def test_a_name_that_no_topic_or_file_can_have_is_refused(name: str) -> None:
    with pytest.raises(ConfigError, match="is no name here") as refused:
        check_tree({"tactile": {name: {"driver": "synthetic-touch"}}}, {}, base=Path.cwd())
    assert "lowercase letters" in refused.value.hint
    text = f'format = "tega-calibration"\npreset = "live"\norigin = ""\n[tactile.{json.dumps(name)}]\n'
    with pytest.raises(CalibrationError, match="is no name here"):
        parse_calibration(text, "c.toml")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, r"the palm is in no column of the vest.*alone or in a list; columns have: thumb"),
        ({"fingers": [["thumb", "palm"], "palm"]}, "a finger is named twice"),
        ({"fingers": []}, "length >= 1"),
    ],
)
def test_a_finger_has_one_column(options: dict[str, Any], message: str) -> None:
    touch, stages = {"palm": {"driver": "synthetic-touch"}}, {"mapping": {"options": options}}
    with pytest.raises(ConfigError, match=message):
        check_tree({"tactile": touch, "stages": stages}, {}, base=Path.cwd())


def test_an_event_of_any_finger_of_a_column_pulses_there() -> None:
    columns = (("left_thumb", "right_thumb"), ("left_palm", "right_palm"))
    fingers = tuple(chain(*columns))
    setup = VestSetup(find_layout("x40"), fingers, {}, None)
    for place, name in enumerate(fingers):
        mapping = PulsesMapping(setup, PulsesOptions(fingers=columns))
        contact = Contact(finger=name, t_ns=0, in_contact=True)
        levels = mapping.levels(0, {name: contact}, [Event(t_ns=0, finger=name, kind="contact")])
        assert levels.reshape(2, 5, 4).max(axis=(0, 1)).tolist() == [70 * (place // 2 == k) for k in range(4)]


def test_a_finger_has_no_name_of_a_device_or_alert() -> None:
    for name in ("emg", "vest", "forearm"):
        with pytest.raises(ConfigError, match=rf"tactile\.{name}: something else in a run has that name"):
            check_tree({"tactile": {name: {"driver": "synthetic-touch"}}}, {}, base=Path.cwd())
    watched = Watched("clock", "tactile", 60.0, None)  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match="two things that are watched have the name 'clock'"):
        Guard(streams=[watched], alerts={"clock": str})
