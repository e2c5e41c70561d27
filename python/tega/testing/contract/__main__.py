"""Runs the driver contract from a shell."""

from __future__ import annotations

import sys

from tega.testing.contract.command import main

if __name__ == "__main__":
    sys.exit(main())
