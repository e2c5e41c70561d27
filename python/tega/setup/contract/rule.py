"""Break off a check where a rule of the contract does not hold, and say the rule."""

from __future__ import annotations

from collections.abc import Callable


def rule(holds: bool, text: str) -> None:  # noqa: FBT001  # an assertion that survives python -O
    """Break off where a rule does not hold; the message of the ``AssertionError`` is the rule."""
    if not holds:
        raise AssertionError(text)


def refuses(call: Callable[[], object], error: type[Exception], text: str) -> None:
    """Break off where a call does not raise this error; the message of the ``AssertionError`` is the rule."""
    try:
        call()
    except error:
        return
    raise AssertionError(text)
