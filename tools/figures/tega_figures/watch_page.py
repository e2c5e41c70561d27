"""Show a run's page in a Chromium without a window until the input ends: a viewer beside a bench."""

from __future__ import annotations

import sys

from tega_figures.chromium import launched, opened


def main() -> None:
    """Show the page whose address is given, and say when it is there."""
    with launched() as browser, opened(browser, sys.argv[1]):
        print("shown", flush=True)
        sys.stdin.read()


if __name__ == "__main__":
    main()
