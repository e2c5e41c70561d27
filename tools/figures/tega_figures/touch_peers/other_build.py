"""Build another version of the extension beside this one, and read pictures with it in a child process.

A version is a commit, or this tree with some of its text replaced. It is built once into ``target/peers`` and loaded
from there: two versions of one extension do not fit into one process.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import IO, Any, Final

PROJECT: Final = Path(__file__).resolve().parents[4]
PLACE: Final = PROJECT / "target" / "peers"
TRACKER: Final = "crates/tega-tactile/src/live/tracker.rs"


def last_commit_before_the_tracker() -> str:
    """Return the commit whose ``live`` was fitted to one ball on one sensor, with a gate in fixed counts."""
    command = ["git", "-C", str(PROJECT), "log", "--diff-filter=A", "--format=%H", "HEAD", "--", TRACKER]
    added = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()[-1]
    return f"{added}^"


def _files(commit: str) -> list[str]:
    command = ["git", "-C", str(PROJECT), "ls-tree", "-r", "--name-only", commit]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()


def built(
    name: str, *, commit: str | None = None, replace: Mapping[str, tuple[str, str]] | None = None
) -> Path:
    """Return the folder that a version is installed in; it is built where it is not there yet.

    Args:
        name: Of the folder.
        commit: The version; ``None`` is the working tree.
        replace: Of the working tree: for each file, a text that stands in it once and what stands there instead.

    Raises:
        ValueError: A text that is to be replaced does not stand there once.
        CalledProcessError: It cannot be built.
    """
    site, tree = PLACE / name / "site", PLACE / name / "tree"
    changed: dict[str, bytes] = {}
    for file in _files(commit or "HEAD"):
        if commit is not None and file.startswith(
            ("crates/", "python/", "Cargo", "pyproject", "README", "LICENSE")
        ):
            shown = ["git", "-C", str(PROJECT), "show", f"{commit}:{file}"]
            changed[file] = subprocess.run(shown, check=True, capture_output=True).stdout
        elif commit is None and file.startswith(
            ("crates/", "python/", "Cargo", "pyproject", "README", "LICENSE")
        ):
            changed[file] = (PROJECT / file).read_bytes()
    for file, (what, instead) in (replace or {}).items():
        text = changed[file].decode()
        if text.count(what) != 1:
            raise ValueError(f"{file}: {what!r} stands there {text.count(what)} times, wanted once")
        changed[file] = text.replace(what, instead).encode()
    fresh = site.is_dir()
    for file, content in changed.items():
        path = tree / file
        if not path.is_file() or path.read_bytes() != content:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
            fresh = False
    if fresh:
        return site
    print(f"building {name}", file=sys.stderr)
    env = os.environ | {"CARGO_TARGET_DIR": str(PLACE / "target")}
    wheels = PLACE / name / "wheels"
    for wheel in wheels.glob("*.whl"):
        wheel.unlink()
    maturin = ["maturin", "build", "--release", "--quiet", "--interpreter", sys.executable]
    subprocess.run([*maturin, "--out", str(wheels)], cwd=tree, env=env, check=True, stdout=sys.stderr)
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--upgrade", "--target", str(site)]
    subprocess.run([*pip, *map(str, wheels.glob("*.whl"))], check=True, stdout=sys.stderr)
    return site


class Child:
    """Calls a function of a version that :func:`built` made, in a process of its own.

    Args:
        site: Where it is installed.
        made: Name of the function of this module that makes what is called, by its arguments.
    """

    def __init__(self, site: Path, made: str) -> None:
        env = os.environ | {"PYTHONPATH": str(site)}
        command = [sys.executable, str(Path(__file__).resolve()), made]
        self._child = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=env)

    def __call__(self, *arguments: Any) -> Any:
        """Return what the function made says of its arguments.

        Raises:
            RuntimeError: The child ended.
        """
        assert self._child.stdin is not None
        assert self._child.stdout is not None
        try:
            pickle.dump(arguments, self._child.stdin, protocol=5)
            self._child.stdin.flush()
            return pickle.load(self._child.stdout)  # of our own child
        except (EOFError, BrokenPipeError) as error:
            raise RuntimeError(f"the other version ended with code {self._child.wait()}") from error

    def close(self) -> None:
        """End the process."""
        for stream in (self._child.stdin, self._child.stdout):
            if stream is not None:
                stream.close()
        self._child.wait()


def _old_reading() -> Callable[..., Any]:
    from tega.tactile import contact_mask, read_contact

    def read(frame: Any, baseline: Any) -> Any:
        metrics = read_contact(frame, baseline)
        mask = contact_mask(frame, baseline)
        return bool(metrics.in_contact), int(metrics.eda), float(metrics.peak), mask

    return read


def _measured() -> Callable[..., Any]:
    from tega_figures.touch_peers.pareto import measured

    return measured


def _serve(made: Callable[..., Any], said: IO[bytes]) -> None:
    while True:
        try:
            arguments = pickle.load(sys.stdin.buffer)  # of our own parent
        except EOFError:
            return
        pickle.dump(made(*arguments), said, protocol=5)
        said.flush()


if __name__ == "__main__":
    # The folder of this file is first on the path and has nothing that another version imports; its package is needed.
    sys.path[0] = str(PROJECT / "tools" / "figures")
    sys.path.append(sys.path.pop(0))
    _serve({"old-reading": _old_reading, "measured": _measured}[sys.argv[1]](), sys.stdout.buffer)
