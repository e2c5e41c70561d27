"""Every instruction set gives the same bits, and so does a processor that has none of the newer ones."""

import os
import shutil
import sys
from pathlib import Path

import pytest

from reference.installed import program

ANSWERS = Path(__file__).parents[1] / "reference" / "answers.py"


def answers(*command: str, simd: str = "") -> tuple[str, str]:
    env = os.environ | ({"TEGA_SIMD": simd} if simd else {})
    done = program(*command, sys.executable, ANSWERS, env=env)
    used, digest = done.stdout.split()
    return used, digest


@pytest.fixture(scope="module")
def newest() -> str:
    return answers()[1]


@pytest.mark.parametrize("simd", ["baseline", "avx2"])
def test_a_lower_instruction_set_gives_the_same_bits(simd, newest):
    used, digest = answers(simd=simd)
    assert used in ({"baseline"} if simd == "baseline" else {"avx2", "baseline", "neon"})
    assert digest == newest


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("qemu-x86_64") is None, reason="needs qemu-x86_64 (Debian: qemu-user)")
def test_a_processor_without_avx_gives_the_same_bits(newest):
    # NumPy's OpenBLAS takes an emulated processor for one that it is not, and dies when it is imported.
    used, digest = answers("env", "OPENBLAS_CORETYPE=Nehalem", "qemu-x86_64", "-cpu", "Nehalem")
    assert used == "baseline"
    assert digest == newest
