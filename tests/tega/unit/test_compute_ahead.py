"""Results that other threads compute ahead come in order, each with its item."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Iterator

import pytest

from tega.recording.pictures import compute_ahead


def test_every_item_comes_in_order_with_its_result_and_those_of_one_name_are_computed_in_order() -> None:
    computed: defaultdict[int, list[int]] = defaultdict(list)

    def compute(number: int) -> int:
        if number % 7 == 0:
            time.sleep(0.001)  # the next batch would overtake this one
        computed[number % 3].append(number)
        return -number

    found = list(
        compute_ahead(range(300), lambda number: "" if number % 3 == 0 else str(number % 3), compute)
    )
    assert found == [(number, -number if number % 3 else None) for number in range(300)]
    assert computed == {name: [*range(name, 300, 3)] for name in (1, 2)}


def test_an_error_is_raised_once_its_item_is_next() -> None:
    def compute(number: int) -> float:
        return 1 / (number - 5)

    ahead = compute_ahead(range(100), lambda _: "a", compute)
    assert [next(ahead)[0] for _ in range(5)] == [0, 1, 2, 3, 4]
    with pytest.raises(ZeroDivisionError):
        next(ahead)


@pytest.mark.parametrize(("name", "most"), [("a", 65), ("", 1)])
def test_what_is_read_stays_bounded(name: str, most: int) -> None:
    n_read = 0

    def numbers() -> Iterator[int]:
        nonlocal n_read
        for number in range(1000):
            n_read += 1
            yield number

    ahead = compute_ahead(numbers(), lambda _: name, lambda number: number)
    next(ahead)
    assert n_read <= most
