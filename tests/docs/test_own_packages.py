"""Stages, drivers and a feature of one's own: example packages, through the contract and in runs."""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import socket
import sys
import venv
from importlib.metadata import distributions
from pathlib import Path
from subprocess import CompletedProcess
from typing import Any

import pytest

from reference.installed import own_feature, program, python
from tega.setup.contract import check_driver, check_stage

PROJECT = Path(__file__).resolve().parents[2]
EXAMPLES = {
    "own_metric": "embedding",
    "own_decoder": "one-channel",
    "own_mapping": "bars",
    "own_layout": "sleeve16",
}

pytestmark = pytest.mark.skipif(not (PROJECT / "examples" / "own_metric").is_dir(), reason="not a checkout")

RUN = """
import json, sys
from collections import Counter
from pathlib import Path
from tega.config import check_tree
from tega.loop import run_session
from tega.recording.mcap_reader import McapReader
from tega.recording.replay import replay_file
from tega_emulators.lab import emulated_lab, PRESSED

folder = Path(sys.argv[1])
with emulated_lab(
    folder, emg_hz=250.0, hand=True, vest=True, fingers=("index",), camera_hz=30.0, touch=PRESSED
) as lab:
    lab.tree["session"] |= {"duration_s": 10.0, "preset": "live"}
    lab.tree["recording"] = {"dir": str(folder / "recorded"), "lossless": True}
    lab.tree["vest"] |= {"layout": "sleeve16"}
    lab.tree["stages"] = json.loads(sys.argv[2])
    # The emulated muscles are tensed steadily: with these maxima by half.
    maxima = folder / "calibration.toml"
    maxima.write_text(maxima.read_text().replace("maxima = [1.0, 1.0, 1.0]", "maxima = [400.0, 400.0, 400.0]"))
    summary = run_session(check_tree(lab.tree, {}, base=folder).config)
file = folder / "recorded" / summary["recording"]["file"]
reader = McapReader(file)
more, closures, vest, exchanged = Counter(), set(), Counter(), 0
for message in reader.messages():
    value = message.value
    if message.topic == "/tactile/index/contact":
        more.update({(one.name, one.unit): abs(one.value) > 0 for one in value.more})
    elif message.topic == "/emg/levels":
        closures.add(value.closure)
    elif message.schema == "tega.HandExchange":
        exchanged += value.HasField("closure")
    elif message.topic == "/vest/frame":
        vest[value.layout, len(value.intensities), max(value.intensities) > 0] += 1
replay = replay_file(file)
print(json.dumps({
    "more": [[*key, n] for key, n in sorted(more.items())],
    "between": len([c for c in closures if 0 < c < 1]), "range": [min(closures), max(closures)],
    "exchanged": exchanged, "vest": list(vest), "toml": reader.files["session.toml"].decode(),
    "same": replay.same, "different": [repr(stream) for stream in replay.streams if stream.differ],
}))
"""

STAGES: dict[str, dict[str, Any]] = {
    "metric": {"name": "embedding", "options": {"components": 2}},
    "decoder": {"name": "one-channel", "options": {"channel": 2}},
    "mapping": {"name": "bars"},
}


@pytest.fixture(scope="module")
def fresh(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Install copies of the examples into a fresh environment, as anybody would.

    With ``TEGA_WHEEL`` (``make wheels`` sets it) TEGA is that wheel, and all else comes from the package index.
    Without, the environment sees the packages of the one that runs the tests, and needs no network.
    """
    place = tmp_path_factory.mktemp("fresh")
    wheel = os.environ.get("TEGA_WHEEL", "")
    venv.create(place, with_pip=bool(wheel), symlinks=os.name != "nt")
    python = place / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    found = run("-c", "import sysconfig; print(sysconfig.get_path('purelib'))", python=python)
    site = Path(found.stdout.strip())
    copies = [_copied(name, tmp_path_factory.mktemp("copy")) for name in (*EXAMPLES, "own_device")]
    if wheel:
        words = ("-m", "pip", "install", "--quiet", f"{Path(wheel).resolve()}[record]", *map(str, copies))
        run(*words, python=python)
    else:
        (site / "shared.pth").write_text("\n".join(_shared()))
        words = ("--quiet", "--no-index", "--no-deps", "--no-build-isolation", *map(str, copies))
        run("-m", "pip", "--python", str(python), "install", *words)
    for name in EXAMPLES:
        assert any(site.glob(f"{name}-*.dist-info")), "installed somewhere else"
    return python


def _copied(name: str, folder: Path) -> Path:
    left = shutil.ignore_patterns("build", "*.egg-info", "__pycache__")
    return Path(shutil.copytree(PROJECT / "examples" / name, folder / name, ignore=left))


def _shared() -> list[str]:
    """Return the folders of installed packages, that with a setuptools that builds the examples first.

    An environment that Python 3.11 makes begins with setuptools 65.5, which builds no wheel by itself; it would hide
    the newer one of a folder behind it.
    """
    names = {"site-packages", "dist-packages", "python", "emulators"}  # the last holds the emulated devices
    folders = [folder for folder in sys.path if Path(folder).name in names]

    def builds(folder: str) -> bool:
        found = [dist.version for dist in distributions(path=[folder]) if dist.name == "setuptools"]
        return any(tuple(map(int, version.split(".")[:2])) >= (70, 1) for version in found)

    builders = [folder for folder in folders if builds(folder)]
    assert builders, "no setuptools 70.1 or later to build the examples with: pip install '.[test]'"
    return [*builders, *(folder for folder in folders if folder not in builders)]


def run(
    *words: str, python: Path | str = sys.executable, cwd: Path | None = None, code: int = 0
) -> CompletedProcess[str]:
    env = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    return program(python, *words, folder=cwd, env=env, code=code)


@pytest.mark.slow
def test_the_examples_pass_the_contract_and_are_listed(fresh: Path) -> None:
    done = run("-m", "tega.setup.contract", *EXAMPLES.values(), python=fresh)
    assert [line.split()[:2] for line in done.stdout.splitlines()] == [["ok", n] for n in EXAMPLES.values()]
    listed = json.loads(run("-m", "tega.ui.cli", "stages", "--json", python=fresh).stdout)
    own = {stage["name"]: stage for stage in listed if stage["package"] != "tega"}
    assert set(own) == set(EXAMPLES.values())
    assert own["embedding"]["values"] == {"pc1": "grey", "pc2": "grey", "pc3": "grey"}
    done = run("-m", "tega.setup.contract", "one-channel", "--set", "rest=0.9", python=fresh, code=2)
    assert "a rest below full" in done.stdout


@pytest.mark.slow
def test_the_driver_s_template_passes_the_contract_and_is_listed(fresh: Path) -> None:
    done = run("-m", "tega.setup.contract", "own-emg", "own-vest", python=fresh)
    assert [line.split()[:2] for line in done.stdout.splitlines()] == [["ok", "own-emg"], ["ok", "own-vest"]]
    listed = run("-m", "tega.ui.cli", "devices", python=fresh)
    assert "own-emg" in listed.stdout
    assert "template of a vest" in listed.stdout
    done = run("-m", "tega.setup.contract", "own-emg", "--set", "port=broken", python=fresh, code=2)
    assert "is it switched on?" in done.stdout


@pytest.mark.slow
def test_the_examples_run_on_emulated_devices_and_are_recorded(fresh: Path, tmp_path: Path) -> None:
    pytest.importorskip("foxglove", reason="needs the extra tega[record]")
    done = run("-c", RUN, str(tmp_path), json.dumps(STAGES), python=fresh)
    reported = json.loads(done.stdout.splitlines()[-1])
    assert [row[:2] for row in reported["more"]] == [["pc1", "grey"], ["pc2", "grey"]]
    assert all(n > 10 for *_, n in reported["more"])
    assert reported["between"] > 10, reported["range"]
    assert reported["exchanged"] > 100
    assert {tuple(row[:2]) for row in reported["vest"]} == {("sleeve16", 16)}
    assert any(lit for _, _, lit in reported["vest"])
    assert all(stage["name"] in reported["toml"] for stage in STAGES.values())
    assert reported["same"], reported["different"]


def test_without_its_package_a_recording_says_what_is_missing(tmp_path: Path) -> None:
    (tmp_path / "lab.toml").write_text('[stages.metric]\nname = "embedding"\n')
    done = run("-m", "tega.ui.cli", "config", "check", "lab.toml", cwd=tmp_path, code=1)
    assert "stages.metric.name: no metric is called 'embedding'" in done.stderr


CLOSED = 'raise DeviceUnavailableError("own-emg is not open", "open it first")'
LIMITED = "np.minimum(frame.intensities, self._options.limit)"
UNCUT = "samples = self._received(self._opened_ns)"
BREAKING = [
    ("own_metric", "EmbeddingMetric", "finger=self._setup.finger", 'finger="thumb"', "the one it was made for"),
    ("own_metric", "EmbeddingMetric", 'return {f"pc{number}"', 'return {f"p{number}"', "every value of units"),
    ("own_metric", "EmbeddingMetric", 'more}', 'more, "force_n": seen.eda or None}', "same numbers"),
    ("own_decoder", "ProportionalDecoder", "self._n += len(samples)", "pass", "however the samples are cut"),
    ("own_decoder", "ProportionalDecoder", "closure=closure", "closure=2 * closure", "closure is 0 to 1"),
    ("own_mapping", "BarsMapping", "return levels", "return levels + 1", "every motor rests"),
    ("own_layout", "SLEEVE16", "SPACING_MM * row)", "SPACING_MM * row) if row else None", "are known, or none"),
    ("own_device/emg", "OwnEmg", CLOSED, "return None", "while closed raises"),
    ("own_device/emg", "OwnEmg", UNCUT, "samples = np.zeros((1, 9))", "one column per channel"),
    ("own_device/emg", "OwnEmg", "self._n_delivered += len(samples)", "pass", "first_index never goes back"),
    ("own_device/emg", "OwnEmg", "EmgChunk(time.monotonic_ns(), first, samples)", "samples", "EmgChunk, or None"),
    ("own_device/vest", "OwnVest", LIMITED, "(frame.intensities + 1)", "only ever lowers"),
]  # fmt: skip


@pytest.mark.parametrize(("file", "name", "right", "wrong", "rule"), BREAKING)
def test_the_contract_finds_what_is_wrong(file, name, right, wrong, rule, tmp_path, monkeypatch):
    package, _, part = file.partition("/")
    source = PROJECT / "examples" / package / "src" / package / f"{part or '__init__'}.py"
    text = source.read_text(encoding="utf-8")
    assert right in text
    path = tmp_path / "wrong.py"
    path.write_text(text.replace(right, wrong), encoding="utf-8")
    spec = importlib.util.spec_from_file_location(f"{package}_wrong", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, spec.name, module)
    spec.loader.exec_module(module)
    made: Any = getattr(module, name)
    with pytest.raises(AssertionError, match=rule):
        check_driver(made, made.options_type()) if part else check_stage(made)


LAB = """
[session]
pace = "fast"
duration_s = 6.0
[tactile.thumb]
driver = "synthetic-touch"
[tactile.index]
driver = "synthetic-touch"
[grip]
firm_from = {firm_from}
[recording]
dir = "recorded"
lossless = true
stop_free_mib = 0.0
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return own_feature(tmp_path_factory.mktemp("site"))


def tega(site: Path, folder: Path, *words: str, code: int = 0) -> str:
    return "".join(python("-m", "tega.ui.cli", *words, site=site, folder=folder, code=code))


@pytest.mark.slow
def test_every_member_of_the_feature_takes_part(installed: Path, tmp_path: Path) -> None:
    pytest.importorskip("foxglove", reason="needs the extra tega[record]")
    (tmp_path / "lab.toml").write_text(LAB.format(firm_from=2))
    assert "grip" in tega(installed, tmp_path, "--help")
    displayed = tega(installed, tmp_path, "config", "show", "lab.toml")
    assert ["grip.firm_from", "2", "lab.toml:10"] in [line.split() for line in displayed.splitlines()]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind(("127.0.0.1", 9100))
        printed = tega(installed, tmp_path, "run", "lab.toml", "--stream", "grips", "--json")
        assert listener.recv(64).decode().strip() in {"0", "1", "2"}
    summary, _ = json.JSONDecoder().raw_decode(printed)
    file = Path("recorded") / summary["recording"]["file"]
    firm = summary["grip"]["firm"]
    assert firm > 0
    assert f"{firm} firm grips" in tega(installed, tmp_path, "grip", str(file))
    inspected = tega(installed, tmp_path, "recording", "inspect", str(file))
    assert "/grip" in inspected
    assert "not installed here" not in tega(installed, tmp_path, "verify", str(file))
    without = tega(tmp_path, tmp_path, "verify", str(file))
    assert "recorded with the feature 'grip', which is not installed" in without
    words = ("recording", "trim", str(file), "--from", "1", "--to", "5", "--out", "part.mcap")
    tega(installed, tmp_path, *words)
    assert "/grip" in tega(installed, tmp_path, "recording", "inspect", "part.mcap")
    export = ("recording", "export", str(file), "--format", "grips", "--out", "grips", "--firm-only")
    tega(installed, tmp_path, *export)
    rows = (tmp_path / "grips" / f"{file.stem}-grips.csv").read_text().splitlines()
    assert rows[0] == "t_s,fingers"
    assert {row.split(",")[1] for row in rows[1:]} == {"2"}
    (tmp_path / "to.toml").write_text('session.out_dir = "played"\n[grip]\nfirm_from = 2\n')
    printed = tega(installed, tmp_path, "play", str(file), "--to", "to.toml", "--speed", "max", "--json")
    played, _ = json.JSONDecoder().raw_decode(printed)
    assert played["grip"]["firm"] == firm
    tega(installed, tmp_path, "recording", "export", str(file), "--out", "tables")
    assert any("grip" in path.name for path in (tmp_path / "tables").iterdir())


@pytest.mark.slow
def test_its_check_speaks_in_doctor_and_its_table_is_checked(installed: Path, tmp_path: Path) -> None:
    (tmp_path / "lab.toml").write_text(LAB.format(firm_from=3))
    message = tega(installed, tmp_path, "doctor", "lab.toml", code=3)
    assert "no grip is ever firm" in " ".join(message.split())  # doctor breaks lines
    (tmp_path / "lab.toml").write_text(LAB.format(firm_from=5))
    message = tega(installed, tmp_path, "config", "check", "lab.toml", code=1)
    assert "lab.toml:10: grip.firm_from = 5" in message


def test_its_row_is_on_page_and_terminal(installed: Path) -> None:
    program = """
from own_feature.records import Grip
from tega.records.bus import Bus
from tega.records.display import DisplayRows
bus = Bus()
rows = DisplayRows(bus, "test")
bus.publish(Grip(t_ns=0, fingers=2, firm=True))
print(rows())
"""
    printed, _ = python("-c", program, site=installed, folder=installed)
    assert printed.strip() == "{'grip': '2 fingers, firm'}"
