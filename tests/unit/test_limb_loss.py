"""A person's fingers cannot steer: no module that leads to a command knows the type of their tracking."""

from __future__ import annotations

import ast
import importlib.util
import pkgutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import tega
from tega.errors import ShapeError
from tega.teleop.hand import ModelledAllegro
from tega.tracking.fingers import FingerTracking

FINGERS = "tega.tracking.fingers"
# Where commands are made and sent, and where an intent is decided.
CONTROL = (
    "tega.teleop", "tega.devices", "tega.hand", "tega.hand_link", "tega.hand_poses", "tega.emg", "tega.safety",
    "tega.wire", "tega.sim", "tega.config", "tega.cli.run", "tega.arm",
)  # fmt: skip
MODULES = {m.name: m.ispkg for m in pkgutil.walk_packages(tega.__path__, "tega.")}


def imports(name: str) -> set[str]:
    """Return the modules of this package that a module imports anywhere in it, inside functions too."""
    spec = importlib.util.find_spec(name)
    assert spec is not None
    assert spec.origin is not None
    if not spec.origin.endswith(".py"):
        return set()
    found: set[str] = set()
    for node in ast.walk(ast.parse(Path(spec.origin).read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{name}: relative imports would hide from this test"
            found |= {str(node.module), *(f"{node.module}.{alias.name}" for alias in node.names)}
        elif isinstance(node, ast.Constant) and node.value == FINGERS:
            found.add(FINGERS)
    return {module for module in found if module in MODULES}


def reached(start: str) -> set[str]:
    """Return every module of this package that a module can reach."""
    seen, left = set[str](), [start]
    while left:
        name = left.pop()
        if name not in seen:
            seen.add(name)
            left += imports(name)
    return seen


CONTROLLING = [name for name in MODULES if any(name == c or name.startswith(f"{c}.") for c in CONTROL)]


def test_the_walk_finds_imports() -> None:
    assert len(CONTROLLING) > 100
    assert "tega.hand" in reached("tega.teleop.loop")
    assert FINGERS in reached(FINGERS)


@pytest.mark.parametrize("name", CONTROLLING)
def test_nothing_that_leads_to_a_command_knows_a_person_s_fingers(name: str) -> None:
    assert FINGERS not in reached(name)


def test_they_pass_for_nothing_else() -> None:
    fingers = FingerTracking(0, np.zeros((21, 3)))
    for special in ("__float__", "__int__", "__index__", "__iter__", "__len__", "__array__", "__getitem__"):
        assert not hasattr(fingers, special)
    with pytest.raises(TypeError):
        ModelledAllegro().step(fingers)  # type: ignore[arg-type]
    assert fingers.for_recording().shape == (21, 3)
    with pytest.raises(ShapeError):
        FingerTracking(0, np.zeros(3))


def test_the_type_checker_refuses_them(tmp_path: Path) -> None:
    pytest.importorskip("mypy", reason="pip install '.[lint]'")
    wrong = tmp_path / "wrong.py"
    wrong.write_text(
        "from tega.devices.base import SteeredHand\n"
        "from tega.teleop.hand import Hand\n"
        "from tega.tracking.fingers import FingerTracking\n"
        "def steer(hand: Hand, steered: SteeredHand, fingers: FingerTracking) -> None:\n"
        "    hand.step(fingers)\n"
        "    steered.step(fingers)\n"
    )
    words = [sys.executable, "-m", "mypy", "--follow-imports=silent", str(wrong)]
    said = subprocess.run(words, capture_output=True, text=True, check=False, cwd=tmp_path).stdout
    assert said.count('incompatible type "FingerTracking"; expected "int"') == 2, said
