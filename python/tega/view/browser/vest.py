"""The vest as a drawing: both faces, one disc a motor, as seen on the wearer's own body."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tega.haptics import FINGERS

if TYPE_CHECKING:
    from tega.haptics import VestFrame

__all__ = ["vest_svg"]

_WIDTH, _PITCH_X, _PITCH_Y, _TOP, _LEFT = 360, 36, 24, 34, 36
_N_COLUMNS = 4


def vest_svg(frame: VestFrame | None) -> str:
    """Draw the vest.

    Args:
        frame: What the motors are told; ``None`` where there is no vest, or it is off.

    Returns:
        An SVG element. Columns are thumb to ring from the left of each face; the number in a disc is percent.
    """
    values = [0] * 40 if frame is None else [int(v) for v in frame.intensities]
    half = len(values) // 2
    n_rows = half // _N_COLUMNS
    height = _TOP + n_rows * _PITCH_Y + 8
    off = " · off" if frame is None else ""
    faces = ((f"front · CCI{off}", values[:half], 0), (f"back · EDA{off}", values[half:], _WIDTH // 2))
    parts = [
        f'<svg viewBox="0 0 {_WIDTH} {height}" width="100%" role="img" aria-label="vest"'
        ' font-family="system-ui, sans-serif" text-anchor="middle">'
    ]
    for title, face, left in faces:
        parts.append(_face(title, face, left, height))
    return "".join(parts) + "</svg>"


def _face(title: str, values: list[int], left: int, height: int) -> str:
    middle = left + _WIDTH // 4
    parts = [
        f'<rect x="{left + 6}" y="16" width="{_WIDTH // 2 - 12}" height="{height - 18}" rx="16"'
        ' fill="#f1f3f5" stroke="#ced4da"/>',
        f'<text x="{middle}" y="11" font-size="11" font-weight="600" fill="#343a40">{title}</text>',
    ]
    for column, finger in enumerate(FINGERS):
        x = left + _LEFT + column * _PITCH_X
        parts.append(f'<text x="{x}" y="29" font-size="8.5" fill="#6c757d">{finger}</text>')
    for index, value in enumerate(values):
        row, column = divmod(index, _N_COLUMNS)
        x, y = left + _LEFT + column * _PITCH_X, _TOP + 11 + row * _PITCH_Y
        ink = "#ffffff" if value >= 55 else "#495057"
        parts.append(
            f'<circle cx="{x}" cy="{y}" r="{10:g}" fill="{_heat(value)}" stroke="#adb5bd" stroke-width="0.6"/>'
        )
        if value:
            parts.append(f'<text x="{x}" y="{y + 3}" font-size="8.5" fill="{ink}">{value}</text>')
    return "".join(parts)


def _heat(percent: int) -> str:
    """Return white at 0, orange at half, dark red at full."""
    stops = ((255, 255, 255), (253, 141, 60), (165, 15, 21))
    share = min(max(percent, 0), 100) / 50
    low = min(int(share), 1)
    part = share - low
    mixed = (round(a + (b - a) * part) for a, b in zip(stops[low], stops[low + 1], strict=True))
    return "#" + "".join(f"{value:02x}" for value in mixed)
