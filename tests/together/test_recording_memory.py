"""What a recording keeps in memory for as long as it goes on: the index of its file, and nothing else."""

from __future__ import annotations

import ctypes
import gc
import json
import os
import sys
import time
from pathlib import Path

import pytest

from reference.installed import program
from reference.parts import observed
from tega.config import check_tree
from tega.loop.session import run_session
from tega.loop.snapshot import LoopView
from tega.recording.record_channels import McapFile
from tega.records import Value

pytestmark = pytest.mark.slow

TOPICS = 14
_ENV = os.environ | {"PYTHONPATH": str(Path(__file__).parents[1])}
# The SDK keeps the index of every chunk, and a flush ends one: some 180 bytes and 38 for each topic in it.
MOST_BYTES_A_FLUSH = 1000


# As ``struct mallinfo2`` in malloc.h has them.
_HEAP = "arena ordblks smblks hblks hblkhd usmblks fsmblks uordblks fordblks keepcost"


class _Heap(ctypes.Structure):
    _fields_ = [(name, ctypes.c_size_t) for name in _HEAP.split()]


def _heap_bytes() -> int:
    """What is in use of the C library's heap; Python's own small objects are not in it."""
    info = ctypes.CDLL(None).mallinfo2
    info.restype = _Heap
    gc.collect()
    heap: _Heap = info()
    return int(heap.uordblks) + int(heap.hblkhd)


def _apart(*words: str) -> tuple[int, int]:
    """Measure in a program of its own: here other tests' threads come and go."""
    message = program(sys.executable, __file__, *words, env=_ENV)
    first, second = json.loads(message.stdout)
    return first, second


@pytest.mark.skipif(
    sys.platform != "linux" or not hasattr(ctypes.CDLL(None), "mallinfo2"), reason="asks glibc 2.33 or later"
)
def test_a_file_that_grows_keeps_its_index_in_memory_and_nothing_else(tmp_path: Path) -> None:
    heap_bytes, blocks = _apart(str(tmp_path / "long.mcap"))
    assert heap_bytes / 2000 < MOST_BYTES_A_FLUSH
    assert blocks < 1000  # less than one object for two flushes


def grown(path: Path) -> tuple[int, int]:
    """Return by how much 2000 flushes let the C library's heap and Python's objects grow: bytes, blocks."""
    file = McapFile(path, lossless=False)
    file.epoch_ns = 10**18
    heap: list[int] = []
    blocks: list[list[int]] = [[], []]
    t_ns = 0
    for k in range(2501):
        for n in range(2 * TOPICS):
            t_ns += 3_000_000
            file.write(Value(t_ns=t_ns, name=str(n % TOPICS), value=1.0), t_ns)
        file.flush()
        if k % 2000 > 480 and k % 2000 <= 500:  # pools and buffers are full by then
            time.sleep(0.02)  # the thread that writes to the disk comes to rest
            gc.collect()
            blocks[k // 2000].append(sys.getallocatedblocks())
        if k in {500, 2500}:
            heap.append(_heap_bytes())
    file.close()
    return heap[1] - heap[0], min(blocks[1]) - min(blocks[0])


def test_a_recorded_run_keeps_no_object_for_what_has_passed(tmp_path: Path) -> None:
    ticks, blocks = _apart("--run", str(tmp_path))
    assert ticks >= 26_600
    # 20 s from the early seconds, when all queues and pools have their size, to the late: one object kept for each tick
    # of the hand would be 6660, of the vest 600, of the muscles' levels 400. The muscles' condition keeps the median
    # frequency of each second of effort for 5 minutes, with its time: some 120 objects of its three channels.
    assert blocks < 400


def kept(folder: Path) -> tuple[int, int]:
    """Return the hand's ticks of a recorded run of 80 s, and the objects its last 10 s hold beyond earlier ones."""
    blocks: dict[int, int] = {}

    def check(view: LoopView) -> None:
        second = view.t_ns // 1_000_000_000
        if second not in blocks:
            time.sleep(0.05)  # the writer's queue runs empty
            gc.collect()
            blocks[second] = sys.getallocatedblocks()

    tree = {
        "session": {"pace": "fast"},
        "emg": {"driver": "synthetic-emg", "kind": "raw", "options": {"duration_s": 80.0}},
        "recording": {"dir": str(folder), "stop_free_mib": 0.0},
    }
    summary = run_session(check_tree(tree, {}, base=folder).config, bus=observed(check))
    # The least of ten: what waits in a queue at one instant is not kept.
    early = min(n for second, n in blocks.items() if 50 <= second < 60)
    late = min(n for second, n in blocks.items() if 70 <= second < 80)
    return summary["hand"]["ticks"], late - early


if __name__ == "__main__":
    measured = kept(Path(sys.argv[2])) if sys.argv[1] == "--run" else grown(Path(sys.argv[1]))
    print(json.dumps(measured))  # noqa: T201  # to the test, which waits for it
