"""Draw the page's latency strip: each delay over the last half minute, with its 99th percentile and the budget."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from html import escape
from typing import Final

from tega.loop.inbox.histogram import LEAST_SAMPLES

BUDGET_MS: Final = 88.0
"""Budget from picture to vest, ms: 17 of a picture, 33 of the camera, 5 of our own, 33 of the vest."""

_WITH_BUDGET = "picture to vest"

_N_KEPT = 300
_WIDTH, _HEIGHT, _TEXT, _LEFT = 380, 38, 16, 8


class Delays:
    """Keeps the delays that were shown, about half a minute of them."""

    def __init__(self) -> None:
        self._kept: dict[str, deque[float]] = {}

    def note(self, latency_ms: Mapping[str, float]) -> None:
        """Keep the delays of a moment, ms."""
        for name, delay in latency_ms.items():
            if math.isfinite(delay):
                self._kept.setdefault(name, deque(maxlen=_N_KEPT)).append(delay)

    def p99_ms(self, name: str) -> float:
        """Return the smallest delay that 99 % of those kept are not above, ms; the worst of fewer than 100."""
        ranked = sorted(self._kept[name])
        return ranked[math.ceil(0.99 * len(ranked)) - 1]

    def words(self, name: str) -> str:
        """Return the newest delay of a name, with p99, or with the worst where too few were kept, and their number."""
        kept = self._kept[name]
        figure = "p99" if len(kept) >= LEAST_SAMPLES else "worst"
        return f"{kept[-1]:.0f} ms · {figure} {self.p99_ms(name):.0f} (n {len(kept)})"

    def svg(self) -> str:
        """Return the strip, one line a delay; the red line is the budget of the one that has one."""
        height = _HEIGHT * len(self._kept)
        parts = [
            f'<svg viewBox="0 0 {_WIDTH} {height}" width="100%" role="img" aria-label="delays"'
            ' font-family="system-ui, sans-serif" font-size="10.5" fill="#495057">'
        ]
        for row, (name, kept) in enumerate(self._kept.items()):
            top, p99_ms = row * _HEIGHT, self.p99_ms(name)
            has_budget = name == _WITH_BUDGET
            full_ms = max(1.2 * BUDGET_MS, *kept)
            base, scale = top + _HEIGHT - 4, (_HEIGHT - _TEXT - 6) / full_ms
            step = (_WIDTH - 2 * _LEFT) / _N_KEPT
            points = " ".join(f"{_LEFT + k * step:.1f},{base - v * scale:.1f}" for k, v in enumerate(kept))
            y = base - BUDGET_MS * scale
            ink = "#c92a2a" if has_budget and p99_ms > BUDGET_MS else "#495057"
            allowed = f" · budget {BUDGET_MS:.0f}" if has_budget else ""
            limit = (
                f'<line x1="{_LEFT}" x2="{_WIDTH - _LEFT}" y1="{y:.1f}" y2="{y:.1f}" stroke="#fa5252"'
                ' stroke-width="0.8"/>'
            )
            parts.append(
                f'<text x="{_LEFT}" y="{top + 12}" fill="{ink}">{escape(name)} {self.words(name)}'
                f"{allowed}</text>{limit if has_budget else ''}"
                f'<polyline points="{points}" fill="none" stroke="#1f5fbf" stroke-width="1"/>'
            )
        return "".join(parts) + "</svg>"
