"""An emulated OpenXR runtime for the loader to load: ``python -m tega_emulators.openxr_runtime``.

The library is the crate ``tega-openxr-emulator``. It is in no wheel: cargo builds it from the checkout, once. Its poses
are those of :mod:`tega_emulators.openxr`, a process of its own.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Final

from tega.errors import DeviceUnavailableError, TegaError
from tega_emulators.process import Emulator

__all__ = ["build_runtime", "main", "openxr_runtime", "why_no_runtime"]

_CRATE: Final = "tega-openxr-emulator"


def _checkout() -> Path | None:
    """Find the source tree: that of an editable installation, or the one we stand in."""
    here = Path.cwd()
    for root in (Path(__file__).resolve().parents[3], here, *here.parents):
        if (root / "crates" / _CRATE / "Cargo.toml").is_file():
            return root
    return None


def why_no_runtime() -> str:
    """Return why the emulated runtime cannot be built here; ``""`` if it can."""
    if sys.platform == "win32":
        return "its emulator needs Linux or macOS"
    if shutil.which("cargo") is None:
        return f"needs cargo, which builds the emulated OpenXR runtime ({_CRATE})"
    if _checkout() is None:
        return f"needs a checkout: the emulated OpenXR runtime is its crate {_CRATE}"
    return ""


@cache
def build_runtime() -> Path:
    """Build the library, unless that was done, and return where it is."""
    root, reason = _checkout(), why_no_runtime()
    if reason or root is None:
        raise DeviceUnavailableError(f"no emulated OpenXR runtime: it {reason}", "run this in a checkout")
    command = ["cargo", "build", "--locked", "--quiet", "--package", _CRATE, "--message-format=json"]
    done = subprocess.run(command, cwd=root, text=True, capture_output=True, check=False)
    for line in done.stdout.splitlines():
        message = json.loads(line)
        if (
            message.get("reason") == "compiler-artifact"
            and _CRATE.replace("-", "_") in message["target"]["name"]
        ):
            return Path(message["filenames"][0])
    raise DeviceUnavailableError(
        f"no emulated OpenXR runtime: cargo ends with {done.returncode}",
        f"cd {root}; cargo build -p {_CRATE}",
    )


@contextmanager
def openxr_runtime() -> Iterator[Emulator]:
    """Run it while the block lasts; this process and those it starts find it as their OpenXR runtime.

    Yields its service, which takes the commands of :mod:`tega_emulators.openxr`.
    """
    library = build_runtime()
    with tempfile.TemporaryDirectory() as folder, Emulator("openxr") as service:
        manifest = Path(folder) / "tega_openxr_emulator.json"
        runtime = {"name": "TEGA's emulated runtime", "library_path": str(library)}
        manifest.write_text(
            json.dumps({"file_format_version": "1.0.0", "runtime": runtime}), encoding="utf-8"
        )
        new = {
            "XR_RUNTIME_JSON": str(manifest),
            "TEGA_OPENXR_EMULATOR": f"{service.address['host']}:{service.port}",
        }
        before = {name: os.environ.get(name) for name in new}
        os.environ.update(new)
        try:
            yield service
        finally:
            for name, value in before.items():
                if value is None:
                    del os.environ[name]
                else:
                    os.environ[name] = value


def main() -> int:
    """Run it until the standard input closes; what is typed goes to its service."""
    argparse.ArgumentParser(
        description="An emulated OpenXR runtime, until Ctrl-D. Set what it prints in another terminal; type commands"
        " here, such as: wave 0.06 0.1. All of them: python -m pydoc tega_emulators.openxr"
    ).parse_args()
    try:
        with openxr_runtime() as service:
            for name in ("XR_RUNTIME_JSON", "TEGA_OPENXR_EMULATOR"):
                sys.stdout.write(f"export {name}={os.environ[name]}\n")
            sys.stdout.flush()
            for line in sys.stdin:
                try:
                    message = service.say(line.strip()) if line.strip() else {}
                except TegaError as error:
                    message = {"error": str(error)}
                sys.stdout.write(f"{json.dumps(message)}\n" if message else "")
                sys.stdout.flush()
    except KeyboardInterrupt:
        return 0
    except TegaError as error:
        sys.stderr.write(f"{error}\n")
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
