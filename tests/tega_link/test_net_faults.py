"""What two stations do when what is between them, or one of them, fails; both are programs of their own."""

from __future__ import annotations

import socket
import sys
import threading
import time
from collections.abc import Iterator

import pytest

pytest.importorskip("zenoh", reason="needs the extra net")

from tega_campaigns.impaired import ImpairedLink
from tega_campaigns.runner import until
from tega_campaigns.station_scene import StationScene

pytestmark = pytest.mark.slow

needs_posix = pytest.mark.skipif(sys.platform == "win32", reason="needs Linux or macOS")

# Ten times what the stations state, for a machine that does much else.
_HOLD_S, _NO_DATA_S = 1.0, 5.0
_PATIENCE_S = 60.0


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Iterator[StationScene]:
    # So long a lease that a link outlives its silence, and all that waited in it comes at once.
    with StationScene(tmp_path_factory.mktemp("stations"), net={"lease_ms": 10_000.0}) as scene:
        yield scene


def _first(changes: list[tuple[float, object]], begun_s: float, *wanted: object) -> float:
    """Return how long after a time something became one of what is wanted."""
    return next((t_s - begun_s for t_s, subject in changes if subject in wanted), float("inf"))


@needs_posix
def test_nothing_of_what_waited_in_a_stall_is_used(scene: StationScene) -> None:
    begun_s = time.monotonic()
    old = scene.robot.now["refused"].get("old", 0)
    scene.link.stall()
    time.sleep(2.5)
    scene.link.resume()
    came = until(lambda: scene.robot.now["refused"].get("old", 0) > old + 20, _PATIENCE_S)
    assert came is not None
    assert until(scene.ready, _PATIENCE_S) is not None
    assert _first(scene.robot.since(begun_s, "state"), begun_s, "hold") < _HOLD_S
    assert scene.robot.now["stale"] == 0
    assert scene.robot.now["arm"].startswith("stopped")  # however well the link is again


@needs_posix
def test_a_frozen_operator_leaves_hand_and_arm_held(scene: StationScene) -> None:
    scene.take_hold()
    begun_s = time.monotonic()
    scene.operator.hold_up(on=True)
    try:
        let_go = until(
            lambda: scene.robot.now["state"] == "idle" and "stopped" in scene.robot.now["arm"], _PATIENCE_S
        )
        assert let_go is not None
    finally:
        scene.operator.hold_up(on=False)
    assert _first(scene.robot.since(begun_s, "state"), begun_s, "hold") < _HOLD_S
    arm = [(t_s, str(words).partition(":")[0]) for t_s, words in scene.robot.since(begun_s, "arm")]
    assert _first([*arm], begun_s, "holding", "idle") < _HOLD_S
    assert until(scene.ready, _PATIENCE_S) is not None
    assert scene.robot.now["stale"] == 0


@needs_posix
def test_a_cut_link_silences_the_vest_and_says_so(scene: StationScene) -> None:
    scene.take_hold()
    begun_s = time.monotonic()
    scene.link.cut()
    try:
        assert until(lambda: bool(scene.operator.now["no_data"]), _PATIENCE_S) is not None
        assert not scene.operator.now["felt"]
    finally:
        scene.link.mend()
    assert _first(scene.operator.since(begun_s, "no_data"), begun_s, True) < _NO_DATA_S
    assert until(scene.ready, _PATIENCE_S) is not None


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
