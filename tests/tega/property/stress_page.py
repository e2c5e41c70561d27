"""Write the table of numerical stress from the properties: ``python tests/tega/property/stress_page.py PAGE``.

All of them have to pass, the runs over a hundred million samples too; it takes some minutes.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from tega_campaigns.runner import put_table

HERE = Path(__file__).resolve().parent


def main() -> int:
    (page_file,) = map(Path, sys.argv[1:])
    # The same examples each time, so that the page changes only where a kernel does.
    os.environ["HYPOTHESIS_PROFILE"] = "ci"
    files = [str(file) for file in sorted(HERE.glob("*.py")) if "import Extreme" in file.read_text()]
    if failed := pytest.main(["-n0", "-q", *files]):
        return int(failed)
    from reference.extremes import extremes_table  # as the properties, now run, found it

    put_table(page_file, extremes_table(), name="extremes")
    return 0


if __name__ == "__main__":
    sys.exit(main())
