"""Tries every driver with every fault and writes the table of the docs."""

from __future__ import annotations

import sys

from tega_campaigns.faults.page import glance
from tega_campaigns.faults.trials import all_trials
from tega_campaigns.report import put_table
from tega_campaigns.runner import CampaignCase, campaign_parser, report_cases

__all__ = ["main"]


def main() -> int:
    """Run the trials that are asked for; return 0."""
    parser = campaign_parser("faults", "Try every driver with every fault, on its emulator.")
    parser.add_argument("--only", action="append", default=[], metavar="DRIVER", help="repeatable")
    parser.add_argument("--fault", action="append", default=[], metavar="FAULT", help="repeatable")
    given = parser.parse_args()
    if given.markdown is not None and (given.only or given.fault):
        parser.error("--markdown writes the whole table: it goes without --only and --fault")
    trials, _ = all_trials()
    chosen = [
        trial
        for trial in trials
        if (not given.only or trial.driver.split(" ")[0] in given.only)
        and (not given.fault or trial.fault in given.fault)
    ]
    cases = [CampaignCase({"driver": t.driver, "fault": t.fault, "what": t.what}, t.run) for t in chosen]
    done = report_cases(cases, as_json=given.json)
    if given.markdown is not None:
        put_table(given.markdown, glance(list(zip(chosen, done, strict=True))), name="drivers")
    return 0


if __name__ == "__main__":
    sys.exit(main())
