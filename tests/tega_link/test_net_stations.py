# mypy: allow-untyped-defs, allow-incomplete-defs, allow-untyped-calls, allow-untyped-decorators
"""Two stations, each a program of its own, over real Zenoh on this machine, and the alerts of their link."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from threading import Event
from typing import Any

import msgspec
import pytest

from reference.parts import Given, Running
from tega.loop.controls import Controls

pytest.importorskip("zenoh", reason="needs the extra net")

from reference.net import Leader
from reference.processes import until
from tega.config import load_config
from tega.config.calibration import Calibration, TouchMaxima, load_calibration, save_calibration
from tega.errors import CalibrationError, ConfigError
from tega.loop import run_session
from tega.loop.inbox.inputs import Prepared
from tega.loop.snapshot import LoopView
from tega.recording.mcap_reader import McapReader
from tega.recording.replay import replay_file
from tega.records import Picture
from tega.records.bus import Bus
from tega.setup.calibration.wizard import parts_of
from tega_emulators.stations import Program, free_port, split, write_stations, write_trees
from tega_link.link import Channel, Link
from tega_link.messages import Refused, Welcome
from tega_link.part import open_station
from tega_link.settings import NetSection
from tega_link.touch import with_touch

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def port() -> int:
    return free_port()


@pytest.fixture(scope="module")
def files(port: int, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    return write_stations(tmp_path_factory.mktemp("stations"), port=port)


@pytest.fixture(scope="module")
def robot(files: tuple[Path, Path]) -> Iterator[Program]:
    with Program("robot", files[0]) as program:
        program.await_said("waits for an operator")
        yield program


def test_muscles_close_the_robot_s_hand_and_its_touch_and_pictures_come_back(robot, files) -> None:
    n_before = robot.said.count("is gone")
    seen: list[Picture] = []
    baselines: list[tuple[int, ...]] = []
    bus = Bus()
    bus.subscribe(Picture, seen.append)

    def watch(prepared: Prepared) -> Prepared:
        baselines.append(prepared.fingers["thumb"].baseline.shape)
        return prepared

    config = load_config(files[1], environ={}).config
    until_s = time.monotonic() + 60
    stop = Controls(stop=lambda: len(seen) > 4 or time.monotonic() > until_s)
    summary = run_session(config, bus=bus, controls=stop, parts=[Given(watch)])
    robot.await_said("operator 'operator' is gone", times=n_before + 1)
    assert summary["net"]["robot"] == "robot"
    assert summary["net"]["features"]["thumb"] > len(seen)
    assert summary["net"]["commands"] > 10
    assert abs(summary["net"]["clock"]["offset_ms"]) <= summary["net"]["clock"]["round_trip_ms"]
    assert summary["tactile"]["thumb"]["frames"] > 10
    assert summary["hand"]["sinks"] == ["net"]
    assert {frame.image.shape for frame in seen} == set(baselines)
    # A recording is read a second ahead, so its pictures are early; by our clock they are of about now.
    assert all(abs(frame.t_ns) < 60e9 for frame in seen)
    numbers = [frame.seq for frame in seen]
    assert numbers == sorted(set(numbers))


@pytest.mark.usefixtures("robot")
def test_one_operator_leads_and_a_second_is_told_by_whom(files, port) -> None:
    with Leader(port) as alice:
        assert isinstance(alice.join(), Welcome)
        assert isinstance(alice.join(), Welcome)  # who asks again is not somebody else
        with Program("operator", files[1]) as operator:
            assert operator.process.wait(60) == 3
            assert "robot 'robot' is led by 'alice' already" in operator.said
            assert "ask 'alice' to end" in operator.said
        refused = alice.join(session=78)
        assert isinstance(refused, Refused)
        with Leader(port, "bob") as bob:
            robot_s_own = bob.join(name="alice")
            assert isinstance(robot_s_own, Refused)
            assert "another name" in robot_s_own.why
    with Leader(port, "bob", session=79) as bob:
        until(lambda: isinstance(bob.join(), Welcome))


@pytest.mark.usefixtures("robot")
def test_only_commands_of_the_leader_in_order_and_young_are_obeyed(port) -> None:
    with Leader(port, session=80) as alice:
        assert isinstance(alice.join(), Welcome)
        until(lambda: alice.clocks > 0)
        time.sleep(0.1)

        def refused(why: str) -> int:
            return 0 if alice.state is None else alice.state.refused.get(why, 0)

        alice.say(10)
        alice.say(10)
        alice.say(9)
        alice.say(11, session=81)
        alice.say(12, age_ms=3000.0)
        alice.say(13, age_ms=-3000.0)
        alice.say(14, level=6)
        alice.say_raw(b"\xff\x00nonsense")
        alice.say_raw(msgspec.msgpack.encode({"type": "HandCommand", "session": "x"}))
        with Leader(port, "eve", session=80) as eve:  # the right number, from the wrong place
            eve.say(100)
            until(lambda: refused("foreign") == 2)
        expected = {"repeated": 1, "reordered": 1, "foreign": 2, "old": 1, "ahead": 1, "malformed": 3}
        until(lambda: all(refused(why) >= n for why, n in expected.items()))
        assert alice.state is not None
        until(lambda: alice.state is not None and "no command from 'alice'" in alice.state.problem)


def test_a_robot_that_is_started_again_is_led_again(tmp_path) -> None:
    robot_file, operator_file = write_stations(tmp_path, port=free_port())
    with Program("robot", robot_file) as robot:
        robot.await_said("waits for an operator")
        with Program("operator", operator_file) as operator:
            operator.await_said("\nactive: ")
            robot.process.kill()
            robot.process.wait()
            operator.await_said("does not answer")
            with Program("robot", robot_file) as again:
                operator.await_said("is led again")
                again.await_said("operator 'operator' leads")
                operator.await_said("\nactive: ", times=2)
                summary = operator.end()
    assert summary["net"]["joined"] >= 2
    assert summary["net"]["lost"] >= 1
    states = [change["state"] for change in summary["safety"]["changes"]]
    assert "hold" in states
    assert any("no data from the robot" in sentence for sentence in summary["notes"])
    assert summary["tactile"]["thumb"]["silent_s"] > 0.1


def test_the_robot_s_recording_holds_the_operator_s_samples_and_plays_again(tmp_path) -> None:
    pytest.importorskip("foxglove", reason="needs the extra record")
    robot_file, operator_file = write_stations(tmp_path, port=free_port())
    # What counts as full touch is known at the robot alone, what the muscles can at the operator alone.
    known = load_calibration(tmp_path / "calibration.toml")
    save_calibration(msgspec.structs.replace(known, emg=None), tmp_path / "gels.toml")
    save_calibration(msgspec.structs.replace(known, tactile={}), tmp_path / "muscles.toml")
    with robot_file.open("a", encoding="utf-8") as file:
        file.write('\n[calibration]\nfile = "gels.toml"\n')
    text = operator_file.read_text(encoding="utf-8").replace("calibration.toml", "muscles.toml")
    operator_file.write_text(text, encoding="utf-8")
    there, here = tmp_path / "at-robot", tmp_path / "at-operator"
    with Program("robot", robot_file, "--record", str(there), "--lossless") as robot:
        robot.await_said("waits for an operator")
        with Program("operator", operator_file, "--record", str(here), "--lossless") as operator:
            operator.await_said("\nactive: ")
            robot.await_said("\nactive: ")
            time.sleep(1.0)
            operator.end()
        robot.end()
    came, given = _samples(there / "trial-001.mcap"), _samples(here / "trial-001.mcap")
    assert len(came) > 500
    assert came.items() <= given.items()  # bit for bit, by number
    report = replay_file(there / "trial-001.mcap")
    assert report.same
    kept = {stream.stream: stream.as_recorded for stream in report.streams}
    assert (kept["/emg/levels"], kept["/hand/frames"]) == ("another program decoded them", "")
    report = replay_file(here / "trial-001.mcap")
    assert report.same
    kept = {stream.stream: stream.as_recorded for stream in report.streams}
    assert (kept["/tactile/thumb/contact"], kept["/emg/levels"]) == ("another station measured them", "")


def test_full_touch_is_what_the_operator_s_calibration_says_else_what_the_robot_s_does() -> None:
    ours, theirs = TouchMaxima(cci_max=1.0, eda_max=100.0), TouchMaxima(cci_max=2.0, eda_max=200.0)
    calibration = Calibration(preset="live", origin="test", tactile={"thumb": ours})
    welcome = Welcome(
        1, {"thumb": 60.0, "index": 60.0}, hand=True, arm=False, touch={"thumb": theirs, "index": theirs}
    )
    whole = with_touch(calibration, welcome, robot="panda")
    assert (whole.touch("thumb"), whole.touch("index")) == (ours, theirs)
    with pytest.raises(CalibrationError, match="index of robot 'panda' is known neither here nor there"):
        with_touch(calibration, msgspec.structs.replace(welcome, touch={}), robot="panda")
    with pytest.raises(CalibrationError, match="preset 'live', the run uses 'paper'"):
        with_touch(calibration, msgspec.structs.replace(welcome, preset="paper"), robot="panda")


def _samples(file: Path) -> dict[int, tuple[float, ...]]:
    """Return the EMG samples of a recording by their number."""
    found = {}
    for message in McapReader(file).messages():
        if message.topic == "/emg/samples":
            value, n = message.value, message.value.n_channels
            for k in range(len(value.samples) // n):
                found[value.first_index + k] = tuple(value.samples[k * n : (k + 1) * n])
    return found


def test_one_machine_s_settings_are_shared_among_two(tmp_path) -> None:
    tree: dict[str, Any] = {
        "session": {"preset": "paper", "out_dir": "results"},
        "tactile": {"thumb": {"driver": "digit", "options": {"source": "http://127.0.0.1:1/v"}}},
        "emg": {"driver": "synthetic-emg", "kind": "raw"},
        "input": {"dead_man": {"driver": "pedal", "options": {"silent_after_ms": 100}}},
        "arm": {"driver": "simulated-arm", "tracker": {"driver": "poses-file", "options": {"file": "p.csv"}}},
    }
    address = "tcp/127.0.0.1:7447"
    robot_file, operator_file = write_trees(tmp_path, split(tree, listen=address, connect=address))
    robot, operator = (load_config(file, environ={}).config for file in (robot_file, operator_file))
    assert robot.guests["net"] is not None
    assert operator.guests["net"] is not None
    assert parts_of(operator) == ("emg", "arm")
    assert (robot.guests["net"].listen, operator.guests["net"].connect) == (address, address)
    assert robot.session.preset == operator.session.preset == "paper"
    assert robot.session.out_dir != operator.session.out_dir
    for config in (robot, operator):
        open_station(config, Bus(), stop=lambda: True)  # nothing stands where it does not belong
    with pytest.raises(ConfigError, match="belongs to the operator"):
        open_station(msgspec.structs.replace(robot, emg=operator.emg), Bus(), stop=lambda: True)
    with pytest.raises(ConfigError, match="belongs to the robot"):
        open_station(msgspec.structs.replace(operator, arm=robot.arm), Bus(), stop=lambda: True)


def test_a_message_that_the_transport_refuses_does_not_end_the_sending(monkeypatch) -> None:
    received: list[bytes] = []
    with Link(NetSection(station="robot", name="r", listen=f"tcp/127.0.0.1:{free_port()}")) as link:
        link.receives("state", lambda _key, message: received.append(message))
        send = link.sends("state", Channel.COMMAND)
        assert link.problem == ""

        def refuse(_publisher: Any, _message: bytes) -> None:
            raise RuntimeError("the transport is gone\nand more")

        with monkeypatch.context() as broken:
            broken.setattr(link, "_put", refuse)
            send(b"lost")
            until(lambda: link.n_unsent == 1)
            assert link.problem == "link: 1 messages were not sent: the transport is gone"
        send(b"sent")
        until(lambda: received == [b"sent"])


def test_what_waits_for_a_sender_that_stands_still_is_bounded(monkeypatch) -> None:
    stands, go_on, sent = Event(), Event(), list[bytes]()

    def stand(_publisher: Any, message: bytes) -> None:
        stands.set()
        go_on.wait(60)
        sent.append(message)

    with Link(NetSection(station="robot", name="r", listen=f"tcp/127.0.0.1:{free_port()}")) as link:
        monkeypatch.setattr(link, "_put", stand)
        send = link.sends("state", Channel.COMMAND)
        send(b"first")
        assert stands.wait(60)
        for number in range(3000):
            send(b"%d" % number)
        assert link._queue.qsize() <= 1000
        assert link.n_unsent == 2000
        assert "the sender does not keep up" in link.problem
        go_on.set()
        until(lambda: len(sent) == 1001)
    assert sent[-1] == b"2999"


def led(folder: Path, robot_more: str, disturb: Callable[[Program], None], words: str) -> list[LoopView]:
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
    return [view for view in run.views if view.state == "hold"]


@pytest.mark.raises("link")
def test_a_robot_that_is_gone_is_an_alert_and_not_shown_as_led(tmp_path: Path) -> None:
    view = led(tmp_path, "", lambda robot: robot.process.kill(), "link: no word from robot")[-1]
    assert view.link.startswith("leads robot (no word from it)")
    assert view.angles_rad is None


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
