"""Fingers and values of any name in a run: of its settings and of another package's metric, in every file."""

from __future__ import annotations

import csv
import json
import tomllib
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference.installed import distribution
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
from tega.records import Contact, Event, Picture, ReflexGrip
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


pytest.importorskip("foxglove", reason="needs the extra tega[record]")

METRIC = """
import msgspec
from tega.stages import Contact, Metric, NamedValue, StageOptions
from tega.tactile import read_contact

class WeighingOptions(StageOptions, frozen=True):
    force_n: float = 0.0
    named: bool = False

class Weighing(Metric):
    summary = "a contact that slips under a known force"
    options_type = WeighingOptions

    def __init__(self, setup, options):
        self._setup, self._options = setup, options

    @classmethod
    def units(cls, options):
        return {"incipient": "1"} | ({"force_n": "N"} if options.named else {})

    def update(self, frame, t_ns):
        o = self._options
        seen = read_contact(frame, self._setup.baseline, reading="paper")
        force_n = o.force_n if seen.in_contact else 0.0
        more = (NamedValue("incipient", float(seen.in_contact)),)
        if o.named:
            more = (*more, NamedValue("force_n", force_n, "N"))
        given = seen._asdict() | {"more": more, "force_n": None if o.named else force_n}
        return Contact(
            finger=self._setup.finger, t_ns=t_ns, area_mm2=12.5, depth_mm=0.5, strength=0.25, broad=0.75, **given
        )
"""


@pytest.fixture(scope="module", autouse=True)
def _weighing(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    entries = "[tega.metrics]\nweighing = tega_test_weighing:Weighing\n"
    site = distribution(tmp_path_factory.mktemp("site"), "tega_test_weighing", entries)
    (site / "tega_test_weighing.py").write_text(METRIC)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(site)
        yield


class Ran(NamedTuple):
    grips: list[ReflexGrip]
    contacts: list[Contact]
    file: Path


def run(folder: Path, **metric: Any) -> Ran:
    bus, grips, contacts = Bus(), list[ReflexGrip](), list[Contact]()
    bus.subscribe(ReflexGrip, grips.append, vital=True)
    bus.subscribe(Contact, contacts.append, vital=True)
    tree = {
        "session": {"preset": "paper", "pace": "fast", "out_dir": str(folder / "out")},
        "tactile": {"thumb": {"driver": "synthetic-touch", "options": {"duration_s": 2.0}}},
        "emg": {"driver": "synthetic-emg", "kind": "raw", "options": {"duration_s": 2.0}},
        "stages": {
            "metric": {"name": "weighing", "options": metric},
            "reflex": {"name": "grip", "authority": 1.0, "options": {"most_force_n": 5.0}},
        },
        "recording": {"dir": str(folder / "recorded"), "lossless": True, "stop_free_mib": 0.0},
    }
    summary = run_session(check_tree(tree, {}, base=folder).config, bus=bus)
    return Ran(grips, contacts, folder / "recorded" / summary["recording"]["file"])


@pytest.fixture(scope="module")
def heavy(tmp_path_factory: pytest.TempPathFactory) -> Ran:
    return run(tmp_path_factory.mktemp("heavy"), force_n=9.0)


def test_a_force_over_the_limit_of_the_reflex_eases_the_grip_of_a_run(heavy: Ran, tmp_path: Path) -> None:
    light = run(tmp_path, force_n=1.0)
    assert max(one.wish for one in light.grips) == 1.0
    assert max(one.added for one in light.grips) > 0
    assert min(one.wish for one in heavy.grips) == -1.0
    assert not any(one.added for one in heavy.grips)
    assert {one.cause for one in heavy.grips if one.wish < 0} == {"eased: a finger is loaded"}


def test_a_force_that_a_metric_gives_by_name_is_the_contact_s_force(tmp_path: Path) -> None:
    named = run(tmp_path, force_n=9.0, named=True)
    assert {one.force_n for one in named.contacts if one.in_contact} == {9.0}
    assert {one.name for contact in named.contacts for one in contact.more} == {"incipient"}
    assert min(one.wish for one in named.grips) == -1.0
    assert replay_file(named.file).same


def test_every_file_of_a_run_holds_the_values_that_its_metric_gave(heavy: Ran) -> None:
    touched = [one for one in heavy.contacts if one.in_contact]
    assert len(touched) > 20
    assert {(one.area_mm2, one.depth_mm, one.force_n, one.strength, one.broad) for one in touched} == {
        (12.5, 0.5, 9.0, 0.25, 0.75)
    }
    assert repr(read_recorded(heavy.file).contacts["thumb"]) == repr(heavy.contacts)
    assert replay_file(heavy.file).same
    with (heavy.file.parents[1] / "out" / "contacts.csv").open(encoding="utf-8") as file:
        table = list(csv.DictReader(file))
    assert [float(row["force_n"]) for row in table] == [one.force_n for one in heavy.contacts]
