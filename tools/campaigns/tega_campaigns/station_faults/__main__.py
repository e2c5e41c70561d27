"""Tries two stations with every fault and writes the tables."""

from __future__ import annotations

import argparse
import sys
from functools import partial
from pathlib import Path

import msgspec

from tega.errors import DeviceUnavailableError
from tega_campaigns.lossy_wire import LossyWire
from tega_campaigns.peace import in_peace
from tega_campaigns.station_faults.faults import FAULTS, WIRE_FAULTS
from tega_campaigns.station_faults.page import put_table
from tega_campaigns.station_faults.setups import Setups
from tega_campaigns.station_faults.trials import StationFault, StationOutcome, try_fault

__all__ = ["main"]


def main() -> int:
    """Run the trials that are asked for; return 1 where one did not go as it should."""
    parser = argparse.ArgumentParser(
        prog="python -m tega_campaigns.station_faults",
        description="Break the link between two stations, or one of them, and see what hand, arm and vest do. "
        "Faults of the wire need root, and are left out without it.",
    )
    parser.add_argument(
        "--only", action="append", default=[], metavar="WORDS", help="of a fault's name; repeatable"
    )
    parser.add_argument(
        "--markdown", type=Path, metavar="FILE", help="put the tables into this page; needs all of them"
    )
    parser.add_argument("--json", action="store_true", help="print one object a trial")
    given = parser.parse_args()
    if given.markdown is not None and given.only:
        parser.error("--markdown writes whole tables: it goes without --only")
    faults = [*FAULTS, *WIRE_FAULTS]
    if given.only:
        faults = [fault for fault in faults if any(words in fault.name for words in given.only)]
    if any(fault.wire for fault in faults) and (why := _no_wire()):
        sys.stderr.write(f"faults of the wire are left out, and so is their table: {why}\n")
        faults = [fault for fault in faults if not fault.wire]
    done = _try_all(faults, as_json=given.json)
    if given.markdown is not None:
        for wire, name in ((False, "faults of the stations"), (True, "faults of the wire")):
            if rows := [(fault, done[fault.name]) for fault in faults if fault.wire == wire]:
                put_table(given.markdown, rows, name=name)
    return 0 if all(outcome.as_wished for outcome in done.values()) else 1


def _no_wire() -> str:
    """Return why there can be no wire on this machine, ``""`` if there can."""
    try:
        with LossyWire():
            return ""
    except DeviceUnavailableError as error:
        return error.message


def _try_all(faults: list[StationFault], *, as_json: bool) -> dict[str, StationOutcome]:
    """Try faults of one setup after another, so that stations are started as seldom as can be."""
    done: dict[str, StationOutcome] = {}
    setups = [(fault.wire, fault.keys, fault.net) for fault in faults]
    in_order = sorted(faults, key=lambda fault: setups.index((fault.wire, fault.keys, fault.net)))
    with Setups() as kept:
        for fault in in_order:
            done[fault.name] = outcome = in_peace(partial(try_fault, fault, kept))
            _print(fault, outcome, as_json=as_json)
    return done


def _print(fault: StationFault, outcome: StationOutcome, *, as_json: bool) -> None:
    told = {"fault": fault.name, "wish": fault.wish, **msgspec.structs.asdict(outcome)}
    if as_json:
        sys.stdout.write(msgspec.json.encode(told).decode() + "\n")
    else:
        sys.stdout.write(
            "\n  ".join([fault.name, *(f"{key}: {value}" for key, value in told.items())]) + "\n"
        )
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
