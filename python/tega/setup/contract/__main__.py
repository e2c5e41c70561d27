"""Check drivers and stages against their contracts from a shell."""

from __future__ import annotations

import sys

from tega.setup.contract.command import main

if __name__ == "__main__":
    sys.exit(main())
