"""Alerts of the link of two stations, in the operator's run: the other station is a program of its own."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from reference.parts import Running
from reference.processes import until
from tega.config import load_config
from tega.recording.mcap_reader import McapReader

pytest.importorskip("zenoh", reason="needs the extra net")

from tega_emulators.stations import Program, free_port, write_stations
from tega_link.link import Link

pytestmark = pytest.mark.slow


def led(folder: Path, robot_more: str, disturb: Callable[[Program], None], words: str) -> None:
    """Lead a robot and disturb it until the operator's display and recording have an alert."""
    robot_file, operator_file = write_stations(folder, port=free_port())
    robot_file.write_text(robot_file.read_text() + robot_more)
    sets = [f"recording.dir={folder / 'recorded'}", "recording.stop_free_mib=0"]
    config = load_config(operator_file, sets=sets, environ={}).config
    with Program("robot", robot_file) as robot:
        robot.await_said("waits for an operator")
        with Running(config) as run:
            until(lambda: run.view.state == "active")
            disturb(robot)
            until(lambda: any(words in one for view in run.views for one in view.alerts))
    file = folder / "recorded" / str(run.summary["recording"]["file"])
    alerts = [one.value.said for one in McapReader(file).messages() if one.schema == "tega.Alert"]
    assert any(words in one for one in alerts)


@pytest.mark.raises("link")
def test_a_robot_that_is_gone_is_an_alert(tmp_path: Path) -> None:
    led(tmp_path, "", lambda robot: robot.process.kill(), "link: no word from robot")


@pytest.mark.raises("station")
def test_an_alert_of_the_robot_is_one_at_the_operator_s(tmp_path: Path) -> None:
    pytest.importorskip("pylsl", reason="needs the extra lsl")
    more = '\n[markers]\nlsl_in = "tega-test-nobody-there"\n'
    led(tmp_path, more, lambda _: None, "robot: markers: no stream called 'tega-test-nobody-there'")


@pytest.mark.raises("sending")
def test_a_transport_that_refuses_is_an_alert(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_robot: Program) -> None:
        def put(*_: Any) -> None:
            raise RuntimeError("the transport is gone")

        monkeypatch.setattr(Link, "_put", put)

    led(tmp_path, "", refuse, "were not sent: the transport is gone")
