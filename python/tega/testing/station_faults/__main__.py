"""Tries two stations with every fault and writes the table."""

from __future__ import annotations

import argparse
import sys
from functools import partial
from pathlib import Path

import msgspec

from tega.testing.peace import in_peace
from tega.testing.station_faults.page import put_table
from tega.testing.station_faults.trials import FAULTS, WIRE_FAULTS, Fault, Outcome, try_fault

__all__ = ["main"]


def main() -> int:
    """Run the trials that are asked for; return 1 where one did not go as it should."""
    parser = argparse.ArgumentParser(
        prog="python -m tega.testing.station_faults",
        description="Break the link between two stations, or one of them, and see what hand, arm and vest do.",
    )
    parser.add_argument(
        "--only", action="append", default=[], metavar="WORDS", help="of a fault's name; repeatable"
    )
    parser.add_argument(
        "--markdown", type=Path, metavar="FILE", help="put the table into this page; needs all of them"
    )
    parser.add_argument(
        "--wire", action="store_true", help="lose and reorder packets, between network namespaces; needs root"
    )
    parser.add_argument("--json", action="store_true", help="print one object a trial")
    given = parser.parse_args()
    if given.markdown is not None and given.only:
        parser.error("--markdown writes the whole table: it goes without --only")
    done: list[tuple[Fault, Outcome]] = []
    for fault in WIRE_FAULTS if given.wire else FAULTS:
        if given.only and not any(words in fault.name for words in given.only):
            continue
        outcome = in_peace(partial(try_fault, fault))
        done.append((fault, outcome))
        told = {"fault": fault.name, "wish": fault.wish, **msgspec.structs.asdict(outcome)}
        if given.json:
            sys.stdout.write(msgspec.json.encode(told).decode() + "\n")
        else:
            sys.stdout.write(
                "\n  ".join([fault.name, *(f"{key}: {value}" for key, value in told.items())]) + "\n"
            )
        sys.stdout.flush()
    if given.markdown is not None:
        put_table(given.markdown, done, name="faults of the wire" if given.wire else "faults of the stations")
    return 0 if all(outcome.as_wished for _, outcome in done) else 1


if __name__ == "__main__":
    sys.exit(main())
