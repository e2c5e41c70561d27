"""A run streamed live: a client of the public protocol hears what the bus tells, and the layout names what there is."""

from __future__ import annotations

import json
import re
import socket
import sys
from collections.abc import Callable, Iterator
from contextlib import nullcontext, suppress
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("foxglove", reason="needs the extra record")
pytest.importorskip("websockets", reason="needs the extra lab")

from reference.processes import until
from reference.sessions import tree
from tega.config import check_tree
from tega.errors import DeviceUnavailableError
from tega.loop import run_session
from tega.recording.mcap_schemas import decoder, schema_bytes
from tega.records import RECORDS, Contact, HandExchange, Joints, LogLine, Picture, Record, VestFrame
from tega.records.bus import Bus
from tega.records.schema import fields
from tega.ui.view import same_machine
from tega_viewers.foxglove_stream import FoxgloveStream

FINGER = "thumb"
PICTURE = Picture(
    finger=FINGER, image=np.zeros((32, 24, 3), np.uint8), t_ns=7, received_ns=7, seq=0, name="a picture"
)


class Viewer:
    """Speaks the app's protocol, as far as it takes to hear a topic."""

    def __init__(self, url: str) -> None:
        from websockets.sync.client import connect
        from websockets.typing import Subprotocol

        self.peer: Any = connect(url, subprotocols=[Subprotocol("foxglove.sdk.v1")])
        self.channels: dict[str, dict[str, Any]] = {}

    def advertised(self, topic: str) -> dict[str, Any]:
        while topic not in self.channels:
            sentence = self.peer.recv(timeout=30)
            if isinstance(sentence, str) and json.loads(sentence)["op"] == "advertise":
                self.channels |= {one["topic"]: one for one in json.loads(sentence)["channels"]}
        return self.channels[topic]

    def subscribe(self, topic: str) -> None:
        wanted = [{"id": 1, "channelId": self.advertised(topic)["id"]}]
        self.peer.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))

    def after(self, publish: Callable[[], object]) -> bytes:
        """Return the next message; what is published before the subscription has arrived is for nobody."""
        while True:
            publish()
            with suppress(TimeoutError):
                while not isinstance(sentence := self.peer.recv(timeout=0.05), bytes) or sentence[0] != 1:
                    pass
                return sentence[13:]


@pytest.fixture(scope="module")
def stream() -> Iterator[FoxgloveStream]:
    with FoxgloveStream(Bus(), port=0) as made:
        yield made


def place(stream: FoxgloveStream) -> tuple[str, int]:
    return "127.0.0.1", int(stream.url.rpartition(":")[2])


def test_a_viewer_hears_contacts_vest_and_pictures_as_they_come() -> None:
    bus = Bus()
    with FoxgloveStream(bus, port=0) as stream:
        reported: list[Record] = [
            Contact(finger=FINGER, t_ns=5_000_000, in_contact=True, cci_norm=0.25),
            VestFrame(t_ns=6_000_000, layout="x16", intensities=(7,) * 16),
            PICTURE,
        ]
        for record in reported:
            bus.publish(record)
        viewer = Viewer(stream.url)
        topic = f"/tactile/{FINGER}/contact"
        viewer.subscribe(topic)
        assert viewer.advertised(f"/tactile/{FINGER}/image")["schemaName"] == "foxglove.CompressedImage"
        assert viewer.advertised("/vest/frame")["schemaName"] == "tega.VestFrame"
        data = viewer.after(lambda: bus.publish(reported[0]))
        value = decoder("tega.Contact", schema_bytes()).FromString(data)
        assert (value.in_contact, value.cci_norm, value.t_ns) == (True, 0.25, 5_000_000)
        viewer.peer.close()
    bus.publish(reported[0])
    assert bus.problem() == ""


@pytest.mark.parametrize(
    ("headers", "is_served"),
    [
        ({}, True),
        ({"Origin": "https://app.foxglove.dev"}, True),
        ({"Origin": "file://"}, True),
        ({"Origin": "https://evil.example"}, False),
        ({"Host": "evil.example:8765"}, False),
    ],
)
def test_pages_of_other_sites_are_refused(stream, headers, is_served):
    fields = {"Host": stream.url.removeprefix("ws://"), **headers}
    with socket.create_connection(place(stream), timeout=10) as peer:
        peer.sendall(
            b"GET / HTTP/1.1\r\n"
            + b"".join(f"{name}: {value}\r\n".encode() for name, value in fields.items())
            + b"Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
            b"Sec-WebSocket-Protocol: foxglove.sdk.v1\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
        )
        answer = peer.recv(4096)
    assert answer.startswith(b"HTTP/1.1 101" if is_served else b"HTTP/1.1 403"), answer


def test_the_server_itself_is_at_no_address_that_a_page_would_try(stream: FoxgloveStream) -> None:
    address, port = stream._front._behind
    assert port != stream._front.port
    if sys.platform == "linux":
        assert re.match(r"127\.(?!0\.0\.1$)", address)


def test_who_says_too_little_or_too_much_is_dropped_and_who_reads_slowly_is_waited_for(stream, monkeypatch):
    with socket.create_server(("127.0.0.1", 0)) as behind:
        front, n = same_machine.SameMachine(0, behind=behind.getsockname()), 0
        with socket.create_connection(("127.0.0.1", front.port), timeout=10) as slow:
            slow.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")
            with behind.accept()[0] as server, suppress(TimeoutError):
                server.settimeout(1.0)  # so long after every buffer is full
                assert server.recv(4096).startswith(b"GET / ")
                while True:
                    n += server.send(bytes(65_536))
            assert sum(map(len, iter(lambda: slow.recv(65_536), b""))) == n
        front.close()
    monkeypatch.setattr(same_machine, "_HEAD_S", 0.2)
    with socket.create_connection(place(stream)) as slow, suppress(ConnectionError):
        until(lambda: not slow.send(b"x"))
    with socket.create_connection(place(stream), timeout=10) as flood:
        flood.sendall(b"GET / HTTP/1.1\r\nX: " + b"x" * 40_000)
        assert flood.recv(100).startswith(b"HTTP/1.1 403")


def test_pictures_are_compressed_for_who_listens_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    import cv2

    n_compressed: list[int] = []
    compress = cv2.imencode

    def counted(*given: Any) -> Any:
        n_compressed.append(1)
        return compress(*given)

    monkeypatch.setattr(cv2, "imencode", counted)
    bus = Bus()
    with FoxgloveStream(bus, port=0):
        for _ in range(200):
            bus.publish(PICTURE)
    assert len(n_compressed) == 1  # the first one makes the channel that an app may then choose
    with FoxgloveStream(bus, port=0) as stream:
        bus.publish(PICTURE)
        viewer = Viewer(stream.url)
        viewer.subscribe(f"/tactile/{FINGER}/image")
        # The first one heard may be the picture that made the channel: an app can choose it while that is compressed.
        for _ in range(2):
            viewer.after(lambda: bus.publish(PICTURE))
        viewer.peer.close()
    assert len(n_compressed) > 2


def test_a_hand_s_exchanges_are_not_made_for_the_stream() -> None:
    bus = Bus()
    with FoxgloveStream(bus, port=0):
        assert bus.wants(Contact)
        assert not bus.wants(HandExchange)


def test_a_run_is_the_same_with_and_without_the_stream(tmp_path: Path) -> None:
    given = tree(tmp_path / "recorded")
    del given["recording"]
    frames: list[list[VestFrame]] = [[], []]
    for k, received in enumerate(frames):
        bus = Bus()
        bus.subscribe(VestFrame, received.append)
        with FoxgloveStream(bus, port=0) if k else nullcontext():
            run_session(check_tree(given, {}, base=tmp_path).config, bus=bus)
        assert bus.problem() == ""
    first, second = ([(frame.t_ns, frame.intensities) for frame in received] for received in frames)
    assert first == second
    assert len(frames[0]) > 30


def test_a_port_that_is_taken_is_told(stream: FoxgloveStream) -> None:
    _, port = place(stream)
    with pytest.raises(DeviceUnavailableError, match=f"port {port} cannot be served"):
        FoxgloveStream(Bus(), port=port).__enter__()


def test_the_layout_names_topics_and_fields_that_there_are() -> None:
    text = (files("tega_viewers") / "foxglove-layout.json").read_text()
    layout = json.loads(text)
    kinds = {kind.topic.replace("{finger}", FINGER): kind for kind in RECORDS if kind.topic}
    named = re.findall(r'"(/[a-z]+/[a-z/]+|/log)(?:\.([a-z_]+))?', text)
    assert len(named) > 15
    for topic, field in named:
        kind = kinds[re.sub("index|middle|ring", FINGER, topic)]
        if field and kind not in {Joints, LogLine}:
            assert field in {one.name for one in fields(kind)}, (topic, field)

    def panels(part: Any) -> list[str]:
        return [part] if isinstance(part, str) else panels(part["first"]) + panels(part["second"])

    assert sorted(panels(layout["layout"])) == sorted(layout["configById"])
