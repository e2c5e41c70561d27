"""The muscle sensors' packets byte for byte: computed by hand, captured from devices, or made by other programs."""

from __future__ import annotations

import numpy as np
import pytest

from reference import wire as reference
from tega import wire

CYTON = [
    bytes.fromhex(packet)
    for packet in (
        "A000 000000 000000 000000 000000 000000 000000 000000 000000 000000000000 C0",
        "A001 000001 FFFFFF 000002 FFFFFE 000100 FFFF00 010000 FF0000 000000000000 C0",
        "A002 7FFFFF 800000 800001 400000 C00000 7FFFFE 000000 000001 0010FFF01F40 C0",
        "A07F 00117A FFDD0C 005761 FF513D 0001BF FFFE41 01B4E8 FE4B18 000000000000 C0",
        "A0A0 A0A0A0 C0C0C0 00A0C0 A0A0A0 00C0A0 C0C0C0 20A0C0 A0C0A0 A0C0A0C0A0C0 C1",
        "A0FF 000064 0000C8 00012C 000190 0001F4 000258 0002BC 000320 00000001E240 C4",
        "A000 800000 800000 800000 800000 7FFFFF 7FFFFF 7FFFFF 7FFFFF 000000000000 C0",
        "A003 003039 FFCFC7 000000 000000 000000 000000 000000 000000 020003FF0000 C1",
    )
]
RAIL = -187500.022352
MICROVOLTS = [
    [0.0] * 8,
    [0.022352, -0.022352, 0.044703, -0.044703, 5.722047, -5.722047, 1464.843925, -1464.843925],
    [187500.0, RAIL, -187500.0, 93750.011176, -93750.011176, 187499.977648, 0.0, 0.022352],
    [100.001705, -200.003409, 499.986172, -999.994695, 9.99123, -9.99123, 2499.997914, -2499.997914],
    [
        -139705.913032,
        -92647.086697,
        919.818988,
        -139705.913032,
        1102.209223,
        -92647.086697,
        47794.824576,
        -139522.807541,
    ],
    [2.235174, 4.470349, 6.705523, 8.940698, 11.175872, 13.411047, 15.646221, 17.881396],
    [RAIL, RAIL, RAIL, RAIL, 187500.0, 187500.0, 187500.0, 187500.0],
    [275.932285, -275.932285, 0, 0, 0, 0, 0, 0],
]


def test_cyton_packets() -> None:
    batch = wire.CytonDecoder().feed(b"".join(CYTON))
    assert batch.counters.tolist() == [0, 1, 2, 127, 160, 255, 0, 3]
    assert batch.missing.tolist() == [0, 0, 0, 124, 32, 94, 0, 2]
    np.testing.assert_allclose(batch.microvolts, MICROVOLTS, rtol=0, atol=6e-7)
    assert batch.counts[2].tolist() == [8388607, -8388608, -8388607, 4194304, -4194304, 8388606, 0, 1]
    assert batch.counts[4].tolist() == [
        *(-6250336, -4144960, 41152, -6250336),
        *(49312, -4144960, 2138304, -6242144),
    ]
    assert batch.acceleration_g[2].tolist() == [0.002, -0.002, 1.0]
    assert np.isnan(batch.acceleration_g[[0, 4, 5, 7]]).all()
    assert batch.time_ms.tolist() == [-1, -1, -1, -1, -1, 123456, -1, -1]
    assert batch.footers.tolist() == [0xC0, 0xC0, 0xC0, 0xC0, 0xC1, 0xC4, 0xC0, 0xC1]
    assert batch.aux[7].view(">u2").tolist() == [512, 1023, 0]


def test_a_payload_full_of_headers_does_not_capture_the_decoder() -> None:
    five = CYTON[4]
    # Its counter stands still, so nothing tells the packets from what a late start makes of them.
    assert len(wire.CytonDecoder().feed(five[2:] + five * 3)) == 0
    # The same packets with a counter that runs are all found, whatever came before.
    run = b"".join(five[:1] + bytes([n]) + five[2:] for n in range(160, 168))
    batch = wire.CytonDecoder().feed(five[2:] + run)
    assert batch.counters.tolist() == list(range(160, 168))
    assert (batch.counts == reference.cyton_counts(five)).all()


def test_chords_packets() -> None:
    decoder = wire.ChordsDecoder(3)
    counters, missing, samples = decoder.feed(bytes.fromhex("C77C00000000000000 01 C77C0102000800 0FFF 01"))
    assert (counters.tolist(), missing.tolist()) == ([0, 1], [0, 0])
    assert samples.tolist() == [[0, 0, 0], [512, 2048, 4095]]
    # A sync inside the payload: given once the next packet has shown where it begins.
    inside = bytes.fromhex("C77C FF C77C 0001 0100 01")
    assert len(decoder.feed(inside).counters) == 0
    counters, missing, samples = decoder.feed(bytes.fromhex("C77C00000000000000 01"))
    assert (counters.tolist(), missing.tolist()) == ([255, 0], [253, 0])
    assert samples.tolist() == [[51068, 1, 256], [0, 0, 0]]


def test_spiker_frames() -> None:
    decoder = wire.SpikerDecoder(3)
    stream = b"StartUp!" + bytes.fromhex("800000000000 877F00000400 837F007F0100 80")
    assert decoder.feed(stream).tolist() == [[0, 0, 0], [1023, 0, 512], [511, 127, 128]]
    assert (decoder.frames, decoder.bad_frames, decoder.skipped_bytes, decoder.pending_bytes) == (3, 0, 8, 1)


@pytest.mark.parametrize(
    ("line", "samples"),
    [
        (b"2048.0,2066.0,-9.25E-4,", [2048.0, 2066.0, -9.25e-4]),
        (b"1;2;3\r", [1.0, 2.0, 3.0]),
        (b"1\t2\t3", [1.0, 2.0, 3.0]),
        (b"emg1:1,emg2:2,emg3:3", [1.0, 2.0, 3.0]),
        (b"MyoWare Example_01", None),
        (b"1,2", None),
        (b"1,2,nan", None),
        (b"1,2,0x10", None),
        (b"1,2,3,4", None),
        (b"1" * 257, None),
    ],
)
def test_ascii_lines(line: bytes, samples: list[float] | None) -> None:
    decoder = wire.AsciiEmgDecoder(3)
    found = decoder.feed(b"cut\n" + line + b"\n")
    assert found.tolist() == ([] if samples is None else [samples])
    assert (decoder.lines, decoder.rejected_lines) == ((0, 1) if samples is None else (1, 0))
    assert (decoder.dropped_bytes, decoder.pending_bytes) == (4, 0)
    assert decoder.last_rejected == (line[:256] if samples is None else b"")
