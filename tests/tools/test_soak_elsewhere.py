"""The soak on a system without Linux's means: a sentence, not an import that fails."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from tega.errors import DeviceUnavailableError
from tega_campaigns.soak import trial


def test_soak_is_imported_where_there_is_no_resource_module() -> None:
    modules = "tega_campaigns.supervisor, tega_campaigns.soak.command"
    code = f"import sys; sys.modules['resource'] = None; import {modules}"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_soak_says_that_it_needs_linux(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(trial, "sys", SimpleNamespace(platform="win32"))
    with pytest.raises(DeviceUnavailableError, match="soak: needs Linux"):
        trial.soak(tmp_path, seconds=10.0, seed=1)
