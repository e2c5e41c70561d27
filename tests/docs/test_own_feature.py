"""A feature of one's own: the example package adds one of each member."""

from __future__ import annotations

import json
import socket
from pathlib import Path

import pytest

from reference.installed import OWN_FEATURE, distribution, own_feature, python

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

pytestmark = pytest.mark.skipif(not OWN_FEATURE.is_dir(), reason="not a checkout")


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
    assert "recorded with the feature 'grip', which is not installed" in tega(
        tmp_path, tmp_path, "verify", str(file)
    )
    words = ("recording", "trim", str(file), "--from", "1", "--to", "5", "--out", "part.mcap")
    tega(installed, tmp_path, *words)
    assert "/grip" in tega(installed, tmp_path, "recording", "inspect", "part.mcap")
    export = ("recording", "export", str(file), "--format", "grips", "--out", "grips", "--firm-only")
    tega(installed, tmp_path, *export)
    rows = (tmp_path / "grips" / f"{file.stem}-grips.csv").read_text().splitlines()
    assert rows[0] == "t_s,fingers"
    assert {row.split(",")[1] for row in rows[1:]} == {"2"}
    (tmp_path / "to.toml").write_text('session.out_dir = "played"\n[grip]\nfirm_from = 2\n')
    played, _ = json.JSONDecoder().raw_decode(
        tega(installed, tmp_path, "play", str(file), "--to", "to.toml", "--speed", "max", "--json")
    )
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


def test_a_feature_that_fails_to_load_is_named_and_the_rest_works(tmp_path: Path) -> None:
    distribution(tmp_path, "broken-feature", "[tega.features]\nbroken = broken_feature:FEATURE\n")
    (tmp_path / "broken_feature.py").write_text("import a_package_that_is_missing\n")
    message = tega(tmp_path, tmp_path, "config", "show")
    assert "feature 'broken' is left out: ModuleNotFoundError" in message
    assert "pip install a_package_that_is_missing, or remove broken-feature" in message
    assert "session.preset" in message
