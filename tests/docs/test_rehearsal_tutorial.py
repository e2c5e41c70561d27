"""The tutorial that takes longest runs as it stands; the others do in test_docs.py, by another worker."""

from __future__ import annotations

from pathlib import Path

import pytest

from reference.tutorials import REHEARSAL, run_tutorial


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.skipif(not REHEARSAL.is_file(), reason="not a checkout")
def test_the_tutorial_of_a_rehearsal_runs_as_written(tmp_path: Path) -> None:
    run_tutorial(REHEARSAL, tmp_path)
