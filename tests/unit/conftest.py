"""What several tests of recordings look at."""

from __future__ import annotations

from pathlib import Path

import pytest

from reference.sessions import record


@pytest.fixture(scope="session")
def lossless(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a lossless recording of one and a half seconds; nobody writes into its folder."""
    return record(tmp_path_factory.mktemp("session") / "lossless")
