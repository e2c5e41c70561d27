"""Wire formats against the plain Python ones, on anything."""

from __future__ import annotations

import json
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference import wire as reference
from tega import wire
from tega.errors import WireError

intensities = st.lists(st.integers(0, 100), min_size=40, max_size=40)
torques = st.lists(
    st.floats(-2, 2) | st.integers(-1300, 1300).map(lambda n: n / 1200) | st.floats(-1e300, 1e300),
    min_size=16,
    max_size=16,
)


def biased(often: bytes, size: int) -> st.SearchStrategy[bytes]:
    """Bytes among which those of `often` are common."""
    byte = st.sampled_from(list(often)) | st.sampled_from(list(often)) | st.integers(0, 255)
    return st.lists(byte, max_size=size).map(bytes)


@st.composite
def framed(draw: st.DrawFn, header: bytes, end: int, length: int) -> bytes:
    """Frames with a counter that mostly runs, some of them cut short, payloads full of headers."""
    stream = b""
    for number in range(draw(st.integers(0, 12))):
        body = draw(biased(header + bytes([end, 0xC0, 0x01]), length))
        counter = draw(st.sampled_from([number, number, number, 0xA0]))
        frame = (header + bytes([counter]) + body).ljust(length - 1, b"\0")[: length - 1] + bytes([end])
        stream += frame[: draw(st.sampled_from([length, length, length, 0, 5, length - 1]))]
    return stream


def chunks(stream: bytes, sizes: list[int]) -> list[bytes]:
    ends = [min(end, len(stream)) for end in np.cumsum([0, *sizes, len(stream)]).tolist()]
    return [stream[a:b] for a, b in pairwise(ends)]


sizes = st.lists(st.integers(0, 70), max_size=12)


@given(torques, st.integers(0, 3))
def test_torque_frames_are_the_exact_counts_rounded(tau: list[float], device: int) -> None:
    frames = wire.allegro_torque_frames(tau, device_id=device)
    exact = [reference.torque_counts_exact(value, joint) for joint, value in enumerate(tau)]
    sent: list[int] = []
    for frame in frames:
        decoded = wire.allegro_decode(frame, device_id=device)
        assert isinstance(decoded, wire.AllegroTorque)
        assert frame == (
            *reference.torque_frame(wire.HAND_FINGERS.index(decoded.finger), decoded.counts, device),
            False,
        )
        sent += decoded.counts
    for counts, value in zip(sent, exact, strict=True):
        nearest = reference.round_half_away(value)
        # The product is rounded to double precision first, which may move it onto or off a half.
        assert counts == nearest or abs(abs(value - counts) - Fraction(1, 2)) < Fraction(1, 10**12)
        assert abs(counts) <= 675


@given(st.lists(st.integers(-32768, 32767), min_size=16, max_size=16))
def test_angles_come_back(counts: list[int]) -> None:
    angles = wire.allegro_angles_rad(counts)
    exact = [Fraction(3333, 10 * 65536 * 180) * n * Fraction(np.pi) for n in counts]
    np.testing.assert_allclose(angles, [float(value) for value in exact], rtol=4e-16, atol=0)
    np.testing.assert_array_equal(wire.allegro_angle_counts(angles), counts)
    frames = wire.allegro_position_frames(angles)
    decoded = [wire.allegro_decode(frame) for frame in frames]
    assert [
        n for message in decoded if isinstance(message, wire.AllegroPosition) for n in message.counts
    ] == counts


@given(st.integers(0, 0x900), st.binary(max_size=10), st.booleans(), st.booleans(), st.integers(0, 3))
def test_any_can_frame_is_a_message_or_a_reason(can_id, data, remote, extended, device) -> None:
    frame = wire.CanFrame(can_id, data, remote)
    message = wire.allegro_decode(frame, device_id=device, extended=extended)
    if remote or extended or can_id > 0x7FF or can_id & 3 != device:
        assert isinstance(message, wire.AllegroRejected)
    if isinstance(message, wire.AllegroInfo | wire.AllegroPosition | wire.AllegroStatus | wire.AllegroImu):
        encoded = wire.allegro_report_frame(message, device_id=device)
        assert wire.allegro_decode(encoded, device_id=device) == message


@given(intensities, st.booleans())
def test_vest_frames(values: list[int], mirror: bool) -> None:
    frame = wire.x40_ble_frame(values, front_mirror=mirror)
    assert frame == reference.ble_frame(values, front_mirror=mirror)
    levels = wire.vest_levels(values)
    assert levels.tolist() == [reference.level(value) for value in values]
    np.testing.assert_array_equal(wire.x40_ble_levels(frame, front_mirror=mirror), levels)
    assert wire.x16_levels(frame).tolist() == reference.x16_levels(frame)


@given(intensities, st.integers(20, 100_000), st.text(min_size=1), st.text(min_size=1))
def test_player_messages(values: list[int], duration_ms: int, front: str, back: str) -> None:
    message = wire.player_v2_message(values, duration_ms=duration_ms, front_key=front, back_key=back)
    keys = {"VestFront": front, "VestBack": back}
    assert json.loads(message) == json.loads(reference.player_v2_message(values, duration_ms, keys))
    one = wire.player_v2_message(values, duration_ms=duration_ms, front_key=None, back_key="b")
    assert one == reference.player_v2_message(values, duration_ms, {"VestBack": "b"})
    assert json.loads(wire.player_v2_stop(front)) == {"Submit": [{"Type": "turnOff", "Key": front}]}


@given(intensities, st.integers(0, 2**32 - 1), st.integers(20, 100_000))
def test_newer_sockets(values: list[int], request_id: int, duration_ms: int) -> None:
    inner = {"requestId": request_id, "position": 0, "motorValues": values, "durationMillis": duration_ms}
    wanted = {"Type": "SdkPlayDotMode", "Message": reference.compact(inner | {"deviceIndex": -1})}
    message = wire.sdk3_dot_message(values, request_id=request_id, duration_ms=duration_ms)
    assert message == reference.compact(wanted)
    hub = {"requestId": request_id, "pos": 0, "motors": values, "durationMillis": duration_ms}
    line = wire.hub_line(values, request_id=request_id, duration_ms=duration_ms)
    assert line == reference.compact({"message": reference.compact(hub), "type": "SdkPlayDotMode"}) + "\n"


def json_containers(inner: st.SearchStrategy[object]) -> st.SearchStrategy[object]:
    """Lists, and objects with the names a status has."""
    names = st.sampled_from(["Status", "VestFront", "ActiveKeys", "ConnectedDeviceCount", "Other"])
    return st.lists(inner) | st.dictionaries(names, inner)


@given(st.text() | st.recursive(st.none() | st.integers() | st.text(), json_containers).map(json.dumps))
def test_any_status_is_read_or_refused(text: str) -> None:
    try:
        status = wire.player_v2_status(text)
    except WireError:
        return
    assert isinstance(json.loads(text), dict)
    assert len(status.front) <= len(text)


@given(intensities, st.integers(0, 65535), st.integers(1, 65535), st.booleans(), st.sampled_from([40, 32]))
def test_hid_reports(values: list[int], sequence: int, ttl_ms: int, status: bool, count: int) -> None:
    values = values[:count]
    report = wire.hid_motor_report(values, sequence=sequence, ttl_ms=ttl_ms, request_status=status)
    assert report == reference.hid_motor_report(values, sequence, ttl_ms, request_status=status)
    read = wire.hid_motor(report)
    assert read.intensities is not None
    assert (read.sequence, read.ttl_ms, read.request_status) == (sequence, ttl_ms, status)
    np.testing.assert_array_equal(read.intensities, values)


@given(
    biased(b"\xa0\xc0\xc4", 400) | framed(b"\xa0", 0xC0, 33), sizes, st.sampled_from([1, 2, 4, 6, 8, 12, 24])
)
def test_cyton_streams(stream: bytes, cuts: list[int], gain: int) -> None:
    decoder = wire.CytonDecoder(gain)
    batches = [decoder.feed(chunk) for chunk in chunks(stream, cuts)]
    packets, pending = reference.cyton_packets(stream)
    assert [n for batch in batches for n in batch.counters.tolist()] == [packet[1] for packet in packets]
    counts = [row for batch in batches for row in batch.counts.tolist()]
    assert counts == [reference.cyton_counts(packet) for packet in packets]
    microvolts = [value for batch in batches for value in batch.microvolts.ravel().tolist()]
    assert microvolts == [float(reference.cyton_microvolts(n, gain)) for row in counts for n in row]
    missing = [n for batch in batches for n in batch.missing.tolist()]
    assert missing[1:] == [(b[1] - a[1] - 1) % 256 for a, b in pairwise(packets)]
    assert (decoder.packets, decoder.missing_packets, decoder.pending_bytes) == (
        len(packets),
        sum(missing),
        pending,
    )
    assert decoder.skipped_bytes == len(stream) - 33 * len(packets) - pending


@given(biased(b"\xc7\x7c\x01", 200) | framed(b"\xc7\x7c", 1, 10), sizes, st.integers(1, 4))
def test_chords_streams(stream: bytes, cuts: list[int], channels: int) -> None:
    decoder = wire.ChordsDecoder(channels)
    batches = [decoder.feed(chunk) for chunk in chunks(stream, cuts)]
    packets, pending = reference.chords_packets(stream, channels)
    samples = [row for batch in batches for row in batch.samples.tolist()]
    assert samples == [np.frombuffer(packet[3:-1], ">u2").tolist() for packet in packets]
    assert decoder.pending_bytes == pending
    assert decoder.skipped_bytes == len(stream) - (2 * channels + 4) * len(packets) - pending


@given(biased(b"\x80\x87\x00\x7f\x03", 200), sizes, st.integers(1, 3))
def test_spiker_streams(stream: bytes, cuts: list[int], channels: int) -> None:
    decoder = wire.SpikerDecoder(channels)
    frames = [row for chunk in chunks(stream, cuts) for row in decoder.feed(chunk).tolist()]
    assert frames == reference.spiker_frames(stream, channels)
    assert decoder.frames == len(frames)
    assert decoder.skipped_bytes + decoder.pending_bytes == len(stream) - 2 * channels * len(frames)


number = st.floats(allow_nan=False, allow_infinity=False).map(repr) | st.integers(-5000, 5000).map(str)
field = st.tuples(st.sampled_from(["", "", "ch1:", "a: ", ":", "x"]), number).map("".join)
separator = st.sampled_from([",", ";", "\t", " ", ", ", " ;\t", ",,", ""])


@st.composite
def lines(draw: st.DrawFn) -> bytes:
    """A line that is mostly right."""
    fields = draw(st.lists(field, min_size=2, max_size=4))
    joined = "".join(text + draw(separator) for text in fields)
    return (
        draw(st.sampled_from(["", "", " ", ","])) + joined + draw(st.sampled_from(["\r\n", "\n"]))
    ).encode()


@given(
    st.lists(lines() | biased(b"\n\r,; \t:0123456789.-+eE", 60), max_size=8).map(b"".join),
    sizes,
    st.integers(1, 3),
    st.integers(0, 1),
)
def test_ascii_streams(stream: bytes, cuts: list[int], channels: int, leading: int) -> None:
    decoder = wire.AsciiEmgDecoder(channels, leading=leading)
    samples = [row for chunk in chunks(stream, cuts) for row in decoder.feed(chunk).tolist()]
    wanted, rejected = reference.ascii_samples(stream, channels, leading)
    assert samples == wanted
    assert (decoder.lines, decoder.rejected_lines) == (len(wanted), rejected)


@given(st.lists(lines(), min_size=1, max_size=4).map(b"".join))
def test_a_file_begins_with_a_whole_line(stream: bytes) -> None:
    decoder = wire.AsciiEmgDecoder(drop_first_line=False)
    assert decoder.feed(stream).tolist() == reference.ascii_samples(b"\n" + stream, 3)[0]
    assert decoder.dropped_bytes == 0


@given(st.integers(1, 16), st.integers(0, 255), st.binary(max_size=20))
def test_the_channel_count_of_a_chords_stream_is_read_off(channels: int, first: int, garbage: bytes) -> None:
    packets = [
        b"\xc7\x7c" + bytes([(first + n) % 256]) + np.full(channels, 2048 + n, ">u2").tobytes() + b"\x01"
        for n in range(8)
    ]
    assert wire.chords_channels(garbage + b"".join(packets)) == channels


@pytest.mark.parametrize("chunk_size", [1, 7, 33, 452])
def test_feeding_keeps_little(chunk_size: int) -> None:
    decoder = wire.CytonDecoder()
    for _ in range(50):
        decoder.feed(b"\xa0" * chunk_size)
        assert decoder.pending_bytes <= 130


_json = st.recursive(
    st.none() | st.booleans() | st.integers(-2, 200) | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(["Type", "message", "Message", "position", "deviceName", "connected", "battery"]),
            inner | st.sampled_from(["ServerDevices", "ServerReady"]),
            max_size=6,
        )
    ),
    max_leaves=12,
)


@given(
    _json | st.builds(lambda inner: {"Type": "ServerDevices", "Message": inner}, _json),
    st.booleans(),
    st.text(),
)
def test_whatever_a_player_of_version_3_says_is_read_or_refused(sentence, nested, text) -> None:
    if nested and isinstance(sentence, dict) and "Message" in sentence:
        sentence = {**sentence, "Message": json.dumps(sentence["Message"])}
    for message in (json.dumps(sentence), text, json.dumps(sentence)[: len(text)]):
        try:
            read = wire.sdk3_server_message(message)
        except WireError as error:
            assert len(str(error)) < 300  # noqa: PT017
            continue
        assert all(len(d.name) <= 40 and d.name.isprintable() for d in read.devices)
        assert all(d.battery_percent is None or 0 <= d.battery_percent <= 100 for d in read.devices)
