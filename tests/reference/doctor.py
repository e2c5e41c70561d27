"""What the doctor says of the devices of a settings file."""

from __future__ import annotations

from pathlib import Path

from tega.config import load_config
from tega.setup.doctor import Examination, Finding, examine


def reported(tmp_path: Path, settings: str) -> Examination:
    path = tmp_path / "lab.toml"
    path.write_text(settings)
    examination = examine(load_config(path, environ={}).config, name=path.name)
    # The calibration, and settings without input, have tests of their own; here it is about devices.
    devices = tuple(f for f in examination.findings if f.check not in {"calibration", "settings"})
    return Examination(settings=examination.settings, findings=devices)


def only(examination: Examination) -> Finding:
    (finding,) = examination.findings
    return finding
