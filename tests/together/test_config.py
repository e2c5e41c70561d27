"""Settings: precedence, origins, what is said about mistakes, their pages, and the doctor's look at calibrations."""

from __future__ import annotations

import json
import re
import tomllib
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from reference.command import call
from reference.kept import NOW, muscle_file, muscles, touch, worn
from tega.config import load_config
from tega.config.calibration.folder import CalibrationFolder
from tega.config.calibration.records import write_record
from tega.config.load import leaves, value_lines
from tega.config.person import driver_settings
from tega.devices import driver_class, driver_names
from tega.devices.base import optional
from tega.devices.fingertip.images import ImageFolderOptions
from tega.errors import ConfigError
from tega.runtime.evidence import EVIDENCE
from tega.setup.doctor.findings import Finding
from tega.setup.doctor.settings import check_calibration

SETTINGS = """
[session]
preset = "paper"
out_dir = "results"

[tactile.index]
driver = "images"
baseline = "gel.png"
options = { folder = "index", rate_hz = 30 }

[emg]
driver = "emg-file"
kind = "raw"
options = { file = "squeeze.csv", rate_hz = 200.0, channels = [3, 6] }
"""

DIGIT = "{driver='digit',options={serial='D1'}}"


@pytest.fixture
def settings(tmp_path: Path) -> Path:
    path = tmp_path / "session.toml"
    path.write_text(SETTINGS)
    return path


def test_defaults_need_no_file() -> None:
    loaded = load_config(None, environ={})
    assert loaded.config.session.preset == "live"
    assert loaded.config.tactile == {}
    of_preset = {"vest.layout", "vest.pace", *(f"stages.{s}.name" for s in ("metric", "decoder", "mapping"))}
    assert {v.origin for k, v in loaded.values.items() if k not in of_preset} == {"default"}
    assert {loaded.values[key].origin for key in of_preset} == {"preset live"}
    assert loaded.values["vest.layout"] == ("x40", "preset live")


def test_each_layer_overrides_the_one_below(settings: Path) -> None:
    environ = {"TEGA_SESSION__PRESET": "live", "TEGA_EMG__KIND": "envelope", "TEGA_DATA": "/somewhere"}
    loaded = load_config(settings, environ=environ, sets=["emg.kind=rectified"])
    assert loaded.values["session.preset"] == ("live", "TEGA_SESSION__PRESET")
    assert loaded.values["emg.kind"] == ("rectified", "--set")
    assert loaded.values["emg.driver"] == ("emg-file", "session.toml:12")
    assert loaded.values["vest.rate_hz"] == (30.0, "default")


def test_relative_paths_belong_to_whoever_wrote_them(settings, tmp_path, monkeypatch):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.chdir(elsewhere)
    vest = "vest={driver='vest-recorder',options={file='here'}}"
    config, values = load_config(settings, environ={}, sets=["session.out_dir=here", vest])
    assert values["vest.options.file"] == (elsewhere / "here", "--set")
    index = config.tactile["index"]
    assert index is not None
    assert index.baseline == tmp_path / "gel.png"
    assert index.options == ImageFolderOptions(folder=tmp_path / "index", rate_hz=30.0)
    assert config.session.out_dir == elsewhere / "here"


def test_options_may_be_set_one_by_one(settings: Path) -> None:
    sets = ["emg.options.channels=[1]", "emg.options.rate_hz=1e3"]
    config = load_config(settings, environ={}, sets=sets).config
    assert config.emg is not None
    assert (config.emg.options.channels, config.emg.options.rate_hz) == ((1,), 1000.0)
    vest = load_config(None, environ={}, sets=["vest.threshold=20", f"vest.step={[2.5] * 40}"]).config.vest
    assert (vest.threshold, vest.step) == (20.0, (2.5,) * 40)


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("tactile.tumb.driver=synthetic-touch", r"the tumb is in no column .*; did you mean 'thumb'\?"),
        ("zzz.a=1", r"zzz: unknown key; if this is .* package; else known here: (?!.*guests)session"),
        ("session.preset=fast", r"session\.preset = 'fast': not one of the choices; one of: paper, live"),
        ("emg.kind=3", r"emg\.kind = 3: expected text in quotes, got a whole number"),
        ("vest.threshold=five", "vest.threshold = 'five': expected a number or a list, got text"),
        ("vest.threshold=120", r"vest\.threshold = 120: expected a number <= 99"),
        ("vest.step=[1, 2]", r"vest\.step = \[1, 2\]: expected a list of length >= 40"),
        ("session.duration_s=-0.000059999999999999995", r"session\.duration_s = -0\.00006: .* \(seconds\)"),
        ("emg.options.rate_hz=0", r"emg\.options\.rate_hz = 0: expected a number > 0\.0 \(hertz\)"),
        ("emg.options.rate_hz=nan", r"emg\.options\.rate_hz = nan: .*\(hertz\)"),
        ("emg.options.channels=[3, 0]", r"emg\.options\.channels\[1\] = 0: expected a whole number >= 1"),
        ("vest.rate_hz=true", r"vest\.rate_hz = True: expected a number, got true or false \(hertz\)"),
        ("hand.device_id=4", r"hand\.device_id = 4: expected a whole number <= 3"),
        ("emg=3", r"emg = 3: expected a table, got a whole number"),
        ("tactile.index.driver=imags", r"no driver is called 'imags'; did you mean 'images'\?"),
        ("tactile.index.driver=emg-file", r"'emg-file' is of kind 'emg', not 'tactile'"),
        ("input.motion.driver=digit", r"input\.motion.*driver 'digit' is of kind 'tactile'"),
        ('recording.dir="a\\u0000b"', r"recording\.dir = 'a.*b': a path holds no NUL character"),
        ("tactile.index.baseline=3", r"tactile\.index\.baseline = 3: "),
        ("tactile.ring.baseline=a.png", r"tactile\.ring\.driver: missing"),
        ("vest={driver='bhaptics-ble',options={most_hz=100}}", r"most_hz = 100: expected a number <= 50"),
        ("vest.options.port=3", r"vest\.options: given, but no driver is named"),
        (f"tactile={{thumb={DIGIT},index={DIGIT}}}", "index.options.serial = 'D1': tactile.thumb has"),
        ("hand={driver='can-recorder',options={file='squeeze.csv'}}", "squeeze.csv': emg has it, too"),
        ("hand={driver='allegro',device_id=2,options={interface='',channel=0}}", "options.device_id = 0"),
        ("session.preset.x=3", r"session\.preset is a value, not a table"),
        ("pace=fast", r"did you mean 'session\.pace' or 'vest\.pace'\?"),
        ("vest.duration_s=3", r"did you mean 'session\.duration_s'\?"),
        ("=3", r"not of the form key=value"),
        (" = 3", r"not of the form key=value"),
        ("preset", r"not of the form key=value"),
    ],
)
def test_mistakes_are_named(settings, override, message, monkeypatch) -> None:
    monkeypatch.chdir(settings.parent)
    with pytest.raises(ConfigError, match=message):
        load_config(settings, environ={}, sets=[override])


@pytest.mark.parametrize(
    ("written", "instead", "message"),
    [
        ('preset = "paper"', 'prset = "paper"', "3: session.prset: unknown key; did you mean 'preset'"),
        ('driver = "images"\n', "", "7: tactile.index.driver: missing"),  # the first line of its table
    ],
)
def test_a_mistake_in_the_file_names_file_and_line(settings, written, instead, message):
    settings.write_text(SETTINGS.replace(written, instead))
    with pytest.raises(ConfigError, match=f"^session.toml:{message}"):
        load_config(settings, environ={})
    with pytest.raises(ConfigError, match=r"^TEGA_EMG__KIND: emg\.kind = 'noisy'"):
        load_config(None, environ={"TEGA_EMG__KIND": "noisy", "TEGA_EMG__DRIVER": "emg-file"})


def test_lines_of_values_however_they_are_written_and_the_examples_are_valid() -> None:
    text = '''# a comment
top = 1   # after it

[a]
long = [
    1,
    2,  # [b]
]
text = """
[b]
x = 3
"""
  [a.inner]
  "quoted key" = 1
dotted.key = { x = 1, y = { z = 2 } }
[[rows]]
n = 1
[rows.more]
m = 2'''
    assert value_lines(text) == {
        "top": 2,
        "a.long": 5,
        "a.text": 9,
        "a.inner.quoted key": 14,
        "a.inner.dotted.key.x": 15,
        "a.inner.dotted.key.y.z": 15,
        "rows[0].n": 17,
        "rows[0].more.m": 19,
    }
    for name in ("session.toml", "simulated.toml"):
        example = PROJECT / "examples" / name
        text = example.read_text(encoding="utf-8")
        assert set(value_lines(text)) == {key for key, _ in leaves(tomllib.loads(text))}
        assert load_config(example, environ={}).config.emg is not None


def test_broken_toml(tmp_path: Path) -> None:
    broken = tmp_path / "broken.toml"
    for content, problem in (
        (b"[session\n", "not valid TOML: .*line 1"),
        (b"a." * 5000 + b"a = 1", "not valid TOML: .*hundreds deep"),
        (b"a = " + b"9" * 5000, "not valid TOML: .*thousands of digits"),
        (b"\na = [\n" + b"1,\n" * 600 + b"]", r"not valid TOML: a value has more than .*line 2\)"),
        (b"# " + b"x" * (2 << 20), "2 MiB, at most 1 MiB are read"),
    ):
        broken.write_bytes(content)
        with pytest.raises(ConfigError, match=rf"^broken\.toml: {problem}"):
            load_config(broken, environ={})


PROJECT = Path(__file__).resolve().parents[2]


@pytest.mark.words
def test_the_reference_lists_every_key_and_driver(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(PROJECT / "docs")
    from reference_pages import drivers_page, settings_page, stages_page

    settings, drivers = settings_page(), drivers_page()
    loaded = load_config(PROJECT / "examples" / "session.toml", environ={})
    seats = {key for key in loaded.values if re.fullmatch(r"(tactile|input)\.\w+", key)}
    for key in set(loaded.values) - seats:
        section, _, option = re.sub(r"^tactile\.\w+", "tactile.FINGER", key).partition(".options.")
        listed = f"`{option}`" in drivers + stages_page() if option else f"`{section}" in settings
        assert listed, key
    for name in driver_names():
        assert f"### `{name}`" in drivers, name


def test_the_page_on_faults_lists_the_evidence_of_every_live_driver() -> None:
    page = (PROJECT / "docs" / "evidence" / "faults.md").read_text(encoding="utf-8")
    text = page.partition("## Evidence")[2].partition("### Actions")[0]
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in text.splitlines()
        if line.startswith("| `")
    ]
    listed = {row[0].strip("`"): dict(zip(EVIDENCE, row[1:], strict=True)) for row in rows}
    compared = {
        name: {evidence: optional(driver_class(name), "compared").get(evidence, "–") for evidence in EVIDENCE}
        for name in driver_names()
        if driver_class(name).kind in {"tactile", "emg", "hand", "tracker"}
        and optional(driver_class(name), "compared")
    }
    assert listed == compared
    assert {"cyton", "chords", "spiker", "serial-emg", "lsl-emg", "brainflow"} <= set(compared)
    assert {"digit", "hololens", "openxr", "allegro"} <= set(compared)


THUMB = '[tactile.thumb]\ndriver = "digit"\noptions = { serial = "D20641" }\n'
LAB = f"""{THUMB}
[emg]
driver = "chords"
kind = "raw"
options = {{ port = "/dev/ttyUSB0" }}
[vest]
driver = "bhaptics-player"
"""


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    (tmp_path / "lab.toml").write_text(LAB, encoding="utf-8")
    return tmp_path


def reported(lab: Path, *sets: str) -> list[Finding]:
    config = load_config(lab / "lab.toml", environ={}, sets=sets).config
    found = check_calibration(config, settings="lab.toml", now=NOW)
    assert {f.check for f in found} <= {"calibration"}
    return found


def keep_all(lab: Path, made: datetime = NOW, kind: str = "raw") -> None:
    config = load_config(lab / "lab.toml", environ={}).config
    assert config.emg is not None
    home = CalibrationFolder(lab / "calibrations")
    home.keep(touch(made=made))
    home.keep(muscles(settings=driver_settings(config.emg), kind=kind, made=made))
    home.keep(worn(made=made))


def test_without_one_the_next_command_stands_there(lab: Path) -> None:
    (finding,) = reported(lab)
    assert finding.status == "missing"
    assert finding.finding == "there is no calibration for thumb, EMG"
    assert finding.todo[0].endswith("\ntega-teleop calibrate lab.toml --person ID")


def test_the_person_s_own_is_looked_at_and_no_other(lab: Path) -> None:
    keep_all(lab)
    (nobody,) = reported(lab)
    assert nobody.status == "warning"
    assert "there are those of p01" in nobody.finding
    assert nobody.todo[0].endswith("\ntega-teleop doctor lab.toml --person p01")
    (mine,) = reported(lab, "calibration.person=p01")
    assert mine.status == "ok"
    fresh = "p01's calibration is there and fresh: thumb, EMG, vest (8 of 8 places named right)"
    assert mine.finding == fresh
    found = reported(lab, "calibration.person=p02")
    assert [f.status for f in found] == ["missing", "missing", "warning"]  # a run goes without thresholds
    assert "p02 has no calibration on D20641 (there is one of p01)" in found[0].finding
    command = "run this:\ntega-teleop calibrate lab.toml --person {} --only {}"
    assert [f.todo for f in found] == [(command.format("p02", one),) for one in ("tactile", "emg", "vest")]
    people = lab / "calibrations" / "people" / "p01"
    write_record(touch(person="p07"), people / "touch-D20641.toml")
    fine, copied = reported(lab, "calibration.person=p01")
    assert (fine.status, copied.status) == ("ok", "error")
    assert "was made for p07 on D20641, not for p01" in copied.finding
    assert copied.todo == (command.format("p01", "tactile"),)
    (people / "emg-ttyUSB0.toml").write_text("format =", encoding="utf-8")
    *_, damaged = reported(lab, "calibration.person=p01")
    assert damaged.status == "error"
    assert "not valid TOML" in damaged.finding


def test_one_made_another_way_is_wrong_and_an_old_one_told_with_its_age(lab: Path) -> None:
    keep_all(lab, kind="envelope")
    _, wrong = reported(lab, "calibration.person=p01")
    assert wrong.status == "error"
    assert "was calibrated with kind = envelope, the settings have raw" in wrong.finding
    keep_all(lab, made=NOW - timedelta(days=40))
    fine, thumb, emg = reported(lab, "calibration.person=p01")
    assert "fresh: vest (8 of 8" in fine.finding  # that is good for 90 days
    assert (thumb.status, emg.status) == ("warning", "warning")
    assert thumb.finding == "thumb: maxima: 40 days old, warned of after 720 hours"
    assert emg.finding == "EMG: 40 days old, warned of after 12 hours"
    assert emg.todo == ("run this:\ntega-teleop calibrate lab.toml --person p01 --refresh",)


def test_a_file_that_does_not_fit_or_is_not_there(lab: Path) -> None:
    (missing,) = reported(lab, f"calibration.file={lab / 'none.toml'}")
    assert missing.status == "missing"
    (wrong,) = reported(lab, f"calibration.file={muscle_file(lab, 1.0, rate_hz=500.0)}")
    assert wrong.status == "error"
    assert wrong.finding == "c.toml: has no maxima for finger 'thumb'"
    assert wrong.todo[-1].endswith("tega-teleop calibrate lab.toml --person ID")


def test_recordings_need_none(lab: Path) -> None:
    (lab / "lab.toml").write_text('[tactile.thumb]\ndriver = "synthetic-touch"\n', encoding="utf-8")
    assert reported(lab) == []


def test_the_verb_takes_a_person(lab: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (lab / "lab.toml").write_text(THUMB, encoding="utf-8")
    CalibrationFolder(lab / "calibrations").keep(touch(made=datetime.now(UTC)))
    words = ("doctor", lab / "lab.toml", "--person", "p01", "--json")
    out, _ = call(capsys, *words, code=3)  # there is no sensor
    findings = {f["check"]: f for f in json.loads(out)["findings"]}
    assert findings["calibration"]["finding"] == "p01's calibration is there and fresh: thumb"
