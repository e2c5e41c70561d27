"""Adapters of python-can without their vendors' libraries: one sentence each, and nothing leaks."""

from __future__ import annotations

import gc
import os
import sys
from typing import Any

import can
import pytest

from tega.devices.hand.can_open import open_can_bus
from tega.devices.hand.hand_bus import HandBus
from tega.devices.hand.python_can import PythonCan, PythonCanOptions
from tega.errors import DeviceUnavailableError
from tega.wire import CanFrame

_THERE = {"virtual", "udp_multicast"}
_ABSENT = sorted(set(can.VALID_INTERFACES) - _THERE)
_CHANNELS = {"slcan": "/dev/no-such-port", "socketcan": "nocan0", "pcan": "PCAN_USBBUS16"}


def test_an_adapter_that_is_not_there_is_one_sentence(capfd: pytest.CaptureFixture[str]) -> None:
    for interface in _ABSENT:
        channel = _CHANNELS.get(interface, "0")
        for bus in (
            HandBus({"interface": interface, "channel": channel, "bitrate": 1_000_000}),
            PythonCan(PythonCanOptions(interface=interface, channel=channel, open_loop=True)),
        ):
            with pytest.raises(DeviceUnavailableError) as caught:
                bus.open()
            assert f"interface {interface!r}, channel " in caught.value.message
            assert caught.value.__cause__ is None
            assert "\n" not in caught.value.message
            assert caught.value.hint
    del bus, caught
    gc.collect()
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("interface", "error", "text", "hint"),
    [
        (
            "kvaser",
            NameError("name 'canGetNumberOfChannels' is not defined"),
            "CANlib is missing",
            "linuxcan",
        ),
        ("pcan", OSError("pcanbasic library not found."), "PCAN-Basic is missing", "socketcan"),
        ("ixxat", ImportError("cannot import name 'HRESULT'"), "VCI is missing", "Windows"),
        ("gs_usb", can.CanInterfaceNotImplementedError("No module named 'usb'"), "are missing", r"gs-usb"),
        ("slcan", ImportError("serial"), "pyserial is missing", "pip install pyserial"),
        ("slcan", OSError("could not open port"), "could not open port", "serial port"),
        ("socketcan", OSError(97, "Address family not supported"), "CAN support is missing", "modprobe"),
        ("socketcan", OSError(19, "No such device"), "No such device", "ip link set can0 up"),
        ("kvaser", ValueError("channel must be an integer"), "must be an integer", "channel is a number"),
        ("neousys", NameError("x"), "its library is missing", "vendor's driver"),
        ("sokcetcan", ValueError("?"), "no such interface", "did you mean 'socketcan'"),
    ],
)
def test_the_hint_is_that_of_the_interface(interface: str, error: Exception, text: str, hint: str) -> None:
    def make() -> Any:
        raise error

    with pytest.raises(DeviceUnavailableError, match=text) as caught:
        open_can_bus("allegro", interface, make, can=can, channel="x")
    assert hint in caught.value.hint


class _Broken:
    """A bus whose library is gone after it was opened."""

    def recv(self, **_: float) -> None:
        raise NameError("canRead")

    def send(self, _message: object, **_: float) -> None:
        raise AttributeError("canWrite")

    def shutdown(self) -> None:
        raise NameError("canClose")


def test_nothing_leaks_from_a_library_that_fails_later() -> None:
    bus = HandBus({"interface": "kvaser", "channel": 0})
    bus.load()
    bus._bus = _Broken()
    assert bus.send([CanFrame(1, b"")]) == []
    assert bus.n_unsent == 1
    assert bus.receive(may_reopen=False) == []
    assert "the adapter failed: canRead" in bus.trouble


@pytest.mark.skipif(sys.platform != "linux", reason="terminals have other names")
def test_another_hand_s_terminal_of_the_same_name_is_not_opened() -> None:
    def terminal() -> tuple[int, int, str]:
        master, slave = os.openpty()
        return master, slave, os.ttyname(slave)

    master, slave, name = terminal()
    bus = HandBus({"interface": "slcan", "channel": name, "bitrate": 1_000_000})
    bus.open()
    os.close(master)
    os.close(slave)
    bus.drop()
    made = [terminal()]
    while made[-1][2] != name:  # another program may take the name first
        made.append(terminal())
    os.set_blocking(made[-1][0], False)
    assert bus.receive(may_reopen=True) == []
    assert bus.replaced
    with pytest.raises(BlockingIOError):
        os.read(made[-1][0], 100)
    for ends in made:
        os.close(ends[0])
        os.close(ends[1])
