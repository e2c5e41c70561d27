"""Import the packages of the extra ``study`` when first needed: SciPy's statistics take two seconds."""

from __future__ import annotations

from typing import Any

from tega.runtime.lifecycle import require


def scipy_stats() -> Any:
    """Return ``scipy.stats``.

    Raises:
        MissingExtraError: SciPy is not installed.
    """
    return require("scipy.stats", driver="statistics", extra="study")


def statsmodels(name: str) -> Any:
    """Return a module of statsmodels.

    Raises:
        MissingExtraError: statsmodels is not installed.
    """
    return require(f"statsmodels.{name}", driver="statistics", extra="study")
