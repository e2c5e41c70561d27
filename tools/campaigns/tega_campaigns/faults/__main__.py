"""Tries every driver with every fault and writes the page."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import msgspec

from tega_campaigns.faults.page import page
from tega_campaigns.faults.trials import DriverOutcome, FaultTrial, all_trials
from tega_campaigns.peace import in_peace

__all__ = ["main"]


def main() -> int:
    """Run the trials that are asked for; return 0."""
    parser = argparse.ArgumentParser(
        prog="python -m tega_campaigns.faults",
        description="Try every driver with every fault, on its emulator.",
    )
    parser.add_argument("--only", action="append", default=[], metavar="DRIVER", help="repeatable")
    parser.add_argument("--fault", action="append", default=[], metavar="FAULT", help="repeatable")
    parser.add_argument(
        "--markdown", type=Path, metavar="FILE", help="write the page there; needs all of them"
    )
    parser.add_argument("--json", action="store_true", help="print one object a trial")
    given = parser.parse_args()
    if given.markdown is not None and (given.only or given.fault):
        parser.error("--markdown writes the whole page: it goes without --only and --fault")
    trials, cannot = all_trials()
    done: list[tuple[FaultTrial, DriverOutcome]] = []
    for trial in trials:
        if given.only and trial.driver.split(" ")[0] not in given.only:
            continue
        if given.fault and trial.fault not in given.fault:
            continue
        outcome = in_peace(trial.run)
        done.append((trial, outcome))
        told = {
            "driver": trial.driver,
            "fault": trial.fault,
            "what": trial.what,
            **msgspec.structs.asdict(outcome),
        }
        if given.json:
            sys.stdout.write(msgspec.json.encode(told).decode() + "\n")
        else:
            times = ", ".join(
                f"{word} {value:.2f} s"
                for word, value in (("after", outcome.seen_s), ("back", outcome.back_s))
                if value is not None
            )
            head = f"{trial.driver}, {trial.fault}: {outcome.effect} ({times or 'no times'})"
            sys.stdout.write(f"{head}: {outcome.said}\n")
        sys.stdout.flush()
    if given.markdown is not None:
        given.markdown.write_text(page(done, cannot), encoding="utf-8", newline="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
