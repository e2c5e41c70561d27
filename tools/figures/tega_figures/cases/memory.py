"""Peak memory of a process that reads a large table of EMG."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

_RATE_HZ = 2000
_CHANNELS = 20
_ROWS_OF_A_BLOCK = 100_000
_READ = """
import sys
from pathlib import Path
from tega.runtime.files.signals import read_signals
from tega.runtime.files.tables.table import Reading
channels = tuple(int(number) for number in sys.argv[2].split(","))
# Unlike ru_maxrss, this leaves out the process that started this one.
peak_bytes = lambda: 1024 * int(Path("/proc/self/status").read_text().split("VmHWM:")[1].split()[0])
before = peak_bytes()
found = read_signals(Path(sys.argv[1]), Reading(channels=channels))
print(found.samples.nbytes // len(channels) * (len(channels) + 1), before, peak_bytes())
"""


def _written(path: Path, wanted_bytes: int) -> int:
    """Write time and 20 columns of random numbers as text; return the bytes."""
    rng = np.random.default_rng(1)
    rows = [
        ",".join(f"{number:.4f}" for number in row)
        for row in rng.normal(0, 100, (_ROWS_OF_A_BLOCK, _CHANNELS))
    ]
    n = first = 0
    with path.open("w", encoding="utf-8") as file:
        n += file.write("time," + ",".join(f"ch{k}" for k in range(1, _CHANNELS + 1)) + "\n")
        while n < wanted_bytes:
            n += file.write("".join(f"{(first + k) / _RATE_HZ:.4f},{row}\n" for k, row in enumerate(rows)))
            first += len(rows)
    return n


def memory_rows(scratch: Path) -> Iterator[str]:
    """Yield the lines of the table: a text of 2 GB of which 2 channels are kept, and one of 0.4 GB, all kept."""
    yield "| columns read | text | numbers read | peak of the process | of this, the program itself |"
    yield "|---|---|---|---|---|"
    for kept, gb in (((1, 2), 2.0), (tuple(range(1, _CHANNELS + 1)), 0.4)):
        path = scratch / "large.csv"
        size = _written(path, int(gb * 1e9))
        # Column 1 is the time.
        columns = ",".join(str(1 + number) for number in kept)
        command = [sys.executable, "-c", _READ, str(path), columns]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        numbers, program, peak = (int(word) for word in done.stdout.split())
        yield (
            f"| the times and {len(kept)} of {_CHANNELS} channels | {size / 1e6:,.0f} MB | {numbers / 1e6:.0f} MB "
            f"| {peak / 1e6:.0f} MB | {program / 1e6:.0f} MB |"
        )
        path.unlink()
