"""A laboratory's settings and the calibration of a person, as tests call it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from reference.wizard import Wizard
from tega.ui.cli.main import main


def lab(path: Path, *parts: str) -> Path:
    file = path / "lab.toml"
    file.write_text("\n".join(parts))
    return file


def teleop(*words: str) -> int:
    with pytest.raises(SystemExit) as done:
        main(list(words))
    code: int = done.value.code  # type: ignore[assignment]
    return code


def calibrate(file: Path, answer: Any, *more: str) -> Wizard:
    how = "--person", "p01", "--json", "--time-scale", "0.2", "--pause-s", "0"
    wizard = Wizard(["calibrate", str(file), *how, *more], answer)
    wizard.run()
    return wizard
