"""Convert an ``.mf4`` log to can-utils' format on standard output, in a process of its own.

asammdf, which reads such logs, leaves files open, prints, and may work on a damaged log for minutes.
"""

from __future__ import annotations

import logging
import sys


def main() -> int:
    """Convert the file that the first argument names; return 0, 3 where a package is missing, or 1 with a line."""
    logging.disable(logging.CRITICAL)
    try:
        import can

        with can.MF4Reader(sys.argv[1]) as messages:
            writer = can.CanutilsLogWriter(sys.stdout)
            for message in messages:
                writer.on_message_received(message)
        sys.stdout.flush()
    except (NotImplementedError, ImportError):
        return 3
    except Exception as error:  # of a damaged log the reader raises what it likes
        sys.stderr.write(f"\n{type(error).__name__}: {' '.join(str(error).split())[:200]}\n")
        return 1
    return 0


if __name__ == "__main__":
    code = main()
    sys.stderr.flush()
    import os

    os._exit(code)  # objects that were never whole print when they are forgotten
