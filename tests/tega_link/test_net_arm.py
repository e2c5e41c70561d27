"""The arm over two stations, each a program of its own; and what they do when one, or what is between them, fails."""

from __future__ import annotations

import csv
import socket
import sys
import threading
import time
from collections.abc import Callable
from itertools import groupby
from pathlib import Path

import pytest

from reference.parts import Running

pytest.importorskip("zenoh", reason="needs the extra net")

from reference.net import Leader
from reference.processes import until
from tega.config import check_tree
from tega_campaigns.impaired import ImpairedLink
from tega_campaigns.station_scene import StationScene
from tega_emulators.lab import EmulatedLab, emulated_lab
from tega_emulators.stations import Program, free_port
from tega_link.messages import Refused, Welcome

pytestmark = [pytest.mark.slow, pytest.mark.skipif(sys.platform == "win32", reason="needs Linux or macOS")]

_DEAD_MAN, _CLUTCH, _RECOVER = 0, 1, 2
_ROBOT = """
[session]
out_dir = "out"
[net]
station = "robot"
listen = "tcp/127.0.0.1:{port}"
[arm]
driver = "simulated-arm"
"""


class Operator(Running):
    """An operator's run in a thread, with the lab's headset and SpaceMouse."""

    def __init__(self, lab: EmulatedLab, folder: Path, port: int) -> None:
        tracker, connect = lab.tree["arm"]["tracker"], f"tcp/127.0.0.1:{port}"
        net = {"station": "operator", "connect": connect, "tracker": tracker}
        super().__init__(check_tree({"net": net, "input": lab.tree["input"]}, {}, base=folder).config)
        self.lab = lab

    @property
    def arm(self) -> str:
        return self.view.arm

    def starts(self, words: str) -> None:
        until(lambda: self.arm.startswith(words))

    def gets(self, words: str) -> bool:
        """Return whether the arm comes to say so within a while."""
        end_s = time.monotonic() + 3.0
        while not (said := self.arm.startswith(words)) and time.monotonic() < end_s:
            time.sleep(0.01)
        return said

    def leads(self, then: Callable[[], object], words: str) -> None:
        """Take hold, do something and see what the arm says; anew if this machine stood still meanwhile."""
        for _ in range(10):
            self.lift(_DEAD_MAN, _CLUTCH)
            time.sleep(0.2)  # the arm's words are the same before: a lift of a few ms is in no message
            if not self.gets("idle: the clutch is open"):
                self.press(_RECOVER)
                self.lift(_RECOVER)
                continue
            self.press(_DEAD_MAN, _CLUTCH)
            if self.gets("following"):
                then()
                if self.gets(words):
                    return
        pytest.fail(f"never {words!r}, but {self.arm!r}")

    def press(self, *buttons: int) -> None:
        for button in buttons:
            self.lab.cap.say(f"press {button}")

    def lift(self, *buttons: int) -> None:
        for button in buttons:
            self.lab.cap.say(f"lift {button}")


def robot_at(folder: Path, port: int) -> Program:
    (folder / "robot.toml").write_text(_ROBOT.format(port=port), encoding="utf-8")
    return Program("robot", folder / "robot.toml")


def test_the_arm_follows_over_the_link_and_lets_go_with_its_operator(tmp_path: Path) -> None:
    port = free_port()
    with emulated_lab(tmp_path, arm=True) as lab, robot_at(tmp_path, port) as robot:
        robot.await_said("waits for an operator")
        with Operator(lab, tmp_path, port) as alice:
            alice.starts("idle")
            alice.press(_DEAD_MAN)
            alice.starts("idle: the clutch is open")
            alice.leads(lambda: alice.lift(_DEAD_MAN), "holding: the dead-man switch is released")
            lab.headset.say("wave 0.1 0.5")
            alice.leads(lambda: time.sleep(1.0), "following")
        # The next one begins with the clutch pressed, and has not taken hold.
        robot.await_said("is gone")
        with Operator(lab, tmp_path, port) as bob:
            bob.starts("idle: the clutch is open")
            bob.leads(lambda: None, "following")
        summary = robot.end()
    assert summary["arm"]["holds"] >= 3
    assert summary["net"]["leaders"] >= 2
    x_m = [float(row["target_x_m"]) for row in _rows(tmp_path) if row["target_x_m"]]
    assert max(x_m) - min(x_m) > 0.01


def test_an_operator_who_falls_silent_leaves_the_arm_held_then_loose_then_stopped(tmp_path: Path) -> None:
    port = free_port()
    with robot_at(tmp_path, port) as robot, Leader(port) as alice:
        refused = alice.join()
        assert isinstance(refused, Refused)
        assert "no dead-man switch" in refused.why
        refused = alice.join(dead_man=True, frame="unity")
        assert isinstance(refused, Refused)
        assert "wants poses in the axes 'openxr'" in refused.why
        assert isinstance(alice.join(dead_man=True, frame="openxr"), Welcome)
        until(lambda: alice.clocks > 0)

        def arm() -> str:
            return "" if alice.state is None else alice.state.arm

        def hold_on(words: str, **switches: bool) -> None:
            def reached() -> bool:
                again = "press it again" in arm()
                alice.lead_arm(**switches | ({"clutch": False} if again else {}))
                return arm().startswith(words)

            until(reached)

        hold_on("idle: the clutch is open", dead_man=True)
        hold_on("following", dead_man=True, clutch=True)
        until(
            lambda: arm().startswith("stopped: no pose came for more than 1000 ms")
        )  # nothing is said any more
        hold_on("stopped", dead_man=True, clutch=True)
        hold_on("idle", recover=True)
        robot.end()
    states = [state for state, _ in groupby(row["state"] for row in _rows(tmp_path))]
    last = len(states) - 1 - states[::-1].index("following")
    # The last one is the end of the run.
    assert states[last:] == ["following", "holding", "idle", "stopped", "idle", "stopped"]


def _rows(folder: Path) -> list[dict[str, str]]:
    with (folder / "out" / "arm.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_nothing_of_what_waited_in_a_stall_is_used(tmp_path: Path) -> None:
    # So long a lease that a link outlives its silence, and all that waited in it comes at once.
    with StationScene(tmp_path, net={"lease_ms": 10_000.0}) as scene:
        begun_s = time.monotonic()
        old = scene.robot.now["refused"].get("old", 0)
        scene.link.stall()
        time.sleep(2.5)
        scene.link.resume()
        until(lambda: scene.robot.now["refused"].get("old", 0) > old + 20)
        until(scene.ready)
        held_s = [t_s for t_s, state in scene.robot.since(begun_s, "state") if state == "hold"]
        # Ten times what the station states, for a machine that does much else.
        assert held_s[0] - begun_s < 1.0
        assert scene.robot.now["stale"] == 0
        assert scene.robot.now["arm"].startswith("stopped")  # however well the link is again


def test_what_a_link_keeps_back_comes_whole_and_in_order() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:

        def echo() -> None:
            there, _ = server.accept()
            with there:
                while data := there.recv(4096):
                    there.sendall(data)

        thread = threading.Thread(target=echo, daemon=True)
        thread.start()
        sent = bytes(range(256)) * 200
        with (
            ImpairedLink(server.getsockname()[1], delay_ms=1.0, jitter_ms=1.0, loss=0.05) as link,
            socket.create_connection(("127.0.0.1", link.port), timeout=60.0) as here,
        ):
            link.stall()
            here.sendall(sent)
            here.settimeout(0.2)
            with pytest.raises(TimeoutError):
                here.recv(1)
            link.resume()
            here.settimeout(60.0)
            came = b""
            while len(came) < len(sent):
                came += here.recv(4096)
        thread.join(5.0)
    assert came == sent
