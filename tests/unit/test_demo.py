"""The demo: made-up input through the real loop, its screen and its picture."""

from __future__ import annotations
