"""Write the page of numerical stress from the properties: ``python tests/tega/property/stress_page.py docs/stress.md``.

All of them have to pass, the runs over a hundred million samples too; it takes some minutes.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent


def main() -> int:
    """Run every property of the extremes and write the page that the command line names."""
    (page_file,) = map(Path, sys.argv[1:])
    # The same examples each time, so that the page changes only where a kernel does.
    os.environ["HYPOTHESIS_PROFILE"] = "ci"
    files = sorted(str(file) for file in HERE.glob("test_extremes_*.py"))
    if failed := pytest.main(["-n0", "-q", *files]):
        return int(failed)
    from reference.extremes import page  # as the properties, now run, found it

    page_file.write_text(page(), encoding="utf-8", newline="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
