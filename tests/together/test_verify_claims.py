"""What verify and replay claim to have computed again agrees with what they did; stages chosen in a replay."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from reference.command import call
from reference.sessions import record, stream, synthetic, tree
from tega.config import check_tree, load_config
from tega.errors import RecordingError
from tega.loop import run_session
from tega.loop.inbox.frames import FrameMeter
from tega.recording.replay import Replay, replay_file
from tega.recording.replay.feed import RecordFeed
from tega.recording.trim import trim_session
from tega.stages.metrics import LiveMetric

CONTACTS = "/tactile/thumb/contact"
CLAIM = "re-run from the raw pictures and samples"


@pytest.fixture(autouse=True)
def _once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have each test compute a recording once, however often it asks for words or numbers about it."""
    known = cache(replay_file)

    def replay(path: Path, *, config: Path | None = None, sets: Sequence[str] = (), **_how: Any) -> Replay:
        return known(path, config=config, sets=tuple(sets))

    monkeypatch.setattr("tega.recording.replay.replay_file", replay)


@pytest.fixture(scope="module")
def part(lossless: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return trim_session(lossless, from_s=0.5, to_s=1.2, out=tmp_path_factory.mktemp("part") / "part")


def kept(capsys: pytest.CaptureFixture[str], path: Path) -> dict[str, str]:
    """Return the streams that were taken as recorded, each with the reason, as ``--json`` has them."""
    (found,) = json.loads(call(capsys, "verify", path, "--json")[0])
    assert found["same"]
    return {one["stream"]: one["as_recorded"] for one in found["streams"] if one["as_recorded"]}


def row(text: str, name: str) -> list[str]:
    return next(line.split() for line in text.splitlines() if line.split()[:1] == [name])


def test_a_whole_recording_is_measured_in_its_pictures(lossless, capsys):
    assert kept(capsys, lossless) == {}
    text = call(capsys, "verify", lossless)[0]
    assert CLAIM in text
    assert row(text, CONTACTS)[1:] == ["90", "90", "0"]
    assert "  identical, bit for bit\n" in text


def test_a_part_that_a_metric_with_memory_measured_keeps_its_contacts_and_says_why(part, capsys):
    reasons = kept(capsys, part)
    assert reasons.keys() == {CONTACTS, "/tactile/ring/contact"}
    why = "the metric live remembers earlier pictures, and those before 0.5 s were trimmed off"
    assert set(reasons.values()) == {why}
    text = call(capsys, "verify", part)[0]
    assert "re-run from the contacts as recorded and the raw samples" in text
    assert row(text, CONTACTS)[2:] == ["as", "recorded", "-"]
    assert row(text, "/emg/levels")[3] == "0"
    assert "  what was computed is identical, bit for bit\n" in text
    assert f"Contacts are those recorded: {why}." in text
    assert CLAIM not in text


def test_a_part_that_a_metric_without_memory_measured_is_measured_again(tmp_path, capsys, monkeypatch):
    whole = record(tmp_path / "whole", duration_s=0.7, preset="paper")  # its metric has no memory
    part = trim_session(whole, from_s=0.2, to_s=0.6, out=tmp_path / "part")
    assert kept(capsys, part) == {}
    assert CLAIM in call(capsys, "verify", part)[0]
    broken(monkeypatch)
    assert stream(replay_file(part), CONTACTS).fields.keys() == {"peak"}


def broken(monkeypatch: pytest.MonkeyPatch) -> None:
    take = FrameMeter.take

    def one_more(meter: FrameMeter, frame: Any) -> Any:
        contact = take(meter, frame)
        return None if contact is None else replace(contact, peak=contact.peak + 1)

    monkeypatch.setattr(FrameMeter, "take", one_more)


def test_a_changed_field_of_contacts_that_are_kept_is_counted_in_the_json(part, monkeypatch):
    broken(monkeypatch)
    replay = replay_file(part)
    assert replay.same
    assert [one.fields["peak"] for one in replay.pictures] == [one.compared for one in replay.pictures]
    assert all(one.compared for one in replay.pictures)


def test_contacts_of_compressed_pictures_are_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = record(tmp_path / "jpeg", duration_s=0.6, lossless=False)
    why = "the pictures were compressed (JPEG)"
    assert set(kept(capsys, path).values()) == {why}
    assert all(one.compared and one.fields == {} for one in replay_file(path).pictures)


def test_a_cut_recording_of_unknown_types_alone_is_not_called_identical(short, tmp_path, monkeypatch):
    (path := tmp_path / "cut.mcap").write_bytes(short.read_bytes()[:-40])
    monkeypatch.setattr("tega.recording.replay.feed._kind_of", lambda _schema, _topic: (None, {}))
    with pytest.raises(RecordingError, match="nothing that is computed again"):
        replay_file(path)


def test_contacts_of_another_version_of_the_metric_are_kept(lossless, capsys, monkeypatch):
    monkeypatch.setattr(LiveMetric, "version", LiveMetric.version + 1)
    (why,) = set(kept(capsys, lossless).values())
    n = LiveMetric.version
    assert why == f"another version measured them (live {n - 1} -> live {n})"
    assert CLAIM not in call(capsys, "verify", lossless)[0]


def test_muscles_alone_are_not_said_to_have_pictures(tmp_path, capsys):
    session = tree(tmp_path / "session", lossless=False)
    del session["tactile"]
    run_session(check_tree(session, {}, base=tmp_path).config)
    text = call(capsys, "verify", tmp_path / "session")[0]
    assert "re-run from the raw samples\n" in text
    assert "Contacts" not in text


def test_levels_that_came_as_levels_are_kept(lossless: Path) -> None:
    from tega.recording.replay.head import levels_kept

    head = RecordFeed(lossless).head
    assert levels_kept(head) == ""
    far = head.sources["emg"]
    assert "another program" in levels_kept(replace(head, sources={"emg": replace(far, unit="level")}))


def test_a_tick_after_the_end_of_a_part_is_not_counted(lossless: Path, tmp_path: Path) -> None:
    for until_ms in (700, 710, 720):
        part = trim_session(lossless, from_s=0.3, to_s=until_ms / 1000, out=tmp_path / str(until_ms))
        replay = replay_file(part)
        assert replay.same
        assert {s.stream: s.replayed - s.recorded for s in replay.streams if s.replayed != s.recorded} == {}


BESIDE = """
[[stages.beside]]
group = "metric"
name = "live"
options = { outline = "contact" }
[[stages.beside]]
group = "decoder"
name = "rules"
options = { fusion = "median" }
"""
TOPICS = {"/beside/live/index", "/beside/rules/emg"}


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("session")
    (folder / "lab.toml").write_text(synthetic(4.0, "index", more=BESIDE))
    summary = run_session(load_config(folder / "lab.toml", environ={}).config)
    return folder / "recorded" / str(summary["recording"]["file"])


def replayed(*words: object, capsys: Any, code: int = 0) -> Any:
    return json.loads(call(capsys, "verify", *words, "--json", code=code)[0])


def test_a_stage_beside_that_says_something_else_is_found(recording: Path, capsys: Any) -> None:
    decoder = '{group="decoder",name="rules",options={intervals=5}}'
    other = f'stages.beside=[{{group="metric",name="live"}},{decoder}]'
    (replay,) = replayed(recording, "--set", other, capsys=capsys, code=1)
    differ = {stream["stream"] for stream in replay["streams"] if stream["differ"]}
    assert differ == TOPICS


def test_a_session_is_replayed_through_another_stage(recording: Path, capsys: Any) -> None:
    sets = (
        "stages.metric.name=reading",
        "stages.metric.options.threshold=D8",
        "stages.mapping.options.law=logistic",
    )
    words = [word for item in sets for word in ("--set", item)]
    (replay,) = replayed(recording, *words, capsys=capsys, code=1)
    changed = replay["changed"]
    assert any("stages.metric: live" in text and "reading (threshold D8" in text for text in changed)
    assert any("law logistic" in text for text in replay["changed"])
    assert next(s for s in replay["streams"] if s["stream"] == "/tactile/index/contact")["differ"] > 0
    assert next(s for s in replay["streams"] if s["stream"] == "/emg/levels")["differ"] == 0
    wrong = "--set", "stages.metric.options.outlin=dent"
    assert "did you mean 'outline'" in call(capsys, "verify", recording, *wrong, code=1)[1]


def test_loose_files_are_replayed_through_a_stage(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("tega.ui.view.course.SessionPicture.write", lambda *_given, **_more: None)
    samples = np.random.default_rng(1).standard_normal((1000, 3)) * np.repeat([0.1, 1.0], 500)[:, None]
    np.save(tmp_path / "squeeze.npy", samples)
    words = ["--emg-rate-hz", "250", "--emg-kind", "raw", "--preset", "paper"]
    words += ["--emg", str(tmp_path / "squeeze.npy")]
    levels = []
    for name, sets in (("a", ()), ("b", ("--set", "stages.decoder.options.tau_s=0.2"))):
        call(capsys, "replay", *words, *sets, "--out", tmp_path / name, "--json")
        levels.append((tmp_path / name / "levels.csv").read_text().splitlines())
    assert len(levels[0]) - 1 == 2 * (len(levels[1]) - 1)


MAPPINGS = ("slip-row", "equal-steps", "changes", "place")


@pytest.mark.slow
@pytest.mark.parametrize("mapping", MAPPINGS)
def test_a_session_with_a_mapping_of_felt_steps_changes_or_places_is_replayed(mapping, tmp_path, capsys):
    plain = synthetic(4.0, "index")
    (tmp_path / "lab.toml").write_text(
        f"{plain}[vest]\nthreshold = 24.0\nstep = 7.0\n[stages.mapping]\nname = '{mapping}'\n"
    )
    summary = run_session(load_config(tmp_path / "lab.toml", environ={}).config)
    file = tmp_path / "recorded" / str(summary["recording"]["file"])
    (replay,) = replayed(file, capsys=capsys)
    vest = next(stream for stream in replay["streams"] if stream["stream"] == "/vest/frame")
    assert (vest["recorded"] > 100, vest["differ"]) == (True, 0)
    # Through the columns it differs: what is compared above was the mapping's own.
    (other,) = replayed(file, "--set", "stages.mapping.name=columns", capsys=capsys, code=1)
    differ = {stream["stream"] for stream in other["streams"] if stream["differ"]}
    assert "/vest/frame" in differ


EXAMPLE = Path(__file__).resolve().parents[2] / "examples/recorded-lift"


@pytest.mark.skipif(not EXAMPLE.is_dir(), reason="not a checkout")
def test_the_example_is_looked_into_and_computed_again(capsys, tmp_path):
    (trial,) = json.loads(call(capsys, "inspect", EXAMPLE, "--json")[0])
    topics = {stream["topic"] for stream in trial["streams"]}
    fingers = ("thumb", "index", "middle", "ring")
    assert {"/emg/samples", "/vest/frame", *(f"/tactile/{finger}/image" for finger in fingers)} <= topics
    (again,) = replayed(EXAMPLE, capsys=capsys)
    assert again["same"]
    assert {s["stream"] for s in again["streams"]} >= {"/vest/frame", "/hand/frames", "/touch/event"}
    assert all(s["recorded"] == s["replayed"] for s in again["streams"])
    call(capsys, "export", EXAMPLE, "--out", tmp_path / "tables")
    rows = next((tmp_path / "tables").rglob("vest.frame.csv")).read_text().splitlines()
    assert len(rows) > 100
