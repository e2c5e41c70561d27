"""Prepare docstrings for the site: ``Example:`` becomes ``Examples:``, which griffe knows, and roles become code."""

from __future__ import annotations

import re
from typing import Any

import griffe


class Examples(griffe.Extension):
    """Changes every docstring before it is parsed."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        """Change the docstring of a member of the package."""
        _prepare(obj)

    def on_package(self, *, pkg: griffe.Module, **_: Any) -> None:
        """Change the package's own docstring, for which ``on_object`` is not called."""
        _prepare(pkg)


def _prepare(obj: griffe.Object) -> None:
    if obj.docstring is not None:
        text = re.sub(r"^Example:$", "Examples:", obj.docstring.value, flags=re.MULTILINE)
        obj.docstring.value = re.sub(r":\w+:`~?([^`]+)`", r"`\1`", text)
