"""Draw the vest on the wearer's torso, seen from outside: both faces, one disc a motor."""

from __future__ import annotations

from collections.abc import Sequence

from tega.haptics import FINGERS, MotorLevels
from tega.ui.view.figures import FINGER_COLOURS

_WIDTH, _PITCH_X, _PITCH_Y, _TOP, _LEFT = 360, 32, 22, 46, 42
_N_COLUMNS = 4
TRIED = "tega-tried"
"""Class of the element that shows the result of a click on a motor."""

_N_STEPS = 15


def vest_svg(frame: MotorLevels | None, *, names: Sequence[str] = FINGERS, can_try: bool = False) -> str:
    """Draw the frame that a vest's motors are sent, as SVG; ``None`` without a vest, or if it is off.

    It shows the wearer's torso from outside, in front and from behind, so that their left is on the right of
    the first. ``names`` are those of the columns, from the wearer's left. The number in a disc is percent; the
    scale below has the 16 steps that reach a motor. If ``can_try``, a click on a motor asks the server to have it
    vibrate.
    """
    values = [0] * 40 if frame is None else [int(v) for v in frame.intensities]
    half = len(values) // 2
    bottom = _TOP + half // _N_COLUMNS * _PITCH_Y + 10
    off = " · off" if frame is None else ""
    parts = [
        f'<svg viewBox="0 0 {_WIDTH} {bottom + 26}" width="90%" style="display:block;margin:auto"'
        ' role="img" aria-label="vest, seen from outside"'
        ' font-family="system-ui, sans-serif" text-anchor="middle">'
    ]
    # The wearer's left is on the right in front, and on the left of the back.
    for title, left, turn, first in (("front · CCI", 0, -1, 0), ("back · EDA", _WIDTH // 2, 1, half)):
        middle = left + _WIDTH // 4
        torso = (
            f"M{middle - 14} 17 q0 8 -18 11 q-30 5 -38 16 q-8 12 -6 40 L{middle - 66} {bottom} "
            f"L{middle + 66} {bottom} L{middle + 76} 84 q2 -28 -6 -40 q-8 -11 -38 -16 q-18 -3 -18 -11 Z"
        )
        parts += [
            f'<path d="{torso}" fill="#f8f9fa" stroke="#ced4da"/>',
            f'<text x="{middle}" y="11" font-size="11" font-weight="600" fill="#343a40">{title}{off}</text>',
            *(
                f'<text x="{middle + x}" y="{bottom - 6}" font-size="10" font-weight="700" fill="#6c757d">{side}</text>'
                for x, side in zip((-76, 76), "LR"[::turn], strict=True)
            ),
        ]
        columns = [left + _LEFT + place * _PITCH_X for place in range(_N_COLUMNS)][::turn]
        colours = list(FINGER_COLOURS.values())
        parts += [
            f'<text x="{x}" y="{_TOP - 5}" font-size="8.5" font-weight="600" fill="{colour}">{name}</text>'
            for x, name, colour in zip(columns, names, colours, strict=True)
        ]
        for index, value in enumerate(values[first : first + half]):
            row, column = divmod(index, _N_COLUMNS)
            x, y = columns[column], _TOP + 11 + row * _PITCH_Y
            parts.append(
                f'<circle cx="{x}" cy="{y}" r="10" fill="{_heat(value)}" stroke="{colours[column]}"'
                f' stroke-width="0.8"{_click(first + index) if can_try else ""}/>'
            )
            if value:
                ink = "#ffffff" if value >= 55 else "#495057"
                parts.append(
                    f'<text x="{x}" y="{y + 3}" font-size="8.5" fill="{ink}" pointer-events="none">{value}</text>'
                )
    return "".join(parts) + _scale(bottom + 8) + "</svg>"


def _click(motor: int) -> str:
    message = f"document.querySelectorAll('.{TRIED}').forEach(e => e.textContent = t)"
    ask = f"fetch('try/{motor}').then(r => r.text()).then(t => {message})"
    return f' style="cursor:pointer" role="button" aria-label="try motor {motor}" onclick="{ask}"'


def _scale(y: int) -> str:
    width = (_WIDTH - 100) / (_N_STEPS + 1)
    steps = "".join(
        f'<rect x="{50 + step * width:.1f}" y="{y}" width="{width - 1:.1f}" height="7"'
        f' fill="{_heat(round(100 * step / _N_STEPS))}" stroke="#ced4da" stroke-width="0.4"/>'
        for step in range(_N_STEPS + 1)
    )
    ends = "".join(
        f'<text x="{x}" y="{y + 7}" font-size="8.5" fill="#6c757d">{text}</text>'
        for x, text in ((40, "0 %"), (_WIDTH - 34, "100 %"))
    )
    return steps + ends


def _heat(percent: int) -> str:
    """Return white at 0, orange at half, dark red at full."""
    stops = ((255, 255, 255), (253, 141, 60), (165, 15, 21))
    share = min(max(percent, 0), 100) / 50
    low = min(int(share), 1)
    part = share - low
    mixed = (round(a + (b - a) * part) for a, b in zip(stops[low], stops[low + 1], strict=True))
    return "#" + "".join(f"{value:02x}" for value in mixed)
