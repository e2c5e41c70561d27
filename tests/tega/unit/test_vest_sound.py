"""The vest as sound, by its samples and on a stand-in for PortAudio; a Player that floods its client."""

from __future__ import annotations

import asyncio
import gc
import threading
import time
import tracemalloc
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from reference.processes import until
from tega.devices import driver_class
from tega.devices.vest.player_link import PlayerLink
from tega.devices.vest.player_versions import PlayerOptions
from tega.devices.vest.vest_sound import COLUMN_HZ, RATE_HZ, ColumnTones, SoundVest, SoundVestOptions
from tega.errors import DeviceUnavailableError
from tega.haptics import MotorLevels, vest_frame
from tega_emulators.sound_port import SoundPort

HZ = np.array(COLUMN_HZ).reshape(8)
BLOCK = 480
TOUCH = vest_frame([80, 60, 40, 20], [13, 0, 100, 53], layout="x40")


def motors(columns: dict[tuple[int, int], int]) -> NDArray[np.uint8]:
    """Return 40 intensities: by face (0 front, 1 back) and column."""
    frame = np.zeros((2, 5, 4), np.uint8)
    for (face, column), percent in columns.items():
        frame[face, 2, column] = percent
    return frame.reshape(40)


def received(sound: NDArray[np.float32] | NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the amplitude of each column's tone in either ear, float64 (8, 2), by a Fourier transform.

    The window keeps what belongs to one tone apart from its neighbours, 50 Hz away at least; the power near each
    frequency is summed (Parseval), so that it need not lie on a line of the spectrum.
    """
    window = np.hanning(len(sound))[:, None]
    power = np.abs(np.fft.rfft(sound * window, axis=0)) ** 2 * 4 / (len(sound) * (window**2).sum())
    step_hz = RATE_HZ / len(sound)
    near = [slice(round(hz / step_hz) - 3, round(hz / step_hz) + 4) for hz in HZ]
    amplitude: NDArray[np.float64] = np.sqrt(np.array([power[part].sum(axis=0) for part in near]))
    return amplitude


def settled(tones: ColumnTones, intensities: NDArray[np.uint8], seconds: float = 1.0) -> NDArray[np.float32]:
    """Return the sound of a frame that is told again every 10 ms, after the ramp."""
    blocks = []
    for _ in range(round(seconds * RATE_HZ / BLOCK) + 1):
        tones.notify(intensities)
        blocks.append(tones.render(BLOCK))
    return np.concatenate(blocks[1:])


@pytest.mark.parametrize("face", [0, 1])
@pytest.mark.parametrize("column", range(4))
def test_each_column_has_its_tone_and_its_side(face: int, column: int) -> None:
    amplitude = received(settled(ColumnTones(100), motors({(face, column): 100})))
    loudness = np.hypot(*amplitude.T)
    assert loudness.argmax() == 4 * face + column
    assert loudness.max() == pytest.approx(1 / 8, rel=0.02)
    assert np.sort(loudness)[-2] < loudness.max() / 1000
    left, right = amplitude[4 * face + column]
    # From the wearer's left to the right, as loud at every place.
    assert np.arctan2(right, left) == pytest.approx(column * np.pi / 6, abs=0.01)


@pytest.mark.parametrize("volume", [50.0, 100.0])
def test_loudness_is_proportional_to_the_intensity_of_the_strongest_motor(volume: float) -> None:
    tones = ColumnTones(volume)
    found = []
    for percent in (1, 7, 25, 50, 100):
        frame = motors({(0, 1): percent})
        frame[4 * 3 + 1] = percent // 2  # a weaker motor of the same column
        found.append(np.hypot(*received(settled(tones, frame)).T)[1] / percent)
    assert found == pytest.approx([volume / 100 / 8 / 100] * 5, rel=0.02)


def test_all_columns_at_full_drive_do_not_clip_and_are_all_heard() -> None:
    sound = settled(ColumnTones(100), np.full(40, 100, np.uint8), 4.0)
    assert np.abs(sound).max() < 1
    np.testing.assert_allclose(np.hypot(*received(sound).T), 1 / 8, rtol=0.02)


def test_zero_is_silence_to_the_last_bit_after_a_ramp_without_clicks() -> None:
    tones = ColumnTones(100)
    assert not tones.render(BLOCK).any()
    settled(tones, motors({(0, 0): 100}), 0.1)
    tones.notify(np.zeros(40, np.uint8))
    # Blocks shorter than the ramp end it too.
    fading = np.concatenate([tones.render(32) for _ in range(10)])
    assert not fading[-40:].any()
    assert np.abs(np.diff(fading[:, 0])).max() < 0.02
    assert tones.silent


def test_a_frame_that_is_not_told_again_fades_after_200_ms() -> None:
    tones = ColumnTones(100)
    tones.notify(motors({(1, 3): 100}))
    sound = np.concatenate([tones.render(BLOCK) for _ in range(30)])
    last = np.flatnonzero(sound.any(axis=1))[-1] / RATE_HZ
    assert 0.2 < last < 0.23


def test_it_is_found_by_its_name_and_is_no_vest_that_may_hurt(tmp_path: Path) -> None:
    from tega.config import check_tree
    from tega.loop.sinks import live_outputs

    assert driver_class("sound-vest", "vest") is SoundVest
    config = check_tree({"vest": {"driver": "sound-vest"}}, {}, base=tmp_path).config
    assert live_outputs(config) == (True, [])


@pytest.fixture
def port() -> Any:
    made = SoundPort()
    with made.installed():
        yield made


@pytest.mark.slow
def test_a_touch_is_heard_as_written_and_the_end_is_silent(port: SoundPort) -> None:
    with SoundVest(SoundVestOptions(volume=100)) as vest:

        def enough() -> bool:
            vest.write(0, TOUCH)
            return len(port.played) > 40

        until(enough)
        reported: MotorLevels = vest.write(0, TOUCH)
        np.testing.assert_array_equal(reported.intensities, TOUCH.intensities)
        sound = np.concatenate(port.played[20:40])
    assert not port.played[-1][-1].any()  # it has faded
    loudness = np.hypot(*received(sound).T)
    assert loudness == pytest.approx(np.array([80, 60, 40, 20, 13, 0, 100, 53]) / 800, abs=0.003)
    assert vest.counters.lost == 0


@pytest.mark.slow
def test_a_loudspeaker_that_goes_away_is_lost_and_found_again(port: SoundPort) -> None:
    with SoundVest(SoundVestOptions()) as vest:
        port.present = False
        until(lambda: bool(vest.write(0, TOUCH)) and vest.counters.lost == 1)
        assert not vest.write(0, TOUCH).intensities.any()
        port.present = True
        until(lambda: bool(vest.write(0, TOUCH).intensities.any()))
    assert "the loudspeaker went away" in vest.counters.problem


def test_no_loudspeaker_says_what_to_set(port: SoundPort) -> None:
    port.present = False
    with pytest.raises(DeviceUnavailableError, match=r"does not open.*set vest\.options\.output"):
        SoundVest(SoundVestOptions()).open()


PING = bytes([0x89, 125]) + bytes(125)
TEXT = bytes([0x81, 2]) + b"{}"


@contextmanager
def flooded(piece: bytes, *, reads: bool) -> Iterator[PlayerLink]:
    """Connect to a server that greets, and then sends the same piece for ever."""
    pytest.importorskip("websockets", reason="needs the extra lab")
    from websockets.asyncio.server import serve

    go, over = threading.Event(), threading.Event()
    port: list[int] = []

    async def flood(connection: Any) -> None:
        while not go.is_set() and not over.is_set():
            await asyncio.sleep(0.01)
        transport = connection.transport
        if not reads:
            transport.pause_reading()
        while not over.is_set() and not transport.is_closing():
            if transport.get_write_buffer_size() < 1 << 20:
                transport.write(piece * 500)
            await asyncio.sleep(0)
        transport.abort()

    async def run() -> None:
        async with serve(flood, "127.0.0.1", 0, compression=None, ping_interval=None) as server:
            port.append(server.sockets[0].getsockname()[1])
            while not over.is_set():
                await asyncio.sleep(0.02)
            server.close(close_connections=True)

    thread = threading.Thread(target=lambda: asyncio.run(run()), daemon=True)
    thread.start()
    until(lambda: bool(port))
    link = PlayerLink(PlayerOptions(host="127.0.0.1", port=port[0], version="2", require_vest=False))
    link.connect()
    go.set()
    try:
        yield link
    finally:
        link.close()
        over.set()
        thread.join(10)
        gc.collect()


def driven(link: PlayerLink, seconds: float) -> str:
    """Send frames as a run does; return why the link was given up, or nothing."""
    frame, until_s = np.zeros(40, np.uint8), time.monotonic() + seconds
    while time.monotonic() < until_s:
        try:
            if link.ready(0.01):
                link.send(frame)
            link.poll()
        except DeviceUnavailableError as error:
            return error.message
    return ""


@pytest.mark.slow
def test_a_flood_of_pings_from_a_player_that_reads_nothing_ends_the_link() -> None:
    with flooded(PING, reads=False) as link:
        tracemalloc.start()
        try:
            text = driven(link, 20.0)
            _, peak_bytes = tracemalloc.get_traced_memory()
        finally:
            tracemalloc.stop()
    assert "it takes nothing any more" in text
    assert peak_bytes < 8 << 20


@pytest.mark.slow
def test_a_flood_of_messages_leaves_time_for_frames() -> None:
    with flooded(TEXT, reads=True) as link:
        time.sleep(0.2)
        for _ in range(50):
            link.poll()  # without a bound the first of them never ends
