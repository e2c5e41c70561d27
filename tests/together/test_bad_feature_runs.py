"""A run with a feature of another package that goes wrong: the feature is named, and the run goes on or stops."""

from __future__ import annotations

import json
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from reference import bad_features
from reference.bad_features import RECORDS, Install, checked
from tega.errors import FeatureError, TegaError
from tega.loop import run_session
from tega.records import Marker, types
from tega.records.bus import Bus
from tega.runtime.features import Feature, broken_features, features, load_target

install = bad_features.install


def run(folder: Path, **members: Any) -> tuple[dict[str, Any], dict[str, int]]:
    """Run two seconds of synthetic touch; return the summary, and the recorded messages by topic."""
    from tega.recording.mcap_reader import McapReader

    tree = {
        "session": {"pace": "fast", "duration_s": 2.0},
        "tactile": {"thumb": {"driver": "synthetic-touch"}, "index": {"driver": "synthetic-touch"}},
        "recording": {"dir": str(folder / "recorded"), "stop_free_mib": 0.0},
        **members,
    }
    summary = run_session(checked(tree))
    counts: dict[str, int] = {}
    for message in McapReader(folder / "recorded" / summary["recording"]["file"]).messages():
        counts[message.topic] = counts.get(message.topic, 0) + 1
    assert summary["recording"]["state"] == "complete"
    assert summary["recording"]["duration_s"] >= 1.9
    assert counts["/tactile/thumb/contact"] > 10
    json.dumps(summary)
    return summary, counts


PUBLISHES = """
def begin(self, run):
    self.bus.subscribe(Contact, self.publish, name="load")
def publish(self, contact):
    self.bus.publish({record})
LoadPart.begin, LoadPart.publish = begin, publish
"""
PART = "part='tega_load.members:open_part', " + RECORDS


@pytest.mark.slow
@pytest.mark.parametrize(
    ("published", "named"),
    [
        ("Extra(t_ns=contact.t_ns)", "Extra is not in the records of the feature 'load'"),
        ("Marker(t_ns=contact.t_ns, text=3, source='load')", ""),
    ],
)
def test_a_record_that_cannot_be_recorded_costs_itself_only(install, tmp_path, caplog, published, named):
    pytest.importorskip("foxglove", reason="needs the extra tega[record]")
    install(PART, PUBLISHES.format(record=published))
    summary, counts = run(tmp_path)
    assert not any(topic.startswith("/load") for topic in counts)
    if named:
        assert named in caplog.text
        assert any(named in text for text in summary["safety"]["alerts"])
        assert any(named in text for text in summary["notes"])
    else:
        assert f"{Marker.topic} could not be written: TypeError" in caplog.text
        assert summary["recording"]["dropped"][Marker.topic] > 10


@pytest.mark.slow
@pytest.mark.parametrize("hook", ["end", "ended", "summary", "notes", "finish", "displayed"])
@pytest.mark.parametrize("does", ["raises", "rubbish"])
def test_a_part_that_fails_at_the_end_costs_itself_only(install, tmp_path, hook, does):
    pytest.importorskip("foxglove", reason="needs the extra tega[record]")
    body = {
        "raises": "raise ValueError('boom')",
        "rubbish": "[d.update(odd={1}) for d in given]; return 'odd'",
    }
    body["rubbish"] = body["rubbish"] if hook == "finish" else "return 'odd'"
    install(PART, f"def hook(self, *given): {body[does]}\nLoadPart.{hook} = hook")
    if hook == "displayed":
        from tega.loop.snapshot import Snapshot

        bus = Bus()
        bus.subscribe(Snapshot, lambda _snapshot: None, name="test")
        tree = {
            "session": {"pace": "fast", "duration_s": 1.0},
            "tactile": {"thumb": {"driver": "synthetic-touch"}},
        }
        summary = run_session(checked(tree), bus=bus)
    else:
        summary, _ = run(tmp_path)
    assert "odd" not in summary
    named = [note for note in summary["notes"] if "feature 'load'" in note]
    expected = 0 if does == "rubbish" and hook in {"end", "ended"} else 1  # what they return is nobody's
    assert len(named) == expected
    assert all(f"{hook}()" in note for note in named)


def test_a_part_does_not_replace_what_the_summary_has(install: Install) -> None:
    install(PART, "LoadPart.summary = lambda self: {'vest': 'odd', 'load': 1}")
    tactile = {"thumb": {"driver": "synthetic-touch"}}
    summary = run_session(checked({"session": {"pace": "fast", "duration_s": 0.2}, "tactile": tactile}))
    assert (summary["vest"]["layout"], summary["load"]) == ("x40", 1)
    assert "a part's 'vest' is left out: the summary has it" in summary["notes"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("body", "named"),
    [
        ("1 / 0", "feature 'load': alerts: 'load': ZeroDivisionError: division by zero"),
        ("None", "feature 'load': alerts: 'load' returned None, not str"),
    ],
)
def test_an_alert_that_fails_stops_the_run_with_the_feature_s_name(install, tmp_path, body, named):
    install(PART, f"LoadPart.alerts = lambda self: {{'load': lambda: {body}}}")
    with pytest.raises(FeatureError) as stopped:
        run(tmp_path)
    assert stopped.value.message == named
    assert "to go on without it, pip uninstall tega-load" in stopped.value.hint
    assert not list((tmp_path / "recorded").glob("*.part"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("code", "named"),
    [
        ("open_parts = 'text'", "is 'text', not a function or class"),
        (
            "def open_parts(context): raise ValueError('boom')",
            "part tega_load.members:open_parts: ValueError: boom",
        ),
        ("LoadPart.alerts = lambda self: 'text'", "alerts() returned 'text', not Mapping"),
        ("LoadPart.prepared = lambda self, prepared: None", "prepared() returned None, not Prepared"),
        ("class LoadPart:\n    pass", "open_part returned <tega_load.members.LoadPart"),
    ],
)
def test_a_part_of_the_wrong_kind_is_named(install: Install, tmp_path: Path, code: str, named: str) -> None:
    target = "open_parts" if "open_parts" in code else "open_part"
    install(f"part='tega_load.members:{target}'", code)
    with pytest.raises(TegaError, match="feature 'load'") as refused:
        run(tmp_path)
    assert named in refused.value.message


def test_a_good_feature_is_loaded(install: Install) -> None:
    install(PART + ", settings={'load': 'tega_load.members:Table'}, verbs={'emg load': Verb('m:f', 's')}")
    types.record_types()
    assert not broken_features()
    assert features()["load"].package == "tega-load"
    assert import_module("tega_load.members").Load in types.record_types()
    assert isinstance(load_target("tega_load.members:open_part", Feature(summary="")), object)
