"""A serial CAN adapter on a pseudo-terminal: what is read, and in how many pieces."""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Iterator
from typing import Any

import can
import pytest

from tega.devices.hand.can_open import slcan_bus

pytestmark = pytest.mark.skipif(os.name != "posix", reason="python-can's own reading is used elsewhere")

FRAMES = [f"t08{k}8{k:016X}\r".encode() for k in range(4)]


@pytest.fixture
def line() -> Iterator[tuple[int, Any]]:
    import pty
    import tty

    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    bus = slcan_bus()(os.ttyname(theirs), bitrate=1_000_000, sleep_after_open=0.0)
    try:
        yield ours, bus
    finally:
        with contextlib.suppress(can.CanError):  # of an adapter that is gone
            bus.shutdown()
        for end in (ours, theirs):
            os.close(end)


def test_frames_that_come_together_are_read_together(
    line: tuple[int, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    ours, bus = line
    sizes: list[int] = []
    read = os.read

    def counted(file: int, n: int) -> bytes:
        piece = read(file, n)
        sizes.append(len(piece))
        return piece

    monkeypatch.setattr(os, "read", counted)
    os.write(ours, b"".join(FRAMES))
    got = [bus.recv(timeout=60.0), *(bus.recv(timeout=0.0) for _ in range(3))]
    assert [m.arbitration_id for m in got] == [0x080, 0x081, 0x082, 0x083]
    assert [int.from_bytes(m.data, "big") for m in got] == [0, 1, 2, 3]
    assert sizes == [sum(map(len, FRAMES))]
    assert bus.recv(timeout=0.0) is None


def test_a_frame_in_pieces_is_put_together_and_answers_are_passed_over(line: tuple[int, Any]) -> None:
    ours, bus = line
    os.write(ours, b"z\r\at08")
    assert bus.recv(timeout=0.05) is None
    later = threading.Timer(0.05, os.write, (ours, FRAMES[1][4:]))
    os.write(ours, FRAMES[1][3:4])
    later.start()
    try:
        message = bus.recv(timeout=60.0)
    finally:
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


def test_a_frame_is_on_its_way_whether_or_not_the_adapter_reads(line: tuple[int, Any]) -> None:
    ours, bus = line
    message = can.Message(arbitration_id=0x081, data=bytes(7) + b"\x01", is_extended_id=False)
    bus.send(message, timeout=0.05)
    reported = b""
    while not reported.endswith(FRAMES[1]):  # after what it was told when it was opened, in any pieces
        reported += os.read(ours, 4096)
    assert reported.count(b"t") == 1

    def fill() -> None:
        for _ in range(10_000):  # more than a system keeps for one that reads nothing
            bus.send(message, timeout=0.05)

    with pytest.raises(can.CanOperationError):
        fill()


def test_frames_that_are_sent_together_are_written_together(
    line: tuple[int, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    ours, bus = line
    sizes: list[int] = []
    write = os.write

    def counted(file: int, data: bytes) -> int:
        sizes.append(len(data))
        return write(file, data)

    monkeypatch.setattr(os, "write", counted)
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
    assert sizes == [sum(map(len, lines[:4])), len(lines[4])]
