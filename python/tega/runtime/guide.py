"""Declare the screens and questions that a calibration's steps need from the terminal or the page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol


class Bar(NamedTuple):
    """Bar from ``low`` to ``share``, each 0 to 1, while a step goes on; ``low`` is 0 but for a target with two ends."""

    name: str
    share: float
    text: str = ""
    low: float = 0.0


class Undecided(Exception):  # noqa: N818  # no error: nobody is there to answer
    """Raised if a question was asked and cannot be answered, since there is no operator."""


class Shows(Protocol):
    """Shows the progress."""

    def show(self, prompt: str, bars: Sequence[Bar], left_s: float | None, /) -> None:
        """Show the current state; called again and again, and returns at once."""


class Guide(Shows, Protocol):
    """Shows a person instructions and receives their answers."""

    def part(self, title: str, why: str) -> None:
        """Begin a part, with its title and reason."""

    def say(self, text: str, *, tone: str = "plain") -> None:
        """Show a message; ``tone`` is ``plain``, ``good``, ``warn`` or ``bad``."""

    def ready(self, prompt: str) -> None:
        """Wait until the person is ready."""

    def ask(self, question: str, answers: Mapping[str, str]) -> str:
        """Ask a question; return a key of the answers, or raise ``Undecided`` where there is no operator."""
