"""Import the packages of the extra ``study`` when first needed: SciPy's statistics take two seconds."""

from __future__ import annotations

import importlib
from typing import Any

from tega.errors import MissingExtraError


def scipy_stats() -> Any:
    """Return ``scipy.stats``.

    Raises:
        MissingExtraError: SciPy is not installed.
    """
    return _module("scipy.stats", "SciPy")


def statsmodels(name: str) -> Any:
    """Return a module of statsmodels.

    Raises:
        MissingExtraError: statsmodels is not installed.
    """
    return _module(f"statsmodels.{name}", "statsmodels")


def _module(name: str, package: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise MissingExtraError(f"{package} is not installed", "pip install 'tega[study]'") from error
