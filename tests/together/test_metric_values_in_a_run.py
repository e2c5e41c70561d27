"""Values of another package's metric in a whole run: what the reflex does by them, and every file that holds them."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from reference.installed import distribution
from reference.sessions import read_recorded
from tega.config import check_tree
from tega.loop import run_session
from tega.recording.replay import replay_file
from tega.records import Contact, ReflexGrip
from tega.records.bus import Bus

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
