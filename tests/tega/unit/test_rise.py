"""An event is reported once its share has lasted, with the time at which it began."""

from __future__ import annotations

import pytest

from tega.stages.events.detector import DetectedEvent, Rise
from tega.stages.events.settings import Rule


def found(shares: list[float], *, least_s: float, look_ahead_s: float = 0.0) -> list[DetectedEvent]:
    """Return the events of shares that come ten times a second."""
    rise = Rise(
        "contact",
        Rule(bias=0.0, weights=(), enter=0.5, least_s=least_s),
        rest_s=1.0,
        look_ahead_s=look_ahead_s,
    )
    reported = (rise.add(k / 10, share, void=False) for k, share in enumerate(shares))
    return [one for one in reported if one is not None]


@pytest.mark.parametrize("n", range(1, 8))
def test_a_share_has_to_last(n: int) -> None:
    events = found([0.0, *[0.8] * n, *[0.0] * 5], least_s=0.3)
    assert [(one.t_s, one.known_s) for one in events] == ([(0.1, 0.4)] if n >= 4 else [])
    assert [one.confidence for one in events] == [0.8] * len(events)
