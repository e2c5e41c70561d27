"""The loops that Numba compiles, where it is installed."""

from __future__ import annotations

from functools import cache
from typing import Any

__all__ = ["contact_loops", "filter_loop"]

BLUE, GREEN, RED = 0.114, 0.587, 0.299


@cache
def contact_loops() -> tuple[Any, Any]:
    """Return the compiled loops of the contact metrics: sums and peak, and the count above the threshold."""
    import numba

    @numba.njit(fastmath=True, inline="always")  # type: ignore[untyped-decorator,unused-ignore]
    def grey(frame: Any, baseline: Any, mode: int, row: int, column: int) -> Any:
        b = float(frame[row, column, 0]) - float(baseline[row, column, 0])
        g = float(frame[row, column, 1]) - float(baseline[row, column, 1])
        r = float(frame[row, column, 2]) - float(baseline[row, column, 2])
        if mode == 1:
            b, g, r = max(b, 0.0), max(g, 0.0), max(r, 0.0)
        elif mode == 2:
            b, g, r = abs(b), abs(g), abs(r)
        return BLUE * b + GREEN * g + RED * r

    @numba.njit(fastmath=True)  # type: ignore[untyped-decorator,unused-ignore]
    def sum_up(frame: Any, baseline: Any, mode: int) -> Any:
        mass = first_x = first_y = second = squares = 0.0
        peak = -1e300
        for row in range(frame.shape[0]):
            row_mass = row_x = row_xx = 0.0
            for column in range(frame.shape[1]):
                n = grey(frame, baseline, mode, row, column)
                row_mass += n
                row_x += n * column
                row_xx += n * column * column
                squares += n * n
                peak = max(peak, n)
            mass += row_mass
            first_x += row_x
            first_y += row_mass * row
            second += row_xx + row_mass * row * row
        return mass, first_x, first_y, second, squares, peak

    @numba.njit(fastmath=True)  # type: ignore[untyped-decorator,unused-ignore]
    def count(frame: Any, baseline: Any, mode: int, at: Any, step: float) -> Any:
        threshold = grey(frame, baseline, mode, at[0], at[1]) - step
        above = 0
        for row in range(frame.shape[0]):
            for column in range(frame.shape[1]):
                above += grey(frame, baseline, mode, row, column) > threshold
        return above

    return sum_up, count


@cache
def filter_loop() -> Any:
    """Return the compiled recursion over second-order sections, rows of samples in, state kept in place."""
    import numba

    @numba.njit  # type: ignore[untyped-decorator,unused-ignore]
    def run(sections: Any, state: Any, samples: Any, out: Any) -> None:
        for channel in range(samples.shape[1]):
            for i in range(samples.shape[0]):
                x = samples[i, channel]
                for s in range(sections.shape[0]):
                    y = sections[s, 0] * x + state[s, 0, channel]
                    state[s, 0, channel] = sections[s, 1] * x - sections[s, 4] * y + state[s, 1, channel]
                    state[s, 1, channel] = sections[s, 2] * x - sections[s, 5] * y
                    x = y
                out[i, channel] = x

    return run
