"""A full disk ends the tables of a run, not the run: a person is steering a hand."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ParamSpec

__all__ = ["Disk", "Spared"]

_Arguments = ParamSpec("_Arguments")


class Disk:
    """Whether what the run writes still gets to the disk.

    Attributes:
        problem: Why not, from the first failure on; ``""`` before.
    """

    def __init__(self) -> None:
        self.problem = ""

    def spare(self, write: Callable[_Arguments, object]) -> Callable[_Arguments, None]:
        """Return a function that writes until the disk does not take it, and from then on does nothing."""
        failed = False

        def written(*arguments: _Arguments.args, **named: _Arguments.kwargs) -> None:
            nonlocal failed
            if failed:
                return
            try:
                write(*arguments, **named)
            except OSError as error:
                failed = True
                if not self.problem:
                    self.problem = f"disk: tables are no longer written: {error.strerror or error}"

        return written


class Spared:
    """A table among a run's sinks that gives up by itself.

    Args:
        table: A recorder of vest or CAN frames, or of contacts and levels.
        disk: Told of the failure.
    """

    def __init__(self, table: Any, disk: Disk) -> None:
        self.info = getattr(table, "info", None)
        for name in ("write", "contact", "levels", "close"):
            if (method := getattr(table, name, None)) is not None:
                setattr(self, name, disk.spare(method))
