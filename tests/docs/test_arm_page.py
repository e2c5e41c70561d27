"""The arm's pages: the tests it names exist, its example runs, its defaults are the settings'."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tega.arm import FRAMES, ArmSettings
from tega_figures.arm_path import CASES

PROJECT = Path(__file__).resolve().parents[2]
PAGE = PROJECT / "docs" / "arm.md"
PROOFS = PROJECT / "docs" / "evidence" / "arm.md"

pytestmark = pytest.mark.skipif(not PAGE.is_file(), reason="not a checkout")


def test_every_test_that_its_evidence_names_exists() -> None:
    written = "".join(
        (PROJECT / "tests" / name).read_text(encoding="utf-8")
        for name in (
            "tega/property/test_arm.py",
            "tega/unit/test_arm.py",
            "tega/unit/test_arm_robot.py",
            "tools/test_arm_recording.py",
            "tega/unit/test_arm_run.py",
            "tega/unit/test_franky.py",
        )
    )
    named = re.findall(r"`(test_\w+)`", PROOFS.read_text(encoding="utf-8"))
    assert len(named) >= 10
    for name in named:
        assert f"def {name}(" in written, name


def test_its_example_runs() -> None:
    (code,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    names: dict[str, object] = {}
    exec(compile(code, "arm.md", "exec"), names)
    assert getattr(names["command"], "state", "") == "idle"


def test_its_numbers_are_the_defaults() -> None:
    text, s = PROOFS.read_text(encoding="utf-8"), ArmSettings()
    low, high = s.limits.low_m, s.limits.high_m
    for message in (
        f"x {low[0]:.2f} to {high[0]:.2f}, y ±{high[1]:.2f}, z {low[2]:.2f} to {high[2]:.2f} m; "
        f"{s.limits.tilt_rad} rad",
        f"{s.limits.ahead_m} m, {s.limits.ahead_rad} rad",
        f"{s.limits.speed_m_s} m/s, {s.limits.acceleration_m_s2:g} m/s²; {s.limits.turn_rad_s} rad/s, "
        f"{s.limits.turn_acceleration_rad_s2:g} rad/s²",
        f"{s.filter.cutoff_hz} Hz and {s.filter.beta_per_m:g} Hz per m/s; {s.filter.turn_cutoff_hz} Hz and "
        f"{s.filter.turn_beta_per_rad:g} Hz per rad/s; speeds {s.filter.speed_cutoff_hz:g} Hz",
        f"{s.gate.age_ms:g} ms; {s.gate.ahead_ms:g} ms ahead; {s.gate.step_m:.2f} m or {s.gate.step_rad} rad a step; "
        f"{s.gate.speed_m_s:g} m/s, {s.gate.turn_rad_s:g} rad/s",
    ):
        assert message in text, message
    for name in FRAMES:
        assert f"| `{name}` |" in PAGE.read_text(encoding="utf-8")
    for case in CASES:
        assert f"| {case.name} |" in PROOFS.read_text(encoding="utf-8")
