# mypy: allow-untyped-defs, allow-incomplete-defs, allow-untyped-calls, allow-untyped-decorators
"""The view in the browser, without a browser: the slot, the counters, the buttons, what is refused, what is drawn."""

from __future__ import annotations

import re
from contextlib import suppress
from socket import create_connection
from typing import cast, get_args
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import msgspec
import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from reference.moments import SHAPES, Moments
from reference.processes import until
from tega.errors import InvalidValueError
from tega.haptics import vest_frame
from tega.safety.states import State
from tega.ui.view.browser import BrowserView, Controls
from tega.ui.view.browser import state_html as html
from tega.ui.view.browser.charts import drives
from tega.ui.view.browser.pictures import EDA_BLUE, GAP, PEAK_GREEN, TILE_HEIGHT, TILE_WIDTH, TouchSheet
from tega.ui.view.browser.scene import Scene
from tega.ui.view.browser.vest import vest_svg
from tega.ui.view.run_state import ContactLabels, RateMeter
from tega.ui.view.state import EmgTail, ShapeKind


@pytest.fixture(scope="module")
def moments() -> Moments:
    return Moments()


def test_the_slot_keeps_the_newest_moment_and_counts_those_it_drops(moments):
    view = BrowserView(port=0)
    for k in range(5):
        view.offer(moments.at(k / 30, images=False))
    assert (view.n_offered, view.n_painted, view.n_dropped) == (5, 0, 4)
    with view:
        until(lambda: "0.1 s" in view.page.status.content)  # the fifth moment, 0.133 s
    assert (view.n_offered, view.n_painted, view.n_dropped) == (5, 1, 4)


def test_no_rate_is_below_zero_when_the_next_run_counts_from_zero():
    meter, rates = RateMeter(), []
    for second, count in enumerate((0, 30, 60, 5, 35)):
        meter.take(float(second), {"vest": count})
        rates.append(meter.rates_hz.get("vest"))
    assert rates == [None, 30.0, 30.0, 30.0, 30.0]


def test_the_run_s_state_stands_first_with_the_reason_of_a_hold(moments):
    snapshot = moments.at(1.0, images=False)

    def displayed(view: BrowserView, **state) -> str:
        devices = frozenset({"emg", "hand", "vest"})
        view.offer(snapshot._replace(loop=snapshot.loop._replace(devices=devices, **state)))
        wanted = state["state"].upper()
        until(lambda: wanted in view.page.run_state.content)
        content: str = view.page.run_state.content
        return content

    with BrowserView(port=0) as view:
        view.offer(snapshot)
        until(lambda: "1.0 s" in view.page.status.content)
        assert "border-radius" not in view.page.run_state.content  # nobody guards it, so it has no state
        held = displayed(
            view, state="hold", reason="emg: no signal for <0.5 s", alerts=("index: no picture",)
        )
        assert "the hand keeps its level" in held
        assert "<b>emg: no signal for &lt;0.5 s</b>" in held
        assert "! index: no picture" in held
        again = displayed(view, state="active", reason="all devices ready again")
        assert "all devices ready" not in again
        assert "the muscles steer the hand" in again
        assert "waiting for the start" in displayed(view, state="armed", reason="all devices ready")
        assert "emg: no signal yet" in displayed(view, state="idle", reason="emg: no signal yet")
        view.offer(snapshot._replace(loop=snapshot.loop._replace(state="stopped", reason="stopped: Ctrl-C")))
    # The page stays open when nobody serves it any more: it must not go on saying that the hand moves.
    assert "STOPPED" in view.page.run_state.content
    assert "Ctrl-C" in view.page.run_state.content


def test_a_moment_that_cannot_be_painted_is_told_and_the_next_one_is_painted(moments):
    state = moments.at(1.0)
    guarded = state._replace(loop=state.loop._replace(state="hold", reason="emg: silent"))
    with BrowserView(port=0) as view:
        view.offer(guarded._replace(poses=state.poses[:4]))
        until(lambda: bool(view.problem))
        assert "poses have shape (4, 7)" in view.problem
        until(lambda: "could not be shown" in view.page.run_state.content)
        assert "HOLD" in view.page.run_state.content  # which needs no scene
        view.offer(moments.at(2.0))
        until(lambda: "2.0 s" in view.page.status.content)
        assert view.painting
    assert view.problem.startswith("1 moments could not be shown, at last: ShapeError: ")


def test_a_run_that_stands_still_is_told_to_be_until_it_ends(moments):
    snapshot = moments.at(1.0, images=False)
    snapshot = snapshot._replace(loop=snapshot.loop._replace(state="active"))
    with BrowserView(port=0) as view:
        view.offer(snapshot)
        until(lambda: "ACTIVE" in view.page.run_state.content)
        # What the browser does alone: unless it is painted afresh the words appear, and the state's colour goes.
        assert '<b class="tega-late">no news from the run for <span>' in view.page.run_state.content
        assert 'class="tega-badge"' in view.page.run_state.content
        until(lambda: "no news from the run for 2 s" in view.page.run_state.content)
        view.offer(snapshot)
        until(lambda: "2 s" not in view.page.run_state.content)
        view.offer(snapshot._replace(loop=snapshot.loop._replace(state="stopped", reason="stopped: Ctrl-C")))
        until(lambda: "STOPPED" in view.page.run_state.content)
        assert "no news" not in view.page.run_state.content
        assert "tega-badge" not in view.page.run_state.content


def test_every_text_of_the_page_is_legible(moments):
    def luminance(colour: str) -> float:
        shares = np.frombuffer(bytes.fromhex(colour), np.uint8) / 255
        return float(((shares + 0.055) / 1.055) ** 2.4 @ [0.2126, 0.7152, 0.0722])

    state = moments.at(2.5, images=False)
    old = state._replace(t_ns=10**11, loop=state.loop._replace(fingers=("thumb", "palm")))
    parts = (html.lights_html, html.status_html, lambda one: html.captions_html(one, ContactLabels()))
    texts = [part(one) for part in parts for one in (state, old)]
    texts += [html.run_state_html(state.loop._replace(state=name), problem="x") for name in get_args(State)]
    for style in re.findall(
        r"(?:style=|<text)([^>]*)>", "".join(texts) + html.rates_html({}) + vest_svg(None)
    ):
        ground = re.search(r"background:#(\w{6})", style)
        for ink in re.findall(r'(?<![-\w])(?:color:|fill=")#(\w{6})', style):
            dark, light = sorted(map(luminance, (ink, ground[1] if ground else "ffffff")))
            assert (light + 0.05) / (dark + 0.05) >= 4.5, style


@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.1.7", "::", "example.org"])
def test_refuses_to_serve_others(host):
    with pytest.raises(InvalidValueError, match="served to this machine only"):
        BrowserView(host=host)
    BrowserView(host=host, allow_remote=True)
    for port in (70_000, -1):
        with pytest.raises(InvalidValueError):
            BrowserView(port=port)
    with pytest.raises(InvalidValueError, match=r"at 203\.0\.113\.7, port 8080: .* address of this"):
        BrowserView(host="203.0.113.7", allow_remote=True).__enter__()


def websocket(view: BrowserView, **options):
    import viser

    path = options.pop("path", view.url)
    return connect(
        path.replace("http", "ws"),
        subprotocols=[Subprotocol(f"viser-v{viser.__version__}")],
        max_size=None,
        **options,
    )


def test_only_pages_of_this_server_with_its_token_can_connect():
    with BrowserView(port=0) as view:
        own = view.url.rpartition("/")[0].rpartition("/")[0]
        port = own.rpartition(":")[2]
        with websocket(view, origin=own) as page:
            assert page.recv()
        for origin in (
            "http://example.org", "http://127.0.0.1.example.org", f"{own}.example.org", "http://localhost:9999",
            "http://127.0.0.1:9999", f"http://localhost:{port}", "null",
        ):  # fmt: skip
            with pytest.raises(InvalidStatus, match="403"), websocket(view, origin=origin):
                pass
        for path in ("", "/", "/guess/", view.url[-24:-2], "//"):
            with pytest.raises(InvalidStatus, match="403"), websocket(view, path=f"{own}{path}"):
                pass
        with pytest.raises(HTTPError, match="403"):
            urlopen(Request(view.url, headers={"Host": f"rebound.example.org:{port}"}))
        with urlopen(view.url) as got:
            assert got.status == 200
        with pytest.raises(HTTPError, match="403"):
            urlopen(f"{own}/")


@pytest.mark.parametrize(
    "text",
    [
        b"\xff\xfe", "text", b"", msgspec.msgpack.encode([1]), msgspec.msgpack.encode({"type": "Nope"}),
        msgspec.msgpack.encode({"type": "GuiUpdateMessage"}),
        msgspec.msgpack.encode({"type": "GuiUpdateMessage", "uuid": 7, "updates": 3}),
        msgspec.msgpack.encode({"type": "GuiUpdateMessage", "uuid": "nobody", "updates": {"value": 1}}),
        msgspec.msgpack.encode({"type": "ViewerCameraMessage", "wxyz": "a"}),
        ("object", "no such thing"), ("object", 7), ("haptics", "x"), ("pause", [1]), ("stop", {}),
    ],
)  # fmt: skip
def test_a_malformed_message_prints_nothing_and_harms_nobody(text, capfd, recwarn):
    controls = Controls(can_pause=True, can_mute=True, objects=("bottle", "bag"))
    with BrowserView(port=0, controls=controls) as view:
        for head, answer in ((b"\xff", b""), (b"GET /\xff HTTP/1.1\r\nHost: 127.0.0.1", b"HTTP/1.1 403")):
            with create_connection(("127.0.0.1", view._server.get_port())) as stranger:
                stranger.sendall(head + b"\r\n\r\n")
                assert stranger.recv(12) == answer
        with websocket(view) as socket:
            check(socket)
            if isinstance(text, tuple):
                press(socket, view.page.inputs[text[0]], text[1])
            else:
                socket.send(text)
            with suppress(ConnectionClosed):
                notify(socket, "ShareUrlRequest")
        with websocket(view) as socket:
            check(socket)
            press(socket, view.page.inputs["stop"], True)
            until(lambda: controls.stopped)
        assert view.painting
    assert capfd.readouterr() == ("", "")
    assert not recwarn.list


def notify(socket, kind: str, **fields) -> None:
    socket.send(msgspec.msgpack.encode({"type": kind, **fields}))


def check(socket) -> None:
    """Say where the camera is: only then does viser count a page as connected."""
    notify(
        socket, "ViewerCameraMessage", wxyz=(1, 0, 0, 0), position=(1, 1, 1), fov=1.0, near=0.1, far=10.0,
        image_height=600, image_width=800, look_at=(0, 0, 0), up_direction=(0, 0, 1),
    )  # fmt: skip


def press(socket, handle, value) -> None:
    notify(socket, "GuiUpdateMessage", uuid=handle._impl.uuid, updates={"value": value})


def test_buttons_set_what_the_program_looks_at():
    controls = Controls(can_pause=True, can_mute=True, objects=("bottle", "bag"))
    with BrowserView(port=0, controls=controls) as view, websocket(view) as socket:
        check(socket)
        inputs = view.page.inputs
        assert (controls.stopped, controls.paused, controls.haptics, controls.take_object()) == (
            False, False, True, None,
        )  # fmt: skip
        press(socket, inputs["object"], "bag")
        until(lambda: controls.take_object() == "bag")
        assert controls.take_object() is None
        press(socket, inputs["haptics"], False)
        until(lambda: not controls.haptics)
        press(socket, inputs["haptics"], True)
        until(lambda: controls.haptics)
        press(socket, inputs["pause"], True)
        until(lambda: controls.paused)
        until(lambda: inputs["pause"].label == "Go on")
        press(socket, inputs["stop"], True)
        until(lambda: controls.stopped)
        assert not controls.paused


def test_what_a_run_cannot_do_is_not_offered():
    with BrowserView(port=0) as view:
        assert set(view.page.inputs) == {"stop"}
    controls = Controls()
    controls.paused, controls.haptics = True, False
    assert (controls.paused, controls.haptics) == (False, True)
    with pytest.raises(InvalidValueError, match="'cup' is not one of none"):
        controls.choose("cup")


def test_a_new_set_of_shapes_takes_the_place_of_the_old(moments):
    with BrowserView(port=0) as view:
        scene: Scene = view.page.scene
        state = moments.at(1.0)
        scene.draw(state.shapes, state.poses, state.contact_points)
        before = [handle for handle, _ in scene.solids.batches]
        scene.draw(state.shapes, state.poses, None)
        assert [handle for handle, _ in scene.solids.batches] == before
        scene.draw(SHAPES[:1], state.poses[:1], None)
        assert [handle.name for handle, _ in scene.solids.batches] == ["/world/box"]
        scene.draw(None, None, None)
        assert scene.solids.batches == []
        with pytest.raises(InvalidValueError, match="'cup' is a 'cone'"):
            scene.draw([("cup", cast("ShapeKind", "cone"), (1, 1, 1), (1, 1, 1, 1))], np.zeros((1, 7)), None)


def test_the_touch_map_has_its_marks_where_the_contact_is(moments):
    state = moments.at(2.5)
    finger = state.images["index"]
    sheet = TouchSheet().draw({"index": finger})
    left = TILE_WIDTH + GAP
    assert np.unique(sheet[:, :TILE_WIDTH].reshape(-1, 3), axis=0).tolist() == [[236] * 3, [255] * 3]
    tile = sheet[TILE_HEIGHT + GAP :, left : left + TILE_WIDTH]
    contact = finger.contact
    assert np.count_nonzero(finger.map.mask) == contact.eda > 1000
    scale = np.array([TILE_WIDTH / 240, TILE_HEIGHT / 320])
    for colour, middle, radius in (
        (PEAK_GREEN, contact.peak_xy, 7.0),
        (EDA_BLUE, contact.centroid_xy, np.sqrt(contact.eda / np.pi * scale.prod())),
    ):
        y, x = np.nonzero((tile == colour).all(axis=2))
        assert len(x) > 10
        distance = np.hypot(x - middle[0] * scale[0], y - middle[1] * scale[1])
        assert np.median(distance) == pytest.approx(radius, abs=2.0)
    grey = (tile[..., 0] == tile[..., 1]) & (tile[..., 1] == tile[..., 2])
    assert grey.mean() > 0.8


def test_fingers_of_other_names_are_shown_in_lines_of_four(moments):
    state = moments.at(2.5)
    names = ["left_palm", "left_thumb", "right_palm", "right_thumb", "index"]
    sheet = TouchSheet().draw({"index": state.images["index"]}, names)
    line = 2 * (TILE_HEIGHT + GAP)
    assert sheet.shape == (2 * line - GAP, 4 * (TILE_WIDTH + GAP) - GAP, 3)
    assert (sheet[line:, :TILE_WIDTH] != 236).any()
    assert np.unique(sheet[:line]).tolist() == [236, 255]
    loop = state.loop._replace(fingers=names)
    captions = html.captions_html(state._replace(loop=loop), ContactLabels())
    assert captions.count("</tr>") == 2
    assert [captions.count(f"<b>{name}</b>") for name in names] == [1] * 5
    drawing = vest_svg(None, names="1234")
    assert drawing.count(">4</text>") == 2
    assert ">thumb</text>" not in drawing


@pytest.mark.parametrize(("layout", "motors"), [("paper32", 32), ("x40", 40), ("x16", 16)])
def test_the_vest_has_a_disc_a_motor(layout, motors):
    drawing = vest_svg(vest_frame([80, 0, 40, 20], [10, 0, 100, 55], layout=layout))
    assert drawing.count("<circle") == motors
    per_column = motors // 8
    assert drawing.count(">80</text>") == per_column
    assert drawing.count(">100</text>") == per_column
    assert vest_svg(None).count("<circle") == 40


def test_drives_are_the_share_of_the_maximum():
    held = np.tile([0.5, 1.0, 3.0], (3000, 1))
    tail = EmgTail(held, 1000.0, np.array([1.0, 4.0, 3.0]), "envelope")
    np.testing.assert_allclose(drives(tail)[-1], [0.5, 0.25, 1.0], rtol=1e-6)
    swinging = EmgTail(10 + held * [[(-1.0) ** k] for k in range(3000)], 100.0, tail.maxima, "raw")
    np.testing.assert_allclose(drives(swinging)[-1], [0.5, 0.25, 1.0], rtol=1e-6)
