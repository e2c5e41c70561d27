"""Write the pictures of packets on the pages of wire formats: ``python -m tega_figures.byte_layouts docs/images``."""

from __future__ import annotations

import sys
from html import escape
from pathlib import Path
from typing import Final, NamedTuple

from tega import wire
from tega.ui.view.figures import FINGER_COLOURS
from tega_figures.boxes import FILLS, GROUND, INK, SOFT

__all__ = ["main"]

UNIT, HEIGHT, LEFT = 26.0, 40.0, 16.0


class PacketField(NamedTuple):
    """Neighbouring cells of a packet: how many, and what they hold."""

    n_cells: float
    text: str
    kind: str = "tega"


ROWS: Final[dict[str, tuple[tuple[str, tuple[PacketField, ...]], ...]]] = {
    "wire-can": (
        ("CAN identifier, 11 bits", (PacketField(9, "message number"), PacketField(2, "device", "person"))),
        (
            "set torque, 8 bytes (each cell half a byte)",
            tuple(PacketField(4, f"joint {n}, int16", "robot" if n % 2 else "tega") for n in range(4)),
        ),
    ),
    "wire-packets": (
        (
            "OpenBCI Cyton, 33 bytes",
            (
                PacketField(2, "0xA0", "safe"),
                PacketField(2.5, "counter", "person"),
                PacketField(15, "8 channels × int24, high byte first"),
                PacketField(5, "6 auxiliary", "other"), PacketField(3, "0xC0…C6", "safe"),
            ),
        ),
        (
            "Chords, N channels",
            (
                PacketField(4, "0xC7 0x7C", "safe"),
                PacketField(2.5, "counter", "person"),
                PacketField(15, "N channels × uint16, high byte first"),
                PacketField(2, "0x01", "safe"),
            ),
        ),
    ),
}  # fmt: skip


def _text(
    x: float, y: float, message: str, size: int = 12, *, colour: str = INK, anchor: str = "middle"
) -> str:
    style = f'font-size="{size}" fill="{colour}" text-anchor="{anchor}"'
    return f'<text x="{x:.1f}" y="{y:.1f}" {style}>{escape(message)}</text>'


def _svg(width: float, height: float, title: str, parts: list[str]) -> str:
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" width="{width:.0f}" '
            f'height="{height:.0f}" font-family="Helvetica, Arial, sans-serif">',
            f"<title>{escape(title)}</title>",
            f'<rect width="{width:.0f}" height="{height:.0f}" rx="8" fill="{GROUND}"/>',
            *parts,
            "</svg>",
            "",
        ]
    )


def packets(name: str) -> str:
    """Draw packets as rows of cells."""
    parts, y = [], 14.0
    width = max(sum(f.n_cells for f in fields) for _, fields in ROWS[name]) * UNIT + 2 * LEFT
    for title, fields in ROWS[name]:
        parts.append(_text(LEFT, y + 14, title, 13, anchor="start"))
        x = LEFT
        for field in fields:
            wide = field.n_cells * UNIT
            parts.append(
                f'<rect x="{x:.1f}" y="{y + 24:.1f}" width="{wide:.1f}" height="{HEIGHT}" fill="{FILLS[field.kind]}" '
                f'stroke="{INK}"/>'
            )
            parts.append(_text(x + wide / 2, y + 24 + HEIGHT / 2 + 4, field.text))
            x += wide
        y += HEIGHT + 44
    return _svg(width, y, name, parts)


def slots() -> str:
    """Draw which slot of the Bluetooth frame is which motor, as the encoder has it."""
    where = {}
    for motor in range(40):
        values = [0] * 40
        values[motor] = 100
        frame = wire.x40_ble_frame(values)
        (byte,) = [n for n, value in enumerate(frame) if value]
        where[motor] = 2 * byte + (frame[byte] < 16)
    parts, colours = [], list(FINGER_COLOURS.values())
    for face, title in enumerate(("front", "back")):
        left = LEFT + 300 * face
        parts.append(_text(left + 125, 26, f"{title}, wearer's left to right", 13))
        for row in range(5):
            for column in range(4):
                x, y = left + 30 + 64 * column, 58 + 46 * row
                motor = 20 * face + 4 * row + column
                parts.append(
                    f'<circle cx="{x}" cy="{y}" r="19" fill="{colours[column]}" fill-opacity="0.35" stroke="{INK}"/>'
                )
                parts.append(_text(x, y + 1, f"slot {where[motor]}", 10))
                parts.append(_text(x, y + 12, f"m{motor}", 9, colour=SOFT))
    return _svg(616, 290, "Which slot of the Bluetooth frame is which motor", parts)


def main(folder: Path) -> None:
    """Write every picture into a folder."""
    for name in ROWS:
        (folder / f"{name}.svg").write_text(packets(name), encoding="utf-8")
    (folder / "wire-x40.svg").write_text(slots(), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
