"""What the kernel tells of cameras, CAN buses and Bluetooth, from made-up trees of its files."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import pytest

from tega.devices.fingertip import video_nodes
from tega.devices.fingertip.video_nodes import (
    VideoNode,
    camera_place,
    find_digits,
    find_node,
    numbered_cameras,
)
from tega.devices.machine import CanLink, bluetooth_trouble, can_links, link_trouble
from tega.errors import DeviceUnavailableError


def files(folder: Path, **values: str) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for name, value in values.items():
        (folder / name).write_text(f"{value}\n")
    return folder


def camera(
    root: Path, number: int, *, serial: str, usb_id: str = "2833:0209", revision: str = "0200", index: int = 0
) -> None:
    """Make what the kernel shows of one camera: a node that hangs on an interface of a USB device."""
    vendor, product = usb_id.split(":")
    about = {"serial": serial, "bcdDevice": revision, "idVendor": vendor, "idProduct": product, "busnum": "1"}
    usb = files(root / "devices" / f"1-{number}", **about)
    name = "DIGIT: DIGIT" if vendor == "2833" else "Webcam"
    node = files(root / "video4linux" / f"video{number}", index=str(index), name=name)
    (node / "device").symlink_to(files(usb / f"1-{number}:1.0"))


def test_a_digit_is_found_by_its_numbers_and_a_webcam_is_none(tmp_path: Path) -> None:
    camera(tmp_path, 90, serial="D20641")
    camera(tmp_path, 91, serial="W1", usb_id="046d:0825")
    (found,) = find_digits(sysfs=tmp_path / "video4linux", usb=tmp_path / "devices")
    assert (found.label, found.options) == ("D20641", {"serial": "D20641"})
    assert found.note == "/dev/video90, firmware 2.00, USB bus 1"
    # No such file on this machine, as in a container without the camera.
    assert "it is not there" in found.problem


def test_a_sensor_is_found_by_its_number(tmp_path: Path) -> None:
    camera(tmp_path, 0, serial="D20001", revision="0101")
    camera(tmp_path, 1, serial="D20001", index=1)  # its node of metadata
    camera(tmp_path, 10, serial="D20641")
    nodes = video_nodes.video_nodes(tmp_path / "video4linux")
    assert [(node.device, node.serial, node.revision) for node in nodes] == [
        ("/dev/video0", "D20001", 0x0101),
        ("/dev/video10", "D20641", 0x0200),
    ]
    assert find_node("D20641", tmp_path / "video4linux").device == "/dev/video10"
    with pytest.raises(DeviceUnavailableError, match=r"D99999.*D20001.*D20641"):
        find_node("D99999", tmp_path / "video4linux")
    with pytest.raises(DeviceUnavailableError, match="none"):
        find_node("D20641", tmp_path / "nothing")


def test_two_with_one_serial_number_are_told(tmp_path: Path) -> None:
    for number in (90, 91):
        camera(tmp_path, number, serial="D20641")
    found = find_digits(sysfs=tmp_path / "video4linux", usb=tmp_path / "devices")
    assert [f.problem for f in found] == ["two cameras have the serial number D20641"] * 2


@pytest.mark.parametrize(
    ("usb_id", "text"), [("0403:0fde", "is starting"), ("2833:0209", "the kernel made no camera of it")]
)
def test_a_digit_that_is_no_camera_is_told(tmp_path: Path, usb_id: str, text: str) -> None:
    vendor, product = usb_id.split(":")
    files(tmp_path / "devices" / "1-4", idVendor=vendor, idProduct=product, serial="D20641")
    (found,) = find_digits(sysfs=tmp_path / "none", usb=tmp_path / "devices")
    assert text in found.problem
    assert found.hint


@pytest.mark.parametrize(("system", "access"), [("win32", 1400), ("darwin", 1200)])
def test_windows_and_macos_name_cameras_by_number(
    system: str, access: int, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    # As cv2-enumerate-cameras lists them.
    built_in = SimpleNamespace(index=0, name="Built-in", vid=None, pid=None)
    cameras = Mock(return_value=[built_in, SimpleNamespace(index=1, name="DIGIT", vid=0x2833, pid=0x0209)])
    nodes = numbered_cameras(system, cameras)
    cameras.assert_called_once_with(access)
    assert nodes == [
        VideoNode("camera:0", "Built-in", "", 0),
        VideoNode("camera:1", "DIGIT", "", 0, "2833:0209"),
    ]
    monkeypatch.setattr(video_nodes, "video_nodes", lambda _sysfs: nodes)
    (found,) = find_digits(usb=tmp_path / "none")
    assert (found.options, found.problem) == ({"source": "camera:1"}, "")


@pytest.mark.parametrize(
    ("source", "system", "opened"),
    [
        ("camera:2", "win32", (2, "CAP_MSMF")),
        ("camera:2", "darwin", (2, "CAP_AVFOUNDATION")),
        ("camera:2", "linux", ("/dev/video2", "CAP_V4L2")),
        ("2", "linux", ("/dev/video2", "CAP_V4L2")),
        ("/dev/v4l/by-id/x", "linux", ("/dev/v4l/by-id/x", "CAP_V4L2")),
        ("camera:two", "win32", ("camera:two", "CAP_FFMPEG")),
        ("http://127.0.0.1:80/a.mjpg", "darwin", ("http://127.0.0.1:80/a.mjpg", "CAP_FFMPEG")),
    ],
)
def test_a_camera_is_opened_by_the_system_s_own_way(
    source: str, system: str, opened: tuple[str | int, str]
) -> None:
    assert camera_place(source, system) == opened


def test_can_buses_with_what_ip_says_of_them(tmp_path: Path) -> None:
    files(tmp_path / "eth0", type="1", flags="0x1003")
    files(tmp_path / "can0", type="280", flags="0x40081")
    files(tmp_path / "can1", type="280", flags="0x40080")
    about = {"state": "ERROR-ACTIVE", "bittiming": {"bitrate": 500000}}
    text = json.dumps([{"linkinfo": {"info_kind": "can", "info_data": about}}])
    links = can_links(sysfs=tmp_path, describe={"can0": text, "can1": ""}.__getitem__)
    assert links == [
        CanLink("can0", is_up=True, bitrate=500000, state="ERROR-ACTIVE", is_virtual=False),
        CanLink("can1", is_up=False, bitrate=None, state="", is_virtual=False),
    ]
    assert can_links(sysfs=tmp_path / "none") == []


@pytest.mark.parametrize(
    ("link", "text", "todo"),
    [
        (CanLink("can0", True, 1_000_000, "ERROR-ACTIVE", False), "", ""),
        (CanLink("can0", True, None, "", False), "", ""),
        (CanLink("can0", False, None, "STOPPED", False), "is down", "up type can bitrate 1000000"),
        (CanLink("can0", True, 500_000, "ERROR-ACTIVE", False), "runs at 500000", "can0 down && "),
        (CanLink("can0", True, 1_000_000, "BUS-OFF", False), "bus-off", "120 Ω"),
        (CanLink("can0", True, 1_000_000, "ERROR-PASSIVE", False), "acknowledges", "power"),
        (CanLink("vcan0", False, None, "", True), "is down", "sudo ip link set vcan0 up"),
    ],
)
def test_what_is_wrong_with_a_bus(link: CanLink, text: str, todo: str) -> None:
    trouble, step = link_trouble(link, bitrate=1_000_000)
    assert text in trouble
    assert bool(trouble) is bool(text)
    assert todo in step


def test_bluetooth_that_is_off_or_not_there(tmp_path: Path) -> None:
    assert bluetooth_trouble(tmp_path / "none") == ("", "")
    assert "no Bluetooth adapter" in bluetooth_trouble(tmp_path)[0]
    files(tmp_path / "bluetooth" / "hci0")
    switch = files(tmp_path / "rfkill" / "rfkill0", type="bluetooth", soft="0", hard="0")
    assert bluetooth_trouble(tmp_path) == ("", "")
    files(switch, soft="1")
    assert "rfkill unblock bluetooth" in bluetooth_trouble(tmp_path)[1]
    files(switch, hard="1")
    assert "switch or key" in bluetooth_trouble(tmp_path)[0]
