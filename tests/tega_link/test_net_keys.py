# mypy: allow-untyped-defs, allow-incomplete-defs, allow-untyped-calls, allow-untyped-decorators
"""Keys of stations, and what a wrong one is good for: nothing."""

from __future__ import annotations

import json
import stat
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from click.testing import CliRunner

pytest.importorskip("zenoh", reason="needs the extra net")
pytest.importorskip("cryptography", reason="needs the extra net")

from tega.errors import ConfigError
from tega_emulators.stations import free_port
from tega_link.cli import net as net_verb
from tega_link.keys import check_expiry, expiry, make_keys
from tega_link.link import Channel, Link, zenoh_settings
from tega_link.settings import Endpoint, NetSection


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("keys")
    make_keys(folder, operators=["alice", "eve"], robots=["panda", "other"])
    return folder


@pytest.fixture(scope="module")
def strangers(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Keys with the right name, of another authority."""
    folder = tmp_path_factory.mktemp("strangers")
    make_keys(folder, operators=["alice"], robots=["panda"])
    return folder


def passed(robot_keys: Path, operator_keys: Path | None, *, name: str = "alice") -> tuple[int, int, int]:
    """Return how many commands, states and signs of life get through."""
    at = f"127.0.0.1:{free_port()}"
    robot = NetSection(
        station="robot", name="panda", operators=("alice",), listen=f"tls/{at}", keys=robot_keys
    )
    address = f"tls/{at}" if operator_keys else f"tcp/{at}"
    operator = NetSection(station="operator", name=name, robot="panda", connect=address, keys=operator_keys)
    commands: list[bytes] = []
    states: list[bytes] = []
    signs: list[str] = []
    with Link(robot) as here, Link(operator) as there:
        here.receives("cmd/*/hand", lambda _key, data: commands.append(data))
        here.watches("operator/*/*", lambda key, _alive: signs.append(key))
        there.receives("state", lambda _key, data: states.append(data))
        there.lives(f"operator/{name}/1")
        say, notify = there.sends(f"cmd/{name}/hand", Channel.COMMAND), here.sends("state", Channel.STATE)
        right = (robot_keys.name, operator_keys) == ("panda", robot_keys.with_name("alice"))
        until_s = time.monotonic() + (60.0 if right else 2.0)
        while time.monotonic() < until_s and not (commands and states and signs):
            say(b"close")
            notify(b"active")
            time.sleep(0.02)
    return len(commands), len(states), len(signs)


def test_the_right_certificates_pass_everything(keys) -> None:
    assert min(passed(keys / "panda", keys / "alice")) > 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "operator", "name"),
    [
        ("keys/panda", "keys/eve", "alice"),  # of the authority, but not named by the robot
        ("keys/panda", "keys/eve", "eve"),
        ("keys/other", "keys/alice", "alice"),  # a robot that is not the one to be led
        ("keys/panda", "strangers/alice", "alice"),  # the right name, from another authority
        ("strangers/panda", "keys/alice", "alice"),
    ],
)
def test_a_wrong_certificate_passes_nothing(robot, operator, name, keys, strangers) -> None:
    folders = {"keys": keys, "strangers": strangers}
    there, here = (folders[p.split("/")[0]] / p.split("/")[1] for p in (robot, operator))
    assert passed(there, here, name=name) == (0, 0, 0)


def test_a_station_without_keys_cannot_talk_to_one_with_keys(keys) -> None:
    assert passed(keys / "panda", None) == (0, 0, 0)


def test_keys_are_for_their_owner_s_eyes_and_say_until_when_they_hold(keys) -> None:
    files = [file for file in keys.rglob("*") if file.is_file()]
    assert len(files) == 2 + 4 * 3
    assert {stat.S_IMODE(file.stat().st_mode) for file in files} == {0o600}
    days = (expiry(keys / "alice") - datetime.now(UTC)).total_seconds() / 86400
    assert 364 < days <= 365
    now = datetime.now(UTC)
    assert check_expiry(keys / "alice") == ""
    assert "ends on" in check_expiry(keys / "alice", now=now + timedelta(days=340))
    with pytest.raises(ConfigError, match="ended on"):
        check_expiry(keys / "alice", now=now + timedelta(days=366))


def test_the_verb_makes_what_is_missing_and_leaves_what_is_there(tmp_path) -> None:
    words = ["keys", str(tmp_path / "k"), "--operator", "alice", "--robot", "panda"]
    first = CliRunner().invoke(net_verb, words)
    assert first.exit_code == 0
    assert "holds until" in first.output
    before = {file: file.read_bytes() for file in (tmp_path / "k").rglob("*") if file.is_file()}
    again = CliRunner().invoke(net_verb, [*words, "--operator", "bob", "--json"])
    stations = json.loads(again.output)["stations"]
    assert {one["name"]: one["made"] for one in stations} == {"alice": False, "panda": False, "bob": True}
    assert all(file.read_bytes() == content for file, content in before.items())
    (tmp_path / "k" / "bob" / "station.key").unlink()
    assert isinstance(CliRunner().invoke(net_verb, [*words, "--operator", "bob"]).exception, ConfigError)
    assert CliRunner().invoke(net_verb, ["keys", str(tmp_path)]).exit_code == 2
    with pytest.raises(ConfigError, match="cannot be a station's name"):
        make_keys(tmp_path, operators=["al/ice"], robots=[])


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"listen": "tcp/0.0.0.0:7447"}, "anybody could steer the robot"),
        ({"listen": "tcp/192.168.1.20:7447"}, "anybody could steer the robot"),
        ({"listen": "tls/robot.lab:7447"}, "net keys"),
        ({"listen": "tls/127.0.0.1:7447"}, "asks for keys"),
        ({"listen": "tcp/127.0.0.1:7447", "keys": Path("k"), "operators": ("a",)}, "write tls/"),
        ({"listen": "tls/10.0.0.1:7447", "keys": Path("k")}, "no operator may lead"),
        ({"listen": "udp/127.0.0.1:7447"}, "is no endpoint"),
        ({"listen": "tcp/127.0.0.1:70000"}, "70000"),
        ({"connect": "tcp/127.0.0.1:7447"}, "net.listen is not set"),
        ({"listen": "tcp/127.0.0.1:1", "connect": "tcp/127.0.0.1:1"}, "net.connect is set"),
        ({"listen": "tls/10.0.0.1:7447", "keys": Path("nowhere"), "operators": ("a",)}, "has no ca.pem"),
    ],
)
def test_a_link_that_is_not_safe_is_refused_with_the_way_out(settings, message) -> None:
    with pytest.raises(ConfigError) as refused:
        zenoh_settings(NetSection(station="robot", **settings))
    assert message in str(refused.value)


def test_addresses_of_this_machine_are_told_from_others() -> None:
    here = ["tcp/127.0.0.1:1", "tcp/[::1]:7447", "tcp/localhost:7447", "tcp/127.5.0.9:7447"]
    elsewhere = ["tcp/[::]:7447", "tcp/0.0.0.0:7447", "tcp/localhost.evil:7447", "tcp/10.0.0.1:7447"]
    assert all(Endpoint.read("net.listen", text).on_this_machine for text in here)
    assert not any(Endpoint.read("net.listen", text).on_this_machine for text in elsewhere)
    assert str(Endpoint.read("net.listen", "tcp/[::1]:7447")) == "tcp/[::1]:7447"
