"""Import the packages of the extra ``study`` when first needed: SciPy's statistics take two seconds."""

from __future__ import annotations

from typing import Any

from tega.runtime.lifecycle import require


def scipy_stats() -> Any:
    """Return ``scipy.stats``, or raise ``MissingExtraError``."""
    return require("scipy.stats", driver="statistics", extra="study")


def statsmodels(name: str) -> Any:
    """Return a module of statsmodels, or raise ``MissingExtraError``."""
    return require(f"statsmodels.{name}", driver="statistics", extra="study")
