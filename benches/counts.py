"""Instructions of the kernels under callgrind, compared with the committed counts: `make counts`.

A count depends on the code and on the compiler, hardly on the machine and not at all on what else it does, so it can
be trusted where times cannot. `make counts UPDATE=1` writes the counts anew. Exit code 1: a kernel is out of
tolerance, or has no committed count.
"""

from __future__ import annotations

import json
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Any, NamedTuple

from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

HERE = Path(__file__).resolve().parent
COMMITTED = HERE / "counts.toml"
SETS = ("avx2", "baseline")
# Pictures of one finger; kernels that read none have no such size.
SIZE = "320x240"
# What a change elsewhere in the crate moves by inlining differently; a real change is larger.
TOLERANCE = 0.02

Counts = dict[str, dict[str, int]]


class Verdict(NamedTuple):
    """One kernel on one path."""

    kernel: str
    path: str
    committed: int | None
    counted: int | None

    @property
    def change(self) -> float | None:
        """Relative to the committed count."""
        if self.committed is None or self.counted is None:
            return None
        return self.counted / self.committed - 1

    @property
    def remark(self) -> str:
        """What to say of it."""
        if self.committed is None:
            return "not committed"
        if self.counted is None:
            return "not on this processor" if self.ok else "gone"
        return "" if self.ok else "out of tolerance"

    @property
    def ok(self) -> bool:
        """Whether it is within tolerance; fewer instructions are out of it as well: commit them.

        A faster path may be missing from this processor; the baseline is never, unless its kernel is gone.
        """
        if self.counted is None:
            return self.path != SETS[-1]
        return self.change is not None and abs(self.change) <= TOLERANCE


def verdicts(committed: Counts, counted: Counts) -> list[Verdict]:
    """Put the two side by side."""
    return [
        Verdict(kernel, path, committed.get(kernel, {}).get(path), counted.get(kernel, {}).get(path))
        for kernel in sorted({*committed, *counted})
        for path in SETS
        if path in {*committed.get(kernel, {}), *counted.get(kernel, {})}
    ]


def count_all() -> Counts:
    """Build the driver and count every kernel on every path that this processor has."""
    manifest = str(HERE / "Cargo.toml")
    subprocess.run(
        ["cargo", "build", "--quiet", "--locked", "--release", "--bin", "count", "--manifest-path", manifest],
        check=True,
    )
    driver = HERE / "target" / "release" / "count"
    listed = subprocess.run([driver], check=True, text=True, capture_output=True).stdout
    counts: Counts = {}
    for line in listed.splitlines():
        kernel, dispatched = line.split("\t")
        if re.search(r"/\d+x\d+$", kernel) and not kernel.endswith(SIZE):
            continue
        for path in SETS if dispatched == "true" else SETS[-1:]:
            if (number := count(driver, kernel, path)) is not None:
                counts.setdefault(kernel, {})[path] = number
    return counts


def count(driver: Path, kernel: str, path: str) -> int | None:
    """Count one kernel's instructions; None where the processor lacks the path."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "callgrind.out"
        command = [
            "valgrind",
            "--tool=callgrind",
            f"--callgrind-out-file={out}",
            "--collect-atstart=no",
            "--toggle-collect=*counted*",
            str(driver),
            kernel,
        ]
        env = os.environ | {"TEGA_SIMD": path}
        done = subprocess.run(command, check=True, env=env, text=True, capture_output=True)
        if done.stdout.strip() != path:
            return None
        totals = re.search(r"^totals: (\d+)$", out.read_text(encoding="utf-8"), re.MULTILINE)
    if totals is None or totals[1] == "0":
        raise SystemExit(f"{kernel}: callgrind counted nothing; is `counted` still a function of its own?")
    return int(totals[1])


def compiler() -> str:
    """Return the compiler's name and version."""
    version = subprocess.run(["rustc", "--version"], cwd=HERE, check=True, text=True, capture_output=True)
    return " ".join(version.stdout.split()[:2])


def write(counts: Counts) -> None:
    """Commit counts."""
    lines = [
        "# Instructions of one call, from callgrind; written by `make counts UPDATE=1`.",
        f"machine = {json.dumps(platform.machine())}",
        f"compiler = {json.dumps(compiler())}",
    ]
    for kernel, paths in sorted(counts.items()):
        lines += ["", f"[counts.{json.dumps(kernel)}]", *(f"{path} = {n}" for path, n in paths.items())]
    COMMITTED.write_text("\n".join(lines) + "\n", encoding="utf-8")


def show(out: Console, rows: list[Verdict]) -> None:
    """Print the table."""
    table = Table(title="instructions of one call", title_justify="left", box=SIMPLE)
    table.add_column("kernel", no_wrap=True)
    table.add_column("path")
    for name in ("committed", "counted", "change"):
        table.add_column(name, justify="right")
    table.add_column("")
    for row in rows:
        numbers = ("–" if n is None else f"{n:,}" for n in (row.committed, row.counted))
        change = "–" if row.change is None else f"{row.change:+.2%}"
        table.add_row(row.kernel, row.path, *numbers, change, row.remark)
    out.print(table)


def main() -> int:
    """Count, then compare or write."""
    out = Console(highlight=False, width=130)
    committed: dict[str, Any] = (
        tomllib.loads(COMMITTED.read_text(encoding="utf-8")) if COMMITTED.exists() else {}
    )
    update = "--update" in sys.argv[1:]
    for tool in ("valgrind", "cargo"):
        if shutil.which(tool) is None:
            out.print(f"skipped: {tool} is not installed, so no instructions were counted")
            return 0
    if not update and committed.get("machine", platform.machine()) != platform.machine():
        out.print(
            f"skipped: the committed counts are of {committed['machine']}, this is {platform.machine()}"
        )
        return 0
    counted = count_all()
    rows = verdicts(committed.get("counts", {}), counted)
    show(out, rows)
    if update:
        write(counted)
        out.print(f"written to {COMMITTED.relative_to(HERE.parent)}")
        return 0
    if committed.get("compiler", compiler()) != compiler():
        out.print(
            f"note: committed with {committed['compiler']}, counted with {compiler()}: that alone moves counts"
        )
    failed = [row for row in rows if not row.ok]
    out.print(f"{len(rows) - len(failed)} of {len(rows)} within {TOLERANCE:.0%}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
