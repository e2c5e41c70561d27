# mypy: allow-untyped-defs, allow-incomplete-defs, allow-untyped-calls, allow-untyped-decorators
"""A session travels as one file: whole, checked byte by byte, and the same study's folder where it is opened."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from reference.command import call
from reference.study_bench import RECORDING, files_of, led
from tega.errors import DeviceUnavailableError, InvalidValueError, RecordingError, TegaError
from tega.recording.export import export_file
from tega.recording.mcap_reader import McapReader
from tega.recording.remake import encode_session, merge_sessions
from tega.recording.trim import trim_session
from tega_study.bundle import MANIFEST, open_bundle, write_bundle
from tega_study.emg_bids.dataset import bids_names
from tega_study.journal import Journal, events_path
from tega_study.plan import make_plan, read_plan, write_plan
from tega_study.privacy import withdraw
from tega_study.trials import study_trials

BIDS_NAME = re.compile(
    r"sub-(?P<sub>[A-Za-z0-9]+)/ses-01/beh/sub-(?P=sub)_ses-01"
    r"(_task-[A-Za-z0-9]+(_acq-a[0-9]+)?_run-[0-9]{2,})?(_desc-[A-Za-z0-9]+)?_[A-Za-z0-9]+(\.[A-Za-z0-9]+)?"
)
# Name of a person's file; other files keep their path below sourcedata/, which BIDS leaves free.


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Return a study, and the bundle of one of its sessions."""
    folder = tmp_path_factory.mktemp("made") / "study"
    write_plan(make_plan(participants=3, seed=3, objects=["bag"], trials=2, simulated=True), folder)
    led(folder, "p01")
    led(folder, "p02")
    write_bundle(folder, "p01", folder.parent / "p01.zip")
    (folder / "sessions/p01/elsewhere.txt").unlink()
    return folder, folder.parent / "p01.zip"


@pytest.fixture
def study(whole: tuple[Path, Path], tmp_path: Path) -> Path:
    return Path(shutil.copytree(whole[0], tmp_path / "study"))


@pytest.fixture
def bundle(whole: tuple[Path, Path], tmp_path: Path) -> Path:
    return Path(shutil.copy(whole[1], tmp_path / "p01.zip"))


def test_what_is_opened_is_the_session_byte_by_byte_and_nobody_else_s(study: Path, tmp_path: Path) -> None:
    (study / "sessions/p01/now.json").write_text("{}")
    (study / "report").mkdir()
    (study / "report/p01.csv").write_text("of everybody")
    here = {name: content for name, content in files_of(study).items() if "p02" not in name}
    write_bundle(study, "p01", tmp_path / "p01.zip")
    opened = open_bundle(tmp_path / "p01.zip", tmp_path / "there")
    there = files_of(tmp_path / "there")
    assert there == {name: here[name] for name in here if "now.json" not in name and "report" not in name}
    assert {RECORDING, "sessions/p01/observers/r1.jsonl", "plan.csv"} < set(there)
    mine = [trial for trial in study_trials(study)[1] if trial.participant == "p01"]
    assert list(opened.trials) == mine == study_trials(tmp_path / "there")[1]
    assert opened.same
    assert opened.manifest.rehearsed
    assert read_plan(tmp_path / "there") == read_plan(study)
    assert sum(1 for _ in McapReader(tmp_path / "there" / RECORDING).messages()) > 100
    # Equal sessions give equal bytes, so two copies can be compared.
    write_bundle(study, "p01", tmp_path / "again.zip")
    assert (tmp_path / "again.zip").read_bytes() == (tmp_path / "p01.zip").read_bytes()


def test_every_file_of_two_people_has_a_name_of_its_own_as_bids_writes_them(study: Path) -> None:
    more = {
        "sessions/p01/observers/r-2.jsonl": "task r-2", "sessions/p01/observers/r2.jsonl": "the other",
        "courses/p01/p01-t02.csv": "course", "recordings/p01/p01-t02-a1/trial.json": "{}",
        "recordings/p01/p01-t02-a2/trial.json": "{}", "recordings/p01/p01-t02-a2/touch.csv": "",
        "recordings/p01/p01-t02-a2/README": "", "detected/p02.jsonl": "", "photos/bag.jpg": "",
    }  # fmt: skip
    for name, text in more.items():
        (study / name).parent.mkdir(parents=True, exist_ok=True)
        (study / name).write_text(text)
    paths = sorted(files_of(study))
    names = bids_names(paths, read_plan(study))
    assert sorted(names) == paths
    assert len({name.casefold() for name in names.values()}) == len(paths)
    for path, name in names.items():
        assert BIDS_NAME.fullmatch(name) or name == f"sourcedata/{path}"
        assert name.startswith("sourcedata/") == ("p01" not in path and "p02" not in path)
    wanted = {
        RECORDING: "task-bag_acq-a1_run-01_trial001.mcap",
        "courses/p01/p01-t02.csv": "task-bag_run-02_courses.csv",
        "recordings/p01/p01-t02-a2/trial.json": "task-bag_acq-a2_run-02_trial.json",
        "recordings/p01/p01-t02-a2/README": "task-bag_acq-a2_run-02_README",
    }
    for path, name in wanted.items():
        assert names[path] == f"sub-p01/ses-01/beh/sub-p01_ses-01_{name}"
    assert names["detected/p02.jsonl"] == "sub-p02/ses-01/beh/sub-p02_ses-01_detected.jsonl"


def test_a_bundle_with_bids_names_is_opened_as_the_same_folder(study: Path, tmp_path: Path) -> None:
    named = tmp_path / "p02.zip"
    write_bundle(study, "p02", named, bids=True)
    with zipfile.ZipFile(named) as packed:
        names = packed.namelist()
    assert all(BIDS_NAME.fullmatch(n) or n.startswith("sourcedata/") or n == MANIFEST for n in names)
    assert any("sub-p02_ses-01_task-bag_acq-a1_run-01_" in name for name in names)
    assert open_bundle(named, tmp_path / "there").same
    mine = {name: content for name, content in files_of(study).items() if "p01" not in name}
    assert files_of(tmp_path / "there") == {n: c for n, c in mine.items() if not n.endswith("elsewhere.txt")}


def aside(held: dict[str, bytes], manifest: dict[str, Any]) -> None:
    """Have a file stand under another name that lies outside."""
    manifest["files"][0]["name"] = "../outside.toml"
    held["../outside.toml"] = held.pop(manifest["files"][0]["path"])


def same_path(_held: dict[str, bytes], manifest: dict[str, Any]) -> None:
    """Have two entries be one file."""
    manifest["files"][0]["name"] = manifest["files"][0]["path"]
    manifest["files"][0]["path"] = manifest["files"][1]["path"]


def test_links_are_told_and_not_followed_and_a_withdrawal_tells_of_the_bundle(study, tmp_path):
    (tmp_path / "diary.txt").write_text("private")
    (study / "sessions/p01/diary.txt").symlink_to(tmp_path / "diary.txt")
    (study / "sessions/p01/a note.txt").write_text("a blank in its name")
    left_out = write_bundle(study, "p01", tmp_path / "p01.zip").left_out
    assert [path.name for path in left_out] == ["a note.txt", "diary.txt"]
    with zipfile.ZipFile(tmp_path / "p01.zip") as packed:
        assert not any("diary" in name or "note" in name for name in packed.namelist())
    assert tmp_path / "p01.zip" in withdraw(study, "p01").left
    with pytest.raises(RecordingError, match="p01 has withdrawn"):
        write_bundle(study, "p01", tmp_path / "late.zip")


def test_a_session_that_is_led_is_absent_or_has_no_place_is_refused(study: Path, tmp_path: Path) -> None:
    with Journal(events_path(study, "p01")), pytest.raises(DeviceUnavailableError, match="this session open"):
        write_bundle(study, "p01", tmp_path / "p01.zip")
    with pytest.raises(RecordingError, match="p03 has no session yet"):
        write_bundle(study, "p03", tmp_path / "p03.zip")
    with pytest.raises(InvalidValueError, match="'p09' is not in the plan"):
        write_bundle(study, "p09", tmp_path / "p09.zip")
    with pytest.raises(InvalidValueError, match="lies in the study's folder"):
        write_bundle(study, "p01", study / "p01.zip")
    (tmp_path / "p01.zip").write_text("mine")
    with pytest.raises(InvalidValueError, match="never overwritten"):
        write_bundle(study, "p01", tmp_path / "p01.zip")
    assert (tmp_path / "p01.zip").read_text() == "mine"


Change = Callable[[dict[str, bytes], dict[str, Any]], object]


def rewritten(bundle: Path, change: Change) -> Path:
    """Write a bundle as somebody else would who changes files and manifest; names are taken as they are."""
    with zipfile.ZipFile(bundle) as packed:
        held = {name: packed.read(name) for name in packed.namelist()}
    manifest = json.loads(held.pop(MANIFEST))
    change(held, manifest)
    out = bundle.with_name("foreign.zip")
    with zipfile.ZipFile(out, "w") as packed:
        for name, content in held.items():
            packed.writestr(zipfile.ZipInfo(name), content)
        packed.writestr(MANIFEST, json.dumps(manifest))
    return out


def renamed(name: str) -> Change:
    def change(held: dict[str, bytes], manifest: dict[str, Any]) -> None:
        held[name] = held.pop("sessions/p01/observers/r1.jsonl")
        for one in manifest["files"]:
            if one["path"].endswith("r1.jsonl"):
                one["path"] = name

    return change


def added(name: str, content: bytes = b"<script>") -> Change:
    """Add a file that the manifest lists like the others."""

    def change(held: dict[str, bytes], manifest: dict[str, Any]) -> None:
        held[name] = content
        sha256 = hashlib.sha256(content).hexdigest()
        manifest["files"].append({"path": name, "n_bytes": len(content), "sha256": sha256})

    return change


def changed(name: str, change: Callable[[bytes], bytes]) -> Change:
    return lambda held, _manifest: held.update({name: change(held[name])})


def twice(held: dict[str, bytes], manifest: dict[str, Any]) -> None:
    held["PLAN.csv"] = held["plan.csv"]
    manifest["files"].append({**manifest["files"][1], "path": "PLAN.csv"})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (changed("sessions/p01/events.jsonl", lambda text: text.replace(b"slip", b"drop", 1)),
         r"sessions/p01/events\.jsonl is not as it was written"),
        (changed("plan.csv", lambda text: text + b"\n" * 5_000_000), r"plan\.csv is not as it was written"),
        (lambda held, _: held.update({"sessions/p01/more.txt": b"more"}), r"more\.txt is in the file only"),
        (lambda held, _: held.pop(RECORDING), r"trial-001\.mcap is in the manifest only"),
        (lambda _, manifest: manifest.update(plan_sha256="0" * 64), "the plan is not the session's"),
        (lambda _, manifest: manifest["files"][0].update(n_bytes=10**18), "MiB are free"),
        (lambda _, manifest: manifest.update(version=2), "open it with the version of TEGA that wrote it"),
        (twice, "a name stands for two files"),
        (aside, "cannot be the name of a file"),
        (same_path, "a name stands for two files"),
        *((renamed(name), "cannot be the name of a file")
          for name in ("../outside.jsonl", "/tmp/outside.jsonl", "sessions/../../outside.jsonl", "NUL")),
        *((added(name), f"{re.escape(name)} is no file of a session")
          for name in ("report.html", "report/p01.csv", "withdrawn.txt", "can.py", "sessions/p01/elsewhere.txt",
                       "sessions/p01/now.json", "sessions/p02/events.jsonl", "sessions/p01/events.jsonl.lock")),
    ],
)  # fmt: skip
def test_what_was_changed_on_the_way_is_refused_and_nothing_is_left(change, message, bundle, tmp_path):
    foreign = rewritten(bundle, change)
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(TegaError, match=message):
        open_bundle(foreign, tmp_path / "there")
    assert sorted(tmp_path.rglob("*")) == before


def test_a_bundle_that_somebody_else_packed_is_opened(bundle: Path, tmp_path: Path) -> None:
    open_bundle(rewritten(bundle, added("sessions/p01/notes.txt")), tmp_path / "there")
    assert (tmp_path / "there/sessions/p01/notes.txt").is_file()


@pytest.mark.parametrize(
    "cut", [slice(0), slice(1), slice(1000), slice(-1), slice(-30), slice(30, None), slice(300, None)]
)
def test_a_bundle_that_was_cut_short_is_told(cut: slice, bundle: Path, tmp_path: Path) -> None:
    bundle.write_bytes(bundle.read_bytes()[cut])
    with pytest.raises(RecordingError, match=r"p01\.zip"):
        open_bundle(bundle, tmp_path / "there")
    assert not (tmp_path / "there").exists()


@pytest.mark.parametrize("name", [RECORDING, "sessions/p01/events.jsonl"])
def test_a_bit_that_has_tipped_is_told_with_the_name_of_its_file(name, bundle, tmp_path):
    with zipfile.ZipFile(bundle) as packed:
        entry = packed.getinfo(name)
    content = bytearray(bundle.read_bytes())
    content[entry.header_offset + 80 + entry.compress_size // 2] ^= 1
    bundle.write_bytes(content)
    with pytest.raises(RecordingError, match=f"{name} is not as it was written"):
        open_bundle(bundle, tmp_path / "there")
    assert not (tmp_path / "there").exists()


@pytest.mark.usefixtures("study")
def test_the_verbs(tmp_path, monkeypatch, capsys):
    def called(*words: str, code: int = 0) -> str:
        return call(capsys, "study", *words, code=code)[0]

    monkeypatch.chdir(tmp_path)
    assert "p01.zip: p01, 4 trials, " in called("bundle", "study", "p01", "p01.zip")
    message = called("open", "p01.zip")
    assert message.startswith("p01: p01, ")
    assert "not data of a person" in message
    assert "haptic: 2 trials that count, 2 successes, 2 slips, 0 deformations" in message
    assert "4 trials, worked out again: the same" in message
    assert "p01  complete" in called("status", "p01")

    foreign = rewritten(tmp_path / "p01.zip", lambda _, manifest: manifest["trials"][0].update(slips=0))
    assert json.loads(called("open", str(foreign), "--out", "other", "--json", code=1))["same"] is False


def test_a_table_of_objects_does_not_make_a_script_a_photo(study: Path, tmp_path: Path) -> None:
    (study / "objects.toml").write_text('[bag]\nphoto = "report.html"\n', encoding="utf-8")
    write_bundle(study, "p01", tmp_path / "p01.zip")
    with pytest.raises(RecordingError, match=r"report\.html is no file of a session"):
        open_bundle(rewritten(tmp_path / "p01.zip", added("report.html")), tmp_path / "there")


def test_a_withdrawal_names_copies_of_recordings_and_their_copies(study: Path, tmp_path: Path) -> None:
    source = study / RECORDING
    names = ("tables", "part", "other", "smaller", "both", "again")
    made = {name: tmp_path / f"{name}\udce9" for name in names}
    export_file(source, made["tables"])
    trim_session(source, from_s=0.0, to_s=0.1, out=made["part"])
    trim_session(source, from_s=0.2, to_s=0.3, out=made["other"])
    encode_session(source, out=made["smaller"], quality=80)
    merge_sessions([made["part"], made["other"]], out=made["both"])
    encode_session(made["part"], out=made["again"], quality=70)
    elsewhere = shutil.copytree(made["tables"], tmp_path / "hand")  # by hand: no program knows of it
    (tmp_path / "mine").mkdir()  # a recording outside of studies gets no list of copies
    export_file(Path(shutil.copy(source, tmp_path / "mine")), tmp_path / "mine/tables")
    assert not list((tmp_path / "mine").rglob("elsewhere.txt"))
    left = withdraw(study, "p01").left
    assert set(made.values()) <= set(left)
    assert len(set(left)) == len(left)
    assert elsewhere not in left
    assert not set(made.values()) & set(withdraw(study, "p02").left)
