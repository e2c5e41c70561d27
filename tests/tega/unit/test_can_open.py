"""Adapters of python-can without their vendors' libraries, and a serial one on a pseudo-terminal."""

from __future__ import annotations

import contextlib
import gc
import os
import sys
import threading
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import can
import pytest

from reference.hand import stuck_hand
from tega.devices.hand import hand_loop, hand_reports
from tega.devices.hand.allegro import Allegro
from tega.devices.hand.allegro_options import AllegroOptions
from tega.devices.hand.can_open import open_can_bus, slcan_bus
from tega.devices.hand.hand_bus import HandBus
from tega.devices.hand.hand_reports import HandAlert, HandNews, HandOrders
from tega.devices.hand.python_can import PythonCan, PythonCanOptions
from tega.errors import DeviceUnavailableError
from tega.runtime.clock import Standstill
from tega.wire import CanFrame

_ABSENT = sorted(set(can.VALID_INTERFACES) - {"virtual", "udp_multicast"})
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
        ("kvaser", NameError("name 'canOpenChannel' is not defined"), "CANlib is missing", "linuxcan"),
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


def test_nothing_leaks_from_a_library_that_fails_later() -> None:
    bus = HandBus({"interface": "kvaser", "channel": 0})
    bus.load()
    bus._bus = gone = Mock(spec=["recv", "send", "shutdown"])
    gone.recv.side_effect = gone.send.side_effect = NameError("canRead")
    gone.shutdown.side_effect = NameError("canClose")
    assert bus.send([CanFrame(1, b"")]) == []
    assert bus.n_unsent == 1
    assert bus.receive(may_reopen=False) == []
    assert "the adapter failed: canRead" in bus.trouble


def test_torques_that_the_adapter_does_not_take_are_named_and_answer_nothing(monkeypatch) -> None:
    reported, alert = list[Any](), HandAlert()
    options = AllegroOptions(interface="virtual", channel="", guard=False)
    loop = hand_loop.HandLoop(options, HandOrders(), lambda *both: reported.append(both))
    loop.warm_up()
    loop._bus._bus = Mock(spec=["send"], send=Mock(side_effect=OSError("full")))
    for t_ns in range(0, 300_000_000, 3_000_000):
        now = SimpleNamespace(monotonic_ns=lambda t_ns=t_ns: t_ns, thread_time=float)
        monkeypatch.setattr(hand_loop, "time", now)
        loop._exchange(stuck_hand(t_ns // 3_000_000), Standstill(1.0))
    monkeypatch.setattr(hand_reports, "_POLL_S", 0.0)
    looks = [alert.unsteered(news) for _, news in reported if news.state.phase == "running"]
    assert looks[-1] == "hand: its adapter does not take frames, so it keeps its last torques"
    answers = [one.left_ns for spoken, _ in reported for one in spoken if len(one.out) == 4]
    assert set(answers) == {0}


def test_a_hand_whose_process_reports_nothing_is_told() -> None:
    hand: Any = Allegro(AllegroOptions(interface="virtual", channel=""))
    hand._end = Mock()
    hand._take([], HandNews(Mock(phase="silent")))
    assert hand.problem.startswith("hand: silent")
    assert hand.unsteered == hand.problem
    hand._received_s -= 2.0
    assert hand.problem == "hand: its process reports nothing"


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
    for end in (end for ends in made for end in ends[:2]):
        os.close(end)


FRAMES = [f"t08{k}8{k:016X}\r".encode() for k in range(4)]


@pytest.fixture
def line() -> Iterator[tuple[int, Any]]:
    """Return our end of a terminal, and a bus on the other."""
    tty = pytest.importorskip("tty")  # python-can's own reading is used elsewhere
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    bus = slcan_bus(exclusive=True)(os.ttyname(theirs), bitrate=1_000_000, sleep_after_open=0.0)
    try:
        yield ours, bus
    finally:
        with contextlib.suppress(can.CanError):  # of an adapter that is gone
            bus.shutdown()
        for end in (ours, theirs):
            os.close(end)


def test_an_adapter_in_use_opens_for_no_program_but_the_guard(line: tuple[int, Any]) -> None:
    channel = line[1].serialPortOrig.port
    port = {"interface": "slcan", "channel": channel, "bitrate": 1_000_000, "sleep_after_open": 0.0}
    with pytest.raises(DeviceUnavailableError, match="did not open: another program uses it"):
        HandBus(port).open()
    guard = HandBus(port, exclusive=False)
    guard.open()
    guard.drop()


def test_frames_that_come_together_are_read_together(
    line: tuple[int, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    ours, bus = line
    monkeypatch.setattr(os, "read", read := Mock(wraps=os.read))
    os.write(ours, b"".join(FRAMES))
    got = [bus.recv(timeout=60.0), *(bus.recv(timeout=0.0) for _ in range(3))]
    assert [m.arbitration_id for m in got] == [0x080, 0x081, 0x082, 0x083]
    assert [int.from_bytes(m.data, "big") for m in got] == [0, 1, 2, 3]
    assert read.call_count == 1
    assert bus.recv(timeout=0.0) is None


def test_a_frame_in_pieces_is_put_together_and_answers_are_passed_over(line: tuple[int, Any]) -> None:
    ours, bus = line
    os.write(ours, b"z\r\at08")
    assert bus.recv(timeout=0.05) is None
    os.write(ours, FRAMES[1][3:4])
    later = threading.Timer(0.05, os.write, (ours, FRAMES[1][4:]))
    later.start()
    message = bus.recv(timeout=60.0)
    later.join()
    assert (message.arbitration_id, message.data[-1]) == (0x081, 1)


def test_noise_without_an_end_is_not_kept(line: tuple[int, Any]) -> None:
    ours, bus = line
    os.write(ours, b"\x55" * 100)
    with pytest.raises(ValueError, match="without the end of a line"):
        bus.recv(timeout=60.0)
    os.write(ours, FRAMES[1])
    assert bus.recv(timeout=60.0).arbitration_id == 0x081


def test_an_adapter_that_is_gone_is_an_error_and_no_silence(line: tuple[int, Any]) -> None:
    _, bus = line
    null = os.open(os.devnull, os.O_RDWR)  # always ready, and nothing in it, as a port without its adapter
    try:
        os.dup2(null, bus.fileno())
        with pytest.raises(OSError, match="gone"):
            bus.recv(timeout=1.0)
    finally:
        os.close(null)


def test_an_adapter_that_reads_nothing_is_an_error(line: tuple[int, Any]) -> None:
    message = can.Message(arbitration_id=0x081, data=bytes(8), is_extended_id=False)
    with pytest.raises(can.CanOperationError):  # more than a system keeps for one that reads nothing
        any(line[1].send(message, timeout=0.05) for _ in range(10_000))


def test_frames_that_are_sent_together_are_written_together(
    line: tuple[int, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    ours, bus = line
    monkeypatch.setattr(os, "write", write := Mock(wraps=os.write))
    messages = [
        can.Message(arbitration_id=0x80 + k, data=bytes([k] * 8), is_extended_id=False) for k in range(4)
    ]
    bus.send_together(messages, timeout=1.0)
    bus.send(messages[0])
    text = b""
    while text.count(b"t") < 5 or not text.endswith(b"\r"):  # after how it was opened, in any pieces
        text += os.read(ours, 4096)
    lines = [f"t08{k}8{f'{k:02X}' * 8}\r".encode() for k in (0, 1, 2, 3, 0)]
    assert text[text.index(b"t") :] == b"".join(lines)
    assert [call.args[1] for call in write.call_args_list] == [b"".join(lines[:4]), lines[4]]
