"""A run over WebSocket: its records come out, one client leads the hand under the limits, and the rest is refused."""

from __future__ import annotations

import json
import math
import re
import shutil
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any, Self

import numpy as np
import pytest

pytest.importorskip("websockets", reason="needs the extra websocket")

from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

from reference.chromium import launched
from reference.parts import Running
from reference.processes import until
from reference.sessions import tree
from tega.config import check_tree
from tega.errors import ConfigError, DeviceUnavailableError
from tega.loop import run_session
from tega.recording.mcap_reader import McapReader
from tega.records import Contact, EmgSamples, Intent
from tega_websocket.commands import Commands
from tega_websocket.messages import MessageError, decode, encode_record

CLIENT = Path(__file__).parents[2] / "examples" / "websocket_client.js"
MS = 1_000_000


def settings(folder: Path | None = None, **table: Any) -> dict[str, Any]:
    """Return a bench in real time: two synthetic fingertips, a hand on a virtual bus, and no muscles."""
    given = tree(folder or Path(), lossless=False) | {
        "session": {"pace": "real"},
        "hand": {"driver": "python-can", "options": {"interface": "virtual", "channel": "websocket"}},
        "websocket": {"port": 0, "hand": True} | table,
    }
    del given["emg"]
    given["tactile"]["thumb"] = {"driver": "synthetic-touch", "options": {"duration_s": 20.0}}
    if folder is None:
        del given["recording"]
    return given


class Run(Running):
    """A run in a thread, with its address."""

    def __init__(self, tree: dict[str, Any]) -> None:
        super().__init__(check_tree(tree, {}, base=Path.cwd()).config)
        self.url = ""

    def __enter__(self) -> Self:
        super().__enter__()
        until(lambda: any(text.startswith("websocket: ") for text in self.notices))
        self.url = next(text for text in self.notices if text.startswith("websocket: "))[len("websocket: ") :]
        return self


class Peer:
    """A client by the library's own side: newest state, and every other message."""

    def __init__(self, url: str, **more: Any) -> None:
        self._socket: ClientConnection = connect(url, close_timeout=0.2, **more)
        self.state: dict[str, Any] = {"t_ns": None}
        self.seen: list[dict[str, Any]] = []

    def __enter__(self) -> Peer:
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def send(self, **message: Any) -> None:
        self._socket.send(json.dumps(message))

    def receive(self) -> dict[str, Any]:
        message: dict[str, Any] = json.loads(self._socket.recv(5))
        if message["type"] == "State":
            self.state = message
        else:
            self.seen.append(message)
        return message

    def follow(self, wanted: Callable[[], object], **command: Any) -> None:
        """Send a command at every state until something is so."""
        end_s = time.monotonic() + 20
        while not wanted():
            assert time.monotonic() < end_s, self.state
            if self.receive()["type"] == "State" and self.state["t_ns"] is not None and command:
                self.send(t_ns=self.state["t_ns"], **command)

    def refusal(self) -> str:
        while (message := self.receive())["type"] != "Refused":
            pass
        return str(message["why"])


@pytest.fixture(scope="module")
def run() -> Iterator[Run]:
    with Run(settings()) as running:
        yield running


@pytest.mark.slow
def test_the_example_client_closes_the_hand_and_lets_go(tmp_path: Path) -> None:
    with Run(settings(tmp_path)) as running:
        sentence = played(running.url)
        summary = running.end()
    assert sentence[0].startswith("TEGA ")
    assert sentence[0].endswith("may lead: hand")
    assert sentence[-1] == "closed with 1005", sentence
    assert not [line for line in sentence if "refused" in line]
    assert any(line.startswith("/touch/events") or "/event" in line for line in sentence), sentence
    counts = summary["websocket"]
    assert (counts["clients"], counts["markers"], counts["refused"]) == (1, 1, {})
    messages = list(McapReader(tmp_path / summary["recording"]["file"]).messages())
    closures = [m.value.closure for m in messages if m.topic == "/emg/levels"]
    assert closures[-1] == 1.0
    assert closures == sorted(closures)
    assert [m.value.text for m in messages if m.topic == "/markers"] == ["closed"]
    states = [m.value.state for m in messages if m.topic == "/run/state"]
    assert states[states.index("active") :][:2] == ["active", "hold"]


def played(url: str) -> list[str]:
    """Return what the example prints, by Node where it is there, else in the browser."""
    if node := shutil.which("node"):
        is_new = int(subprocess.check_output([node, "--version"])[1:3]) >= 22
        words = [node, *([] if is_new else ["--experimental-websocket"]), str(CLIENT), url]
        return subprocess.check_output(words, text=True, timeout=60).splitlines()
    printed: list[str] = []
    origin = url.replace("ws://", "http://").rpartition("/")[0]
    with launched() as browser:
        page = browser.new_page()
        page.expose_function("print", printed.append)
        # A page of the server's own address, which it lets connect.
        page.route(f"{origin}/page*", lambda route: route.fulfill(body="<p>", content_type="text/html"))
        page.goto(f"{origin}/page?url={url}")
        page.add_script_tag(path=str(CLIENT))
        until(lambda: any(line.startswith("closed with") for line in printed))
    return printed


@pytest.mark.slow
@pytest.mark.raises("websocket")
def test_the_hand_holds_without_commands_and_no_second_client_leads(run: Run) -> None:
    with Peer(run.url) as first, Peer(run.url) as second:
        first.follow(lambda: first.state.get("state") == "active", type="Hand", level=4)
        second.follow(lambda: second.state["t_ns"] is not None)
        second.send(type="Hand", t_ns=second.state["t_ns"], level=5)
        assert second.refusal() == "not leading: client 1 leads"
        first.follow(lambda: first.state["state"] == "hold")  # no more commands
        assert "no level from client 1" in first.state["reason"]
        first.send(type="Release")
        second.follow(lambda: second.state["state"] == "active", type="Hand", closure=0.25)
        assert [m for m in first.seen if m["type"] == "Record" and m["name"] == "Contact"]


@pytest.mark.parametrize(
    ("message", "why"),
    [
        ("nonsense", "JSON is malformed"),
        ('{"type": "Mark", "text": ' + "[" * 3000, "Expected `str`"),
        ('{"type": "Vest", "intensities": [100]}', "Invalid value 'Vest'"),
        ('{"type": "Hand", "t_ns": 0, "level": 6}', "<= 5"),
        ('{"type": "Hand", "t_ns": 0, "closure": 1.01}', "<= 1"),
        ('{"type": "Hand", "t_ns": 0, "closure": NaN}', "malformed"),
        ('{"type": "Hand", "t_ns": 0}', "either level"),
        ('{"type": "Hand", "t_ns": 0, "level": 2, "force": 9}', "unknown field"),
        ('{"type": "Arm", "t_ns": 0, "position_m": [0,0,0], "quaternion_xyzw": [0,0,0,0.5]}', "unit length"),
        (b"\xff\xfe", "malformed"),
    ],
)
def test_a_message_that_cannot_be_read_is_refused_with_the_reason(message: Any, why: str) -> None:
    with pytest.raises(MessageError, match=re.escape(why)):
        decode(message)


@pytest.mark.slow
def test_a_message_that_cannot_be_obeyed_is_answered_with_the_reason(run: Run) -> None:
    hand = {"type": "Hand", "level": 2}
    arm = {"type": "Arm", "position_m": [0] * 3, "quaternion_xyzw": [0, 0, 0, 1]}
    with Peer(run.url) as peer:
        peer.follow(lambda: (peer.state["t_ns"] or 0) > 300 * MS)
        for message, why in (
            (hand | {"t_ns": 2**53}, "ahead: "),
            (hand | {"t_ns": 0}, "old: "),
            (arm | {"t_ns": 0}, "not allowed: "),
        ):
            peer.send(**message)
            assert why in peer.refusal()
        for _ in range(1000):
            peer.send(type="Mark", text="x" * 1000)
        assert "too many markers: " in peer.refusal()


@pytest.mark.slow
def test_a_taken_port_wrong_token_other_sites_long_messages_and_idle_peers_are_refused(run: Run) -> None:
    base, _, token = run.url.rpartition("/")
    with pytest.raises(DeviceUnavailableError, match="cannot be served"):
        run_session(check_tree(settings(port=int(base.rpartition(":")[2])), {}, base=Path.cwd()).config)
    for url in (base, f"{base}/", f"{base}/{token[:-1]}", f"{base}/x/{token}"):
        with pytest.raises(InvalidStatus, match="403"):
            connect(url)
    for origin in ("http://evil.example", "null", "https://127.0.0.1.evil.example"):
        with pytest.raises(InvalidStatus, match="403"):
            connect(run.url, origin=Origin(origin))
    with ExitStack() as idle, connect(run.url, origin=Origin(base.replace("ws", "http", 1))) as own:
        assert json.loads(own.recv(5))["type"] == "Welcome"
        address = ("127.0.0.1", int(base.rpartition(":")[2]))
        peers = [idle.enter_context(socket.create_connection(address, timeout=2)) for _ in range(200)]
        assert peers[0].recv(1) == b""  # long before its handshake is late; who has shaken hands stays
        peers[-1].sendall(b"GET /\xff HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        assert b" 403 " in peers[-1].recv(100)
        own.send("x" * 5000)
        with pytest.raises(ConnectionClosed, match="1009"):
            list(own)


@pytest.mark.slow
def test_a_slow_client_loses_the_oldest_and_nobody_else_anything(tmp_path: Path) -> None:
    with Run(settings(tmp_path, buffer=128, pictures_hz=60)) as running, Peer(running.url) as quick:
        slow = connect(running.url, max_queue=1, close_timeout=0.2)
        quick.follow(lambda: (quick.state["t_ns"] or 0) > 6e9)
        assert quick.state["dropped"] == 0
        jpeg = next(m["fields"]["jpeg"] for m in quick.seen if m.get("name") == "Frame")
        assert jpeg.startswith("/9j/")
        dropped, end_s = 0, time.monotonic() + 20
        while not dropped and time.monotonic() < end_s:
            dropped = json.loads(slow.recv(5)).get("dropped", 0)
        assert dropped > 0
        slow.close()
        assert running.end()["recording"]["dropped"] == {}


EMG = {"driver": "synthetic-emg", "kind": "raw", "options": {"duration_s": 1.0}}


@pytest.mark.parametrize(
    ("table", "more", "sentence"),
    [
        ({"host": "0.0.0.0"}, {}, "token_file is not set"),
        ({"arm": True}, {}, "there is no [arm]"),
        ({"token_file": "no-such"}, {}, "cannot be read"),
        ({"token_file": "short"}, {}, "has 5 characters"),
        ({}, {"emg": EMG}, "[emg] both lead the hand"),
        ({}, {"session": {"pace": "fast"}}, "need real time"),
    ],
)
def test_settings_that_do_not_fit_are_refused(
    tmp_path: Path, table: dict[str, Any], more: dict[str, Any], sentence: str
) -> None:
    (tmp_path / "short").write_text("abcde\n")
    with pytest.raises(ConfigError, match=re.escape(sentence)):
        run_session(check_tree(settings(**table) | more, {}, base=tmp_path).config)


def test_a_command_lapses_while_it_waits_and_a_new_leader_presses_the_clutch_itself() -> None:
    now, start = [1010 * MS], 1000 * MS
    commands = Commands(ttl_ms=100, hand=True, arm="x", clock=lambda: now[0])
    commands.begin(start, None)
    stream = commands.muscles().stream
    assert stream is not None
    commands.obey(1, decode('{"type": "Hand", "t_ns": 0, "level": 5}'))  # type: ignore[arg-type]
    now[0] += 91 * MS  # 91 ms in here, but 101 ms since the time that the client had received
    assert stream.next_until(now[0] - start) is None
    assert "no level from client 1" in commands.missing()
    arm = '{"type": "Arm", "t_ns": %d, "position_m": [0,0,0], "quaternion_xyzw": [0,0,0,1], "clutch": %s}'

    def clutch() -> bool:
        return bool(commands.seats()["clutch"].source.state().held)

    for client in (1, 2):
        commands.obey(client, decode(arm % (now[0] - start, "true")))  # type: ignore[arg-type]
        assert not clutch()
        commands.obey(client, decode(arm % (now[0] - start, "false")))  # type: ignore[arg-type]
        commands.obey(client, decode(arm % (now[0] - start, "true")))  # type: ignore[arg-type]
        assert clutch()
        commands.release(client)
        assert not clutch()


def test_a_record_is_json_with_the_names_of_a_recording() -> None:
    contact = json.loads(encode_record(Contact(finger="thumb", t_ns=5, in_contact=True, cci_norm=math.nan)))
    assert contact["type"] == "Record"
    assert contact["topic"] == "/tactile/thumb/contact"
    assert contact["fields"]["cci_norm"] is None
    assert {"centroid_x", "centroid_y"} <= set(contact["fields"])
    samples = EmgSamples(t_ns=1, received_ns=1, first_index=0, n_channels=2, samples=np.array([0.5, -1.0]))
    assert json.loads(encode_record(samples))["fields"]["samples"] == [0.5, -1.0]
    intent = json.loads(encode_record(Intent(t_ns=1, level=3)))
    assert (intent["name"], intent["fields"]["fused"]) == ("Levels", 3)


@pytest.mark.slow
def test_a_client_leads_the_arm_while_it_holds_dead_man_and_clutch() -> None:
    arm = {
        "session": {"pace": "real"},
        "arm": {"driver": "simulated-arm"},
        "websocket": {"port": 0, "arm": True, "ttl_ms": 1500},
    }
    with Run(arm) as running, Peer(running.url) as peer:

        def lead(wanted: Callable[[], object], x: float, *, clutch: bool) -> None:
            held = {"dead_man": True, "clutch": clutch}
            peer.follow(wanted, type="Arm", position_m=[x, 0, 0], quaternion_xyzw=[0, 0, 0, 1], **held)

        def where() -> tuple[float, ...]:
            return tuple(peer.state["arm_hand_m"])

        def later(t_ns: int) -> bool:
            return bool(peer.state["t_ns"] > t_ns)

        lead(lambda: "clutch is open" in peer.state.get("arm", ""), 0.0, clutch=False)
        lead(lambda: peer.state["arm"].startswith("following"), 0.0, clutch=True)
        before = where()
        for step in range(21):
            lead(partial(later, peer.state["t_ns"]), step * 0.002, clutch=True)
        lead(lambda: math.dist(where(), before) > 0.02, 0.04, clutch=True)
        assert math.dist(where(), before) < 0.06
        peer.follow(lambda: not peer.state["arm"].startswith("following"))
        peer.send(type="Vest")
        assert "Invalid value 'Vest'" in peer.refusal()
        assert running.end()["websocket"]["refused"] == {"malformed": 1}
