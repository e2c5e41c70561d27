"""Draw the order of conditions and objects from a seed, balanced over people.

Nothing here uses a random number generator: items are sorted by a hash of the seed and their own name, so that a seed
gives the same order under every version of every library.
"""

from __future__ import annotations

import hashlib
import itertools
from collections.abc import Sequence
from typing import Literal, NamedTuple, TypeVar

Layout = Literal["abba", "pairs", "period"]

_Item = TypeVar("_Item")


class Slot(NamedTuple):
    """A trial's place in a session; blocks, trials in a row of one object and condition, count from 1."""

    block: int
    object: str
    condition: str


def shuffled(items: Sequence[_Item], *, seed: int, purpose: str) -> list[_Item]:
    """Put items into an order that depends on the seed and the purpose alone."""

    def key(place: int) -> str:
        return hashlib.sha256(f"tega-order|{seed}|{purpose}|{place}".encode()).hexdigest()

    return [items[place] for place in sorted(range(len(items)), key=key)]


def williams(n: int) -> list[tuple[int, ...]]:
    """Return a Williams design: each of ``n`` conditions as often at each place, and as often behind each other one.

    Williams, Aust. J. Sci. Res. A 2 (1949) 149. ``n`` sequences where ``n`` is even or 1, else ``2 n``.

    Example:
        >>> williams(3)
        [(0, 1, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0), (0, 2, 1), (1, 0, 2)]
    """
    first = [(step + 1) // 2 if step % 2 else (n - step // 2) % n for step in range(n)]
    rows = [tuple((value + add) % n for value in first) for add in range(n)]
    return rows if n % 2 == 0 or n == 1 else rows + [row[::-1] for row in rows]


def allocate(
    n_people: int, objects: Sequence[str], conditions: Sequence[str], *, seed: int
) -> list[tuple[tuple[str, ...], tuple[str, ...]]]:
    """Give every person an order of objects and an order of conditions.

    A group of people shares an order of objects and has each order of conditions once; groups go through all
    orders of objects before one comes again. So conditions are balanced after every group, and everything
    after every round of groups. More than three objects are in a Williams design, conditions always.
    """
    n = len(objects)
    rows = list(itertools.permutations(range(n))) if n <= 3 else williams(n)
    orders = williams(len(conditions))
    found: list[tuple[tuple[str, ...], tuple[str, ...]]] = []
    for group in range(-(-n_people // len(orders))):
        around = shuffled(rows, seed=seed, purpose=f"objects {group // len(rows)}")
        row = around[group % len(rows)]
        found += [
            (tuple(objects[i] for i in row), tuple(conditions[i] for i in order))
            for order in shuffled(orders, seed=seed, purpose=f"conditions {group}")
        ]
    return found[:n_people]


def lay_out(
    objects: Sequence[str], conditions: Sequence[str], *, trials: int, layout: Layout, seed: int, person: str
) -> list[Slot]:
    """Return a person's trials in their order; ``trials`` are per object and condition.

    ``period``: one condition for all objects, then the next; learning and condition cannot be separated within
    a person. ``abba``: per object the conditions there and back, which cancels linear growth. ``pairs``: per
    object rounds of one trial per condition, in orders that depend on ``person``.
    """
    runs: list[tuple[str, str, int]] = []
    if layout == "period":
        runs = [(name, condition, trials) for condition in conditions for name in objects]
    for name in objects if layout == "abba" else ():
        there = -(-trials // 2)
        runs += [(name, condition, there) for condition in conditions]
        runs += [(name, condition, trials - there) for condition in reversed(conditions)]
    for name in objects if layout == "pairs" else ():
        for turn in range(trials):
            order = shuffled(conditions, seed=seed, purpose=f"{person} {name} {turn}")
            runs += [(name, condition, 1) for condition in order]
    slots: list[Slot] = []
    block, before = 0, ("", "")
    for name, condition, n in runs:
        for _ in range(n):
            block += (name, condition) != before
            before = (name, condition)
            slots.append(Slot(block, name, condition))
    return slots
