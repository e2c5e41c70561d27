"""The wire formats once more, in plain Python with exact numbers, whole streams at a time."""

from __future__ import annotations

import json
import math
import re
import struct
import zlib
from collections.abc import Sequence
from fractions import Fraction

LIMITS = [375, 675, 450, 285] * 3 + [525, 405, 270, 270]

# Where each motor of a panel, row by row from the top left of the wearer, sits in the vest's frame.
FRONT_SLOTS = [31, 30, 1, 0, 33, 32, 3, 2, 35, 34, 5, 4, 37, 36, 7, 6, 39, 38, 9, 8]
BACK_SLOTS = [10, 11, 20, 21, 12, 13, 22, 23, 14, 15, 24, 25, 16, 17, 26, 27, 18, 19, 28, 29]
# Slots whose maximum an X16's motor takes: the first of each group, by the group's place in its block of ten.
X16_HEADS = [31, 30, 1, 0, 35, 34, 5, 4, 10, 11, 20, 21, 14, 15, 24, 25]


def torque_counts_exact(tau: float, joint: int) -> Fraction:
    """Return the clamped counts before rounding, exactly."""
    return max(min(Fraction(tau) * 1200, Fraction(LIMITS[joint])), Fraction(-LIMITS[joint]))


def round_half_away(value: Fraction) -> int:
    magnitude = math.floor(abs(value) + Fraction(1, 2))
    return magnitude if value >= 0 else -magnitude


def torque_frame(finger: int, counts: Sequence[int], device: int = 0) -> tuple[int, bytes]:
    return (0x60 + finger) << 2 | device, struct.pack("<4h", *counts)


def level(intensity: int) -> int:
    """Return the nearest of sixteen levels, halves upwards."""
    return math.floor(Fraction(15 * intensity, 100) + Fraction(1, 2))


def slots(*, front_mirror: bool) -> list[int]:
    front = [FRONT_SLOTS[4 * (i // 4) + 3 - i % 4] for i in range(20)] if front_mirror else FRONT_SLOTS
    return front + BACK_SLOTS


def ble_frame(intensities: Sequence[int], *, front_mirror: bool = False) -> bytes:
    """Return the vest's frame, from its forty hexadecimal digits."""
    digits = ["0"] * 40
    for slot, intensity in zip(slots(front_mirror=front_mirror), intensities, strict=True):
        digits[slot] = f"{level(intensity):x}"
    return bytes.fromhex("".join(digits))


def x16_levels(frame: bytes) -> list[int]:
    digits = [int(digit, 16) for digit in frame.hex()]
    groups = [[0, 2] if head % 10 in {0, 1} else [0, 2, 4] for head in X16_HEADS]
    return [max(digits[head + step] for step in group) for head, group in zip(X16_HEADS, groups, strict=True)]


def compact(value: object) -> str:
    """Return JSON without blanks, as the vendor's programs send it."""
    return json.dumps(value, separators=(",", ":"), ensure_ascii=False)


def player_v2_message(intensities: Sequence[int], duration_ms: int, keys: dict[str, str]) -> str:
    """Return a Player message; `keys` maps "VestFront" and "VestBack" to their keys."""
    panels = {"VestFront": intensities[:20], "VestBack": intensities[20:]}
    submit = [
        {
            "Type": "frame",
            "Key": key,
            "Frame": {
                "Position": position,
                "DurationMillis": duration_ms,
                "DotPoints": [
                    {"Index": index, "Intensity": value}
                    for index, value in enumerate(panels[position])
                    if value
                ],
                "PathPoints": [],
            },
        }
        for position, key in keys.items()
    ]
    return compact({"Register": [], "Submit": submit})


def hid_report(head: bytes, body: bytes = b"") -> bytes:
    report = (head + body).ljust(60, b"\0")
    return report + struct.pack("<I", zlib.crc32(report))


def hid_motor_report(levels: Sequence[int], sequence: int, ttl_ms: int, *, request_status: bool) -> bytes:
    layout = {40: 0, 32: 1}[len(levels)]
    flags = 0x12 if request_status else 0x10
    return hid_report(struct.pack("<BBHHBB", 1, flags, sequence, ttl_ms, layout, len(levels)), bytes(levels))


def cyton_counts(packet: bytes) -> list[int]:
    return [int.from_bytes(packet[at : at + 3], "big", signed=True) for at in range(2, 26, 3)]


def cyton_microvolts(counts: int, gain: int) -> Fraction:
    return Fraction(counts * 4_500_000, gain * (2**23 - 1))


def frames(
    stream: bytes, length: int, header: bytes, counter_at: int, ends: range
) -> tuple[list[bytes], int]:
    """Find frames in a whole stream by the four rules, each looked up in the bytes that are there.

    Returns:
        The frames, and how many bytes at the end are still undecided.
    """
    starts = {
        at
        for at in range(len(stream) - length + 1)
        if stream.startswith(header, at) and stream[at + length - 1] in ends
    }

    def follows(at: int) -> bool:
        step = stream[at + length + counter_at] - stream[at + counter_at]
        return step % 256 == 1

    def score(at: int) -> tuple[int, int]:
        links = [at] if at + length in starts else []
        links += [at + length] if links and at + 2 * length in starts else []
        return sum(follows(link) for link in links), len(links)

    found: list[bytes] = []
    at, previous = 0, -1
    while at < len(stream):
        have = len(stream) - at
        if not header.startswith(stream[at : at + len(header)]):
            at += 1
            continue
        if have < length:
            break
        if at not in starts:
            at += 1
            continue
        inside = stream[at + 1 : at + length]
        cut = any(header.startswith(inside[-n:]) for n in range(1, len(header)))
        proven = previous >= 0 and previous + length == at and follows(previous)
        if not proven and (header in inside or cut):
            if have < 2 * length - 1:
                break
            rivals = [rival for rival in range(at + 1, at + length) if rival in starts]
            if rivals:
                if have < 4 * length - 1:
                    break
                own, best = score(at), max(map(score, rivals))
                if best > own or (best == own and own[0] == 0):
                    at += 1
                    continue
        found.append(stream[at : at + length])
        previous = at
        at += length
    return found, len(stream) - at


def cyton_packets(stream: bytes) -> tuple[list[bytes], int]:
    return frames(stream, 33, b"\xa0", 1, range(0xC0, 0xC7))


def chords_packets(stream: bytes, channels: int) -> tuple[list[bytes], int]:
    return frames(stream, 2 * channels + 4, b"\xc7\x7c", 2, range(1, 2))


def spiker_frames(stream: bytes, channels: int) -> list[list[int]]:
    """Find SpikerShield frames in a whole stream; the last one is still open."""
    found = []
    for run in re.findall(rb"[\x80-\xff][\x00-\x7f]*(?=[\x80-\xff])", stream):
        if len(run) == 2 * channels:
            values = [(run[at] & 0x7F) * 128 + run[at + 1] for at in range(0, len(run), 2)]
            if max(values) < 1024:
                found.append(values)
    return found


_NUMBER = rb"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
_BLANKS = rb"[ \t\r\f]*"
_FIELD = rb"(?:[!-+\--9<-~]+:" + _BLANKS + rb")?(" + _NUMBER + rb")(?=[,; \t]|\Z)"
_SEPARATOR = _BLANKS + rb"[,;]?" + _BLANKS


def ascii_line(line: bytes, channels: int, leading: int = 0) -> list[float] | None:
    """Read one line without its line break; None where it is refused."""
    line = line.strip(b" \t\r\f")
    if len(line) == 0 or not re.fullmatch(rb"(?:" + _FIELD + _SEPARATOR + rb")+", line):
        return None
    values = [float(field) for field in re.findall(_FIELD + _SEPARATOR, line)]
    if len(values) != leading + channels or not all(map(math.isfinite, values)):
        return None
    return values[leading:]


def ascii_samples(stream: bytes, channels: int, leading: int = 0) -> tuple[list[list[float]], int]:
    """Read a whole stream whose first line is cut; samples, and how many lines were refused."""
    lines = stream.split(b"\n")[1:-1]
    read = [ascii_line(line, channels, leading) if len(line) <= 256 else None for line in lines]
    return [values for values in read if values is not None], read.count(None)
