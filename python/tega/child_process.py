"""How a program that TEGA has started is ended: by its input's end, and by force only when it stays."""

from __future__ import annotations

import contextlib
import subprocess

__all__ = ["end_child"]


def end_child(child: subprocess.Popen[bytes] | subprocess.Popen[str], patience_s: float) -> int:
    """Close a program's input, wait for it to end, and kill it if it does not.

    Args:
        child: The program; one that has ended already is only asked for its code.
        patience_s: How long it may take, seconds.

    Returns:
        Its exit code, negative for the signal that ended it.
    """
    if child.stdin is not None:
        with contextlib.suppress(OSError):  # it has ended, and words for it are left over
            child.stdin.close()
    try:
        return child.wait(patience_s)
    except subprocess.TimeoutExpired:
        child.kill()
        return child.wait()
