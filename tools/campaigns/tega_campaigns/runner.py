"""Run the cases of a campaign one after another, and report each: faults, stations, kills and soak alike.

A case that the machine stood still in is tried again, or reported as such to a campaign that cannot: see
:mod:`tega_campaigns.standstill`. What campaigns write into pages are tables.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

import msgspec

from tega.errors import TegaError
from tega_campaigns.standstill import Standstills

__all__ = ["CampaignCase", "put_table", "report_cases", "run_cases", "table", "until"]

Found = TypeVar("Found")
Reported = TypeVar("Reported", bound=msgspec.Struct)


def until(condition: Callable[[], bool], within_s: float, *, look_s: float = 0.005) -> float | None:
    """Wait until something holds and return how long that took, seconds; ``None`` if it did not come true."""
    start_s = time.monotonic()
    while not condition():
        if time.monotonic() - start_s > within_s:
            return None
        time.sleep(look_s)
    return time.monotonic() - start_s


@dataclass(frozen=True)
class CampaignCase(Generic[Found]):
    """One thing to try; ``about`` is what its report begins with, by name, such as driver and fault."""

    about: Mapping[str, Any]
    run: Callable[[], Found]


def run_cases(
    cases: Iterable[CampaignCase[Found]], still: Standstills, *, attempts: int = 1
) -> Iterator[tuple[Found, int]]:
    """Run cases, each again while the machine stood still in it; yield each result and that standstill, ns.

    The next case is taken when the one before is over. A case is run at most ``attempts`` times; the last
    time counts, whatever the machine did. A :class:`TegaError` of the last attempt, or of one in which the
    machine did not stand still, is passed on.
    """
    for case in cases:
        for left in reversed(range(attempts)):
            since_ns = time.time_ns()
            try:
                found = case.run()
            except TegaError:
                if not left or not still.within_ns(since_ns, time.time_ns()):
                    raise
                continue
            still_ns = still.within_ns(since_ns, time.time_ns())
            if not still_ns or not left:
                yield found, still_ns
                break


def report_cases(
    cases: Sequence[CampaignCase[Reported]], *, as_json: bool, attempts: int = 4
) -> list[Reported]:
    """Run cases and print what came of each, as it comes: an object of JSON a line, or lines for a person."""
    done: list[Reported] = []
    with Standstills() as still:
        for case, (found, _) in zip(cases, run_cases(cases, still, attempts=attempts), strict=True):
            done.append(found)
            reported = {**case.about, **msgspec.structs.asdict(found)}
            if as_json:
                sys.stdout.write(msgspec.json.encode(reported).decode() + "\n")
            else:
                sys.stdout.write("\n  ".join(f"{name}: {value}" for name, value in reported.items()) + "\n")
            sys.stdout.flush()
    return done


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown, ending with a newline."""
    lines = [f"| {' | '.join(head)} |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def put_table(page: Path, text: str, *, name: str) -> None:
    """Put a table between the two marks of a page that bear a name; :class:`ValueError` where it has none."""
    begin, end = (f"<!-- {name}: {where} -->\n" for where in ("begin", "end"))
    head, rest = page.read_text(encoding="utf-8").split(begin)
    _, tail = rest.split(end)
    page.write_text(f"{head}{begin}\n{text}\n{end}{tail}", encoding="utf-8", newline="\n")
