"""Names in recordings and studies that somebody else made: none of them writes, reads or deletes beyond its folder."""

from __future__ import annotations

import re
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import msgspec
import pytest

from reference.command import call
from reference.sessions import rewritten
from tega.config.calibration.folder import CalibrationFolder, checked_person
from tega.errors import UnsafeNameError
from tega.recording.export import export_file
from tega.recording.mcap_copy import McapCopy, McapRecords
from tega.runtime.files.foreign_file import path_below
from tega.ui.cli.main import main
from tega_study.observers import observer_path
from tega_study.plan import StudyPlan, make_plan, read_plan, write_plan
from tega_study.privacy import withdraw
from tega_study.score.boris import import_boris

VERBS = {
    "recording export": ["--out", "out", "--pictures"],
    "recording export --format lerobot": ["--out", "out"],
    "recording trim": ["--from", "0.05", "--to", "0.15", "--out", "out"],
    "recording inspect": [],
    "verify": [],
    "play": ["--speed", "50"],
}


def hostile(source: Path, target: Path, *, attached: str = "", finger: str = "ring") -> Path:
    """Copy a recording, with one more attachment, or a finger's topics under another name."""
    target.parent.mkdir(parents=True, exist_ok=True)
    with source.open("rb") as old, target.open("wb") as file:
        copy = McapCopy(file)
        for item in McapRecords(old):
            channel = item.channel and replace(
                item.channel, topic=item.channel.topic.replace("/ring/", f"/{finger}/")
            )
            copy.take(item._replace(channel=channel))
        if attached:
            copy.writer.add_attachment(0, 0, attached, "text/plain", b"stolen")
        copy.finish()
    return target


def everything(folder: Path) -> set[Path]:
    return {path for path in folder.rglob("*") if "out" not in path.relative_to(folder).parts[:2]}


# Which names are plain is a property of its own, in `test_settings_text.py`.
@pytest.fixture(
    scope="module", params=[("attached", "{folder}/stolen"), ("attached", "../../stolen"), ("finger", "..")]
)
def stolen(request: pytest.FixtureRequest, short: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a recording with an attachment, or with pictures of a finger, that would be written elsewhere."""
    folder, (subject, name) = tmp_path_factory.mktemp("sent"), request.param
    return hostile(short, folder / subject / "x.mcap", **{subject: name.format(folder=folder)})


@pytest.mark.parametrize("verb", VERBS)
def test_no_verb_on_a_recording_writes_elsewhere(verb, stolen, tmp_path, monkeypatch, capsys):
    work = tmp_path / "work"
    work.mkdir()
    recording = Path(shutil.copy(stolen, work))
    monkeypatch.chdir(work)
    before = everything(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main([*verb.split(), str(recording), *VERBS[verb]])
    assert ended.value.code in {0, 1, 2}
    if "export" in verb:
        refused = verb == "recording export" or stolen.parent.name == "finger"
        assert (ended.value.code != 0) == refused
        assert bool(re.search(r"x\.mcap: .* cannot be the name", capsys.readouterr().err)) == refused
    assert {path for path in everything(tmp_path) - before if "out" not in path.parts} == set()
    assert not (stolen.parents[1] / "stolen").exists()


@pytest.mark.parametrize("person", ["../../elsewhere", "*", "..", "/tmp"])
def test_a_plan_s_people_have_plain_names(person: str, tmp_path: Path) -> None:
    plan = make_plan(participants=2)
    rows = tuple(
        msgspec.structs.replace(row, participant=person) if row.participant == "p01" else row
        for row in plan.trials
    )
    write_plan(StudyPlan(plan.settings, rows), tmp_path / "study")
    mine = tmp_path / "study" / "sessions" / "p02" / "events.jsonl"
    mine.parent.mkdir(parents=True)
    mine.write_text("")
    with pytest.raises(UnsafeNameError, match=r"plan\.csv: participant "):
        read_plan(tmp_path / "study")
    with pytest.raises(UnsafeNameError):
        withdraw(tmp_path / "study", person)
    assert mine.exists()


def test_a_plan_s_objects_and_conditions_have_plain_names(tmp_path: Path) -> None:
    plan = make_plan(participants=1)
    for subject in ("object", "condition"):
        rows = tuple(msgspec.structs.replace(row, **{subject: "../x"}) for row in plan.trials)
        write_plan(StudyPlan(plan.settings, rows), tmp_path / subject)
        with pytest.raises(UnsafeNameError, match=f"{subject} '../x'"):
            read_plan(tmp_path / subject)


def test_raters_and_people_s_codes_are_plain_names(tmp_path: Path) -> None:
    write_plan(make_plan(participants=1), tmp_path / "study")
    coded = tmp_path / "coded.boris"
    coded.write_text('{"observations": {"p01_t01_a1": {"events": []}}}')
    with pytest.raises(UnsafeNameError, match=r"rater '\.\./\.\./x'"):
        import_boris(tmp_path / "study", coded, "../../x")
    with pytest.raises(UnsafeNameError):
        observer_path(tmp_path, "../p01", "r1")
    with pytest.raises(UnsafeNameError):
        checked_person("p01/../p02")


def test_an_interrupted_calibration_s_picture_lies_in_its_folder(tmp_path: Path) -> None:
    folder = CalibrationFolder(tmp_path)
    kept = path_below(folder.path, "gels/D20982/2026.png", subject="picture", source="unfinished.json")
    assert kept == tmp_path / "gels" / "D20982" / "2026.png"
    for name in ("/etc/passwd", "gels/../../x.png", "", "gels//x.png"):
        with pytest.raises(UnsafeNameError, match=r"unfinished\.json: picture "):
            path_below(folder.path, name, subject="picture", source="unfinished.json")


@pytest.mark.skipif(sys.platform != "linux", reason="the system lists open files in /proc")
def test_a_refused_recording_is_closed(stolen: Path, tmp_path: Path) -> None:
    with pytest.raises(UnsafeNameError) as refused:
        export_file(stolen, tmp_path / "out", pictures=True)
    assert stolen not in [path.resolve() for path in Path("/proc/self/fd").iterdir()], refused


def test_texts_of_a_recording_are_no_commands_to_a_terminal(short, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    name = "[bold]\x1b[2J\udce9.mcap"
    path = rewritten(short, tmp_path / name, tables={"versions": {"system": "\x1b[2J[/b]"}})
    text = call(capsys, "recording", "inspect", path)[0]
    assert text.startswith(r"[bold]\x1b[2J\udce9.mcap ")
    call(capsys, "recording", "trim", path, "--out", tmp_path / "part")
    call(capsys, "recording", "annotate", path, "--boris", tmp_path / "a.boris")
    odd = rewritten(short, tmp_path / "odd.mcap", tables={"origin-1": {"from_ns": "9" * 400}})
    assert "a step that made it is damaged" in call(capsys, "recording", "inspect", odd, code=1)[1]
    for words in (["verify", path, "--picture", tmp_path / "drawn.png"], ["play", path, "--speed", "max"]):
        assert "\x1b" not in "".join(call(capsys, *words))
    assert r"system \x1b[2J[/b]" in text
    assert r"\x1b[2J" in call(capsys, "recording", "inspect", tmp_path / "\x1b[2J", code=1)[1]


def test_a_recording_goes_into_the_folder_that_is_named_and_odd_names_replay(tmp_path, capsys):
    lab, there = tmp_path / "lab.toml", tmp_path / "\U00020bb7"
    lab.write_text('[emg]\ndriver = "synthetic-emg"\nkind = "raw"\noptions.duration_s = 0.5\n')
    call(capsys, "run", lab, "--set", "session.pace=fast", "--record", there)
    assert list(there.glob("*.mcap"))
    assert "is not UTF-8" in call(capsys, "run", lab, "--record", tmp_path / "\udce9", code=1)[1]
    (tmp_path / "\udce9.csv").write_text("t,a\n" + "".join(f"{k / 1000},{k % 7}.5\n" for k in range(500)))
    call(capsys, "replay", "--emg", tmp_path / "\udce9.csv", "--emg-kind", "raw", "--out", tmp_path / "out")
