"""One program at a time makes a person's vest vibrate: two would each count a day of their own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from reference.vests import KeptVest
from tega.config import VestConfig, load_config
from tega.devices.base import BudgetedVest
from tega.devices.vest.vest_stream import VestOptions
from tega.errors import DeviceUnavailableError
from tega.loop.worn_vest import NAMELESS, dose_file, worn_vest
from tega.runtime.files.toml_text import tree_text
from tega_emulators.lab import emulated_lab


@pytest.fixture(autouse=True)
def _nowhere(monkeypatch: pytest.MonkeyPatch) -> None:
    assert isinstance(KeptVest(VestOptions()), BudgetedVest)
    monkeypatch.setattr(
        "tega.loop.worn_vest.driver_class", lambda _name, _kind: lambda _o: KeptVest(VestOptions())
    )


def _files(folder: Path) -> tuple[Path, Path, Path]:
    people = [folder / "people" / person / "vest-dose.json" for person in ("p01", "p02")]
    return people[0], people[1], folder / NAMELESS


@pytest.mark.parametrize(
    ("first", "second", "refused"),
    [(0, 0, True), (0, 1, False), (0, 2, True), (2, 0, True), (2, 2, True), (1, 0, False)],
)
def test_a_wearer_is_one_program_s(first: int, second: int, refused: bool, tmp_path: Path) -> None:
    """Persons p01 and p02, and one without a name, who may be either."""
    files = _files(tmp_path)
    for file in files[:2]:
        with worn_vest(VestConfig(driver="wire-vest"), file):
            pass
    with worn_vest(VestConfig(driver="wire-vest"), files[first]):
        if not refused:
            with worn_vest(VestConfig(driver="wire-vest"), files[second]):
                return
        with (
            pytest.raises(DeviceUnavailableError, match="is in use by another program"),
            worn_vest(VestConfig(driver="wire-vest"), files[second]),
        ):
            pass
    with worn_vest(VestConfig(driver="wire-vest"), files[second]):
        pass  # free again


@pytest.mark.slow
@pytest.mark.parametrize("verb", [("vest", "identify"), ("run",)])
def test_a_vest_that_is_worn_in_a_run_is_refused_to_other_programs(
    verb: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.undo()  # a real driver before an emulated vest
    with emulated_lab(tmp_path, vest=True, fingers=("thumb",)) as lab:
        config = tmp_path / "lab.toml"
        config.write_text(tree_text(lab.tree), encoding="utf-8")
        loaded = load_config(config).config
        with worn_vest(loaded.vest, dose_file(loaded.calibration)):
            words = [sys.executable, "-m", "tega.ui.cli", *verb, str(config)]
            done = subprocess.run(
                words,
                capture_output=True,
                text=True,
                timeout=120,
                check=False,
                env={**os.environ, **lab.environment},
            )
    assert done.returncode == 3, done.stderr
    assert "is in use by another program" in done.stderr
