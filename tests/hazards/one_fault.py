"""A soak of one fault alone: ``python tests/hazards/one_fault.py HOW DEVICE``; exit code 1 unless it passes."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from tega_campaigns.soak.plan import KINDS
from tega_campaigns.soak.trial import soak

_SECONDS = 12.0


def main() -> int:
    """Make the fault that the command line names, and say what came of it."""
    _, how, device = sys.argv
    kinds = [kind for kind in KINDS if (kind.how, kind.device) == (how, device)]
    with tempfile.TemporaryDirectory(prefix="tega-fault-") as name:
        report = soak(Path(name), seconds=_SECONDS, seed=1, kinds=kinds, patient=True)
    for failure in report.failures:
        print(f"failed: {failure}")  # noqa: T201  # this is a program
    return 0 if report.passed else 1


if __name__ == "__main__":
    sys.exit(main())
