"""The suite's own rules: who is asked again, what may be skipped, what a named file runs."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

TESTS = Path(__file__).resolve().parents[2]
FLAKY = """
import pytest

asked = []

@pytest.mark.asked_again("a device that is made up")
@pytest.mark.parametrize("n", range({n}))
def test_passes_when_it_is_asked_again(n):
    asked.append(n)
    assert asked.count(n) == 2
"""


@pytest.fixture
def suite(tmp_path: Path) -> Path:
    """Return a folder with this suite's settings and hooks, and no tests."""
    settings = TESTS.parent / "pyproject.toml"
    if not settings.is_file():
        pytest.skip("no pyproject.toml beside the tests: not a checkout")
    shutil.copy(settings, tmp_path)
    (tmp_path / "tests").mkdir()
    shutil.copy(TESTS / "conftest.py", tmp_path / "tests")
    return tmp_path


def run(suite: Path, code: str, *words: str, ci: str = "") -> tuple[int, str]:
    (suite / "tests" / "test_made_up.py").write_text(code)
    env = os.environ | {"CI": ci, "PYTHONPATH": str(TESTS)}
    command = [sys.executable, "-m", "pytest", "-n0", "-p", "no:cacheprovider", *words]
    done = subprocess.run(command, cwd=suite, env=env, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr


@pytest.mark.parametrize(
    ("n", "ci", "code", "message"),
    [
        (3, "", pytest.ExitCode.OK, "3 passed, 3 rerun"),
        (3, "true", pytest.ExitCode.TESTS_FAILED, "3 tests were asked again, and at most 2 may be in CI"),
        (21, "", pytest.ExitCode.USAGE_ERROR, "21 tests are asked again, and at most 20 may be"),
    ],
)
def test_few_tests_are_asked_again_and_fewer_in_ci(
    suite: Path, n: int, ci: str, code: pytest.ExitCode, message: str
) -> None:
    ended, printed = run(suite, FLAKY.format(n=n), ci=ci)
    assert message in printed
    assert ended == code


def test_who_is_asked_again_says_why(suite: Path) -> None:
    ended, printed = run(suite, "import pytest\n\n@pytest.mark.asked_again\ndef test_it(): pass\n")
    assert "asked_again takes one argument, the reason" in printed
    assert ended == pytest.ExitCode.USAGE_ERROR


@pytest.mark.parametrize(
    "code",
    [
        "import pytest\n\ndef test_it(): pytest.skip('no device')\n",
        "import pytest\n\npytest.importorskip('no_such_package', reason='no device')\ndef test_it(): pass\n",
    ],
)
def test_where_nothing_may_be_skipped_a_skip_fails(suite: Path, code: str) -> None:
    ended, printed = run(suite, code, "--no-skip")
    assert "no device" in printed
    assert ended in {pytest.ExitCode.TESTS_FAILED, pytest.ExitCode.INTERRUPTED}


def test_a_folder_leaves_out_what_is_slow_and_a_named_file_does_not(suite: Path) -> None:
    code = "import pytest\n\n@pytest.mark.slow\ndef test_it(): pass\n"
    assert "1 deselected" in run(suite, code)[1]
    assert "1 passed" in run(suite, code, "tests/test_made_up.py")[1]
