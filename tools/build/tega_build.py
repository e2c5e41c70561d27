"""Build TEGA by maturin for pip, and say in one sentence what is missing where Rust is not installed."""

from __future__ import annotations

import shutil

if shutil.which("cargo") is None:
    # This ends pip's call of the build before anything is built; pip shows what is said here, and no traceback.
    raise SystemExit(
        "TEGA is built with Rust 1.89 or later, and there is no program `cargo` on the PATH: install Rust as "
        "https://rustup.rs says, open a new terminal, and type the same pip line again."
    )

from maturin import (
    build_editable,
    build_sdist,
    build_wheel,
    get_requires_for_build_editable,
    get_requires_for_build_sdist,
    get_requires_for_build_wheel,
    prepare_metadata_for_build_editable,
    prepare_metadata_for_build_wheel,
)

__all__ = [
    "build_editable",
    "build_sdist",
    "build_wheel",
    "get_requires_for_build_editable",
    "get_requires_for_build_sdist",
    "get_requires_for_build_wheel",
    "prepare_metadata_for_build_editable",
    "prepare_metadata_for_build_wheel",
]
