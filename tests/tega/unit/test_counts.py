"""Count again: the wiring of the loop, what a stage of one's own takes, the objects that a picture passes."""

from __future__ import annotations

import ast
import inspect
import re
import sys
import threading
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import pytest

import tega
from tega.config import check_tree
from tega.loop import DualLoop, run_session
from tega.records import Picture
from tega.records.bus import Bus
from tega_emulators.lab import PRESSED, emulated_lab

PACKAGE = Path(tega.__file__).parent
EXAMPLES = Path(__file__).resolve().parents[3] / "examples"


def test_the_loop_and_a_run_take_few_parameters() -> None:
    assert len(inspect.signature(DualLoop).parameters) <= 12
    assert len(inspect.signature(run_session).parameters) <= 8


@pytest.mark.skipif(not EXAMPLES.is_dir(), reason="not a checkout")
@pytest.mark.parametrize("example", ["own_metric", "own_decoder", "own_mapping", "own_layout", "own_device"])
def test_a_stage_or_device_of_one_s_own_touches_no_file_of_tega(example: str) -> None:
    files = sorted((EXAMPLES / example / "src").rglob("*.py"))
    assert files
    touching = [file.name for file in PACKAGE.rglob("*.py") if example in file.read_text("utf-8")]
    assert touching == []
    for file in files:
        for node in ast.walk(ast.parse(file.read_text("utf-8"))):
            if isinstance(node, ast.Import | ast.ImportFrom):
                assert not re.search(r"\btega\b.*[. ]_", ast.unparse(node)), (
                    f"{file.name}: {ast.unparse(node)}"
                )


PASSED = {"TactileFrame", "Contact", "MotorLevels", "VestFrame"}


def is_passed(value: Any) -> bool:
    """Whether a value is a picture, a contact, or a frame of the vest."""
    if isinstance(value, np.ndarray):
        return value.ndim == 3 or value.shape == (40,)
    if type(value) is tuple:
        return any(is_passed(one) for one in value)
    return type(value).__name__ in PASSED


class Way:
    """Notes every object with a method that receives or returns one of them, and the threads; a value is no station."""

    def __init__(self) -> None:
        self.objects: dict[str, set[str]] = {}

    def __call__(self, frame: FrameType, event: str, given: Any) -> None:
        code = frame.f_code
        if event not in {"call", "return"} or "/tega/" not in code.co_filename:
            return
        me = frame.f_locals.get("self")
        if me is None or is_passed(me):
            return
        names = code.co_varnames[1 : code.co_argcount + code.co_kwonlyargcount]
        values = [frame.f_locals.get(name) for name in names] if event == "call" else [given]
        if any(map(is_passed, values)):
            self.objects.setdefault(type(me).__name__, set()).add(threading.current_thread().name)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the emulators need Linux")
def test_a_picture_passes_14_objects_and_is_handed_on_twice(tmp_path: Path) -> None:
    route, bus, measured_in = Way(), Bus(), set[str]()
    bus.subscribe(Picture, lambda _picture: measured_in.add(threading.current_thread().name))
    with emulated_lab(tmp_path, fingers=("thumb",), vest=True, touch=PRESSED) as lab:
        config = check_tree({**lab.tree, "session": {"duration_s": 2.0}}, {}, base=tmp_path).config
        threading.setprofile(route)
        sys.setprofile(route)
        try:
            run_session(config, bus=bus)
        finally:
            sys.setprofile(None)
            threading.setprofile(None)
    assert measured_in == {"digit"}
    assert len(route.objects) <= 14, sorted(route.objects)
    # Beyond the camera's, the loop's and the vest's there is none, so there are two places between threads.
    threads = set[str]().union(*route.objects.values())
    assert threads == {"digit", threading.current_thread().name, "bhaptics-player"}
