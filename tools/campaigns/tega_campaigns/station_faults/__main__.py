"""Tries two stations with every fault and prints each outcome."""

from __future__ import annotations

import sys
from functools import partial

from tega.errors import DeviceUnavailableError
from tega_campaigns.lossy_wire import LossyWire
from tega_campaigns.runner import CampaignCase, campaign_parser, report_cases
from tega_campaigns.station_faults.faults import FAULTS, WIRE_FAULTS
from tega_campaigns.station_faults.setups import Setups
from tega_campaigns.station_faults.trials import try_fault

__all__ = ["main"]


def main() -> int:
    """Run the trials that are asked for; return 1 where one did not go as it should."""
    parser = campaign_parser(
        "station_faults",
        "Break the link between two stations, or one of them, and see what hand, arm and vest do. "
        "Faults of the wire need root, and are left out without it.",
        table=False,
    )
    parser.add_argument(
        "--only", action="append", default=[], metavar="WORDS", help="of a fault's name; repeatable"
    )
    given = parser.parse_args()
    faults = [*FAULTS, *WIRE_FAULTS]
    if given.only:
        faults = [fault for fault in faults if any(words in fault.name for words in given.only)]
    if any(fault.wire for fault in faults) and (why := _no_wire()):
        sys.stderr.write(f"faults of the wire are left out: {why}\n")
        faults = [fault for fault in faults if not fault.wire]
    # Faults of one setup after another, so that stations are started as seldom as can be.
    setups = [(fault.wire, fault.keys, fault.net) for fault in faults]
    in_order = sorted(faults, key=lambda fault: setups.index((fault.wire, fault.keys, fault.net)))
    with Setups() as kept:
        cases = [
            CampaignCase({"fault": fault.name, "wish": fault.wish}, partial(try_fault, fault, kept))
            for fault in in_order
        ]
        found = report_cases(cases, as_json=given.json)
    return 0 if all(outcome.as_wished for outcome in found) else 1


def _no_wire() -> str:
    """Return why there can be no wire on this machine, ``""`` if there can."""
    try:
        with LossyWire():
            return ""
    except DeviceUnavailableError as error:
        return error.message


if __name__ == "__main__":
    sys.exit(main())
