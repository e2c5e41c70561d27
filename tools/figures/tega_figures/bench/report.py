"""One run of the bench: what is measured, and the report it becomes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib.util import find_spec
from typing import Literal

import msgspec
import numpy as np

from tega_figures.bench.batches import BatchRow, batch_rows
from tega_figures.bench.filters import (
    BLOCK_ROWS,
    Samples,
    error_of_full_scale,
    filters,
    signal,
    true_response,
)
from tega_figures.bench.machine import Machine, describe_machine
from tega_figures.bench.peers import contact_peers
from tega_figures.bench.scenes import SIZE_OF_A_FINGER, SIZE_OF_A_SENSOR, SIZES, BenchScene, scenes
from tega_figures.bench.tick import TickRow, time_ticks
from tega_figures.bench.timing import Timing, ratio, single_threaded, take_turns, timing
from tega_figures.bench.variants import (
    CONTACT_LAWS,
    FLOOR,
    NUMPY_FLOOR,
    ContactError,
    ContactKernel,
    Law,
    floor_kernels,
    law_kernel,
    measure_error,
    preset_kernel,
    worst,
)
from tega_figures.bench.widths import WidthRow, width_rows
from tega_figures.exact import ExactContact, exact_contact, exact_paper

__all__ = ["BILINEAR", "FLOOR", "BenchReport", "ContactRow", "FilterRow", "run_bench"]

OURS, BILINEAR = "TEGA", "TEGA, bilinear"
FLOORS = (FLOOR, NUMPY_FLOOR)
METHOD = (
    "Variants take turns: in every round each is called five times, the first untimed, in an order that reverses "
    "from round to round; two rounds go before the timed ones. Wall clock, garbage collector off, libraries held to "
    "one thread. A ratio is the median over rounds of the ratio of the turns' medians. A variant's time is the call "
    "from Python with arrays in and numbers out. Errors are the worst of three generated presses against exact "
    "integers and fractions (contact) and against 60 digits (EMG); times are of the second press. The floor is the C "
    "library's memcmp of a picture and its copy."
)
# Every law is measured at the size of a finger's picture; of the other sizes these show how times grow.
SCALED_LAWS = CONTACT_LAWS[:2]
# Line by line NumPy makes a dozen double-precision copies: gigabytes at this size.
LARGEST_FOR_COPIES = 1_000_000
TIMED_SCENE = 1
ERROR_ROWS, BULK_ROWS = 1000, 100_000
FULL_SCALE = 4096.0


class ContactRow(msgspec.Struct, frozen=True, kw_only=True):
    """One way to compute contact metrics.

    Attributes:
        reading: The law of the equations, or the preset.
        variant: TEGA, a peer, or a floor: the C library's ``memcmp``, and NumPy's reduction.
        size: Height and width.
        to_floor: A call's time over that of reading both images once.
        to_best_peer: Its time over that of the fastest peer; ``None`` where no peer computes this.
        error: Against the exact answer; ``None`` where there is none, as for the floor and `live`.
    """

    reading: str
    variant: str
    size: tuple[int, int]
    time: Timing
    to_floor: float
    to_best_peer: float | None
    error: ContactError | None


FilterCase = Literal["block", "bulk", "one channel"]


class FilterRow(msgspec.Struct, frozen=True, kw_only=True):
    """One way to low-pass EMG.

    Attributes:
        case: ``block`` of 10 rows, ``bulk``, or ``one channel`` in bulk.
        variant: TEGA or a peer.
        n_rows: Rows in a call, of three channels or one.
        ns_per_sample: Median over rows and channels.
        to_best_peer: A call's time over that of the fastest peer.
        error_of_full_scale: Largest deviation from 60 digits over the converter's range.
    """

    case: FilterCase
    variant: str
    n_rows: int
    time: Timing
    ns_per_sample: float
    to_best_peer: float | None
    error_of_full_scale: float


class BenchReport(msgspec.Struct, frozen=True, kw_only=True):
    """A whole run.

    Attributes:
        threads: What held the libraries to one thread, by library.
        missing: Packages that are not installed, whose variants were not measured.
        contact: One row a reading, variant and size; the floor is among them.
        widths: One row a size and layout in memory.
        emg: One row a case and variant.
        batches: One row a reading and number of frames.
        tick: One row a preset and number of fingers in contact.
    """

    method: str
    machine: Machine
    threads: dict[str, str]
    missing: list[str]
    contact: list[ContactRow]
    widths: list[WidthRow]
    emg: list[FilterRow]
    batches: list[BatchRow]
    tick: list[TickRow]


def run_bench(
    *, quick: bool = False, progress: Callable[[str, int, int], None] = lambda _subject, _done, _total: None
) -> BenchReport:
    """Measure everything; ``quick`` means a tenth of the rounds, and not the largest pictures.

    ``progress`` receives what is measured, how much of the run is done, and how much there is.
    """
    budget_s = 0.3 if quick else 3.0
    sizes = [size for size in SIZES if not (quick and size == SIZE_OF_A_SENSOR)]
    jobs: list[
        tuple[str, Callable[[], Sequence[ContactRow | WidthRow | FilterRow | BatchRow | TickRow]]]
    ] = []
    for size in sizes:
        laws = CONTACT_LAWS if size == SIZE_OF_A_FINGER else SCALED_LAWS
        jobs += [(f"{law.name} {size}", partial(contact_rows, law, size, budget_s=budget_s)) for law in laws]
        jobs.append((f"presets {size}", partial(preset_rows, size, budget_s=budget_s)))
    jobs.append(("widths", partial(width_rows, budget_s=budget_s / 5)))
    jobs.append(("EMG", partial(filter_rows, budget_s=budget_s)))
    jobs.append(("batches", partial(batch_rows, budget_s=budget_s)))
    jobs.append(("tick", partial(time_ticks, budget_s=2 * budget_s)))
    rows: list[ContactRow | WidthRow | FilterRow | BatchRow | TickRow] = []
    machine = describe_machine()
    with single_threaded() as threads:
        for number, (subject, job) in enumerate(jobs):
            progress(subject, number, len(jobs))
            rows += job()
    return BenchReport(
        method=METHOD,
        machine=machine,
        threads=threads,
        missing=[name for name in ("cv2", "numba", "scipy") if find_spec(name) is None],
        contact=[row for row in rows if isinstance(row, ContactRow)],
        widths=[row for row in rows if isinstance(row, WidthRow)],
        emg=[row for row in rows if isinstance(row, FilterRow)],
        batches=[row for row in rows if isinstance(row, BatchRow)],
        tick=[row for row in rows if isinstance(row, TickRow)],
    )


def contact_rows(law: Law, size: tuple[int, int], *, budget_s: float) -> list[ContactRow]:
    """Measure the ways to compute one law: ours first, then the peers, then the floor."""
    pictures = scenes(size)
    kernels: dict[str, ContactKernel] = {OURS: law_kernel(law)}
    truths = {OURS: [exact_contact(*scene, **law._asdict()) for scene in pictures]}
    peers = contact_peers(law, size)
    if size[0] * size[1] > LARGEST_FOR_COPIES:
        peers.pop("NumPy, as printed", None)
    truths |= dict.fromkeys(peers, truths[OURS])
    if law.spread == "spatial" and size == SIZE_OF_A_FINGER:
        between = law._replace(centroid_value="bilinear")
        kernels[BILINEAR] = law_kernel(between)
        truths[BILINEAR] = [exact_contact(*scene, **between._asdict()) for scene in pictures]
    return _measured(law.name, size, pictures, kernels | peers, truths, budget_s=budget_s)


def preset_rows(size: tuple[int, int], *, budget_s: float) -> list[ContactRow]:
    """Measure the presets; `live` follows no equation, so it has no error here."""
    pictures = scenes(size)
    kernels = {"TEGA, paper": preset_kernel("paper"), "TEGA, live": preset_kernel("live")}
    truths = {"TEGA, paper": [exact_paper(*scene) for scene in pictures]}
    return _measured("presets", size, pictures, kernels, truths, budget_s=budget_s)


def _measured(
    reading: str,
    size: tuple[int, int],
    pictures: list[BenchScene],
    kernels: Mapping[str, ContactKernel],
    truths: Mapping[str, list[ExactContact]],
    *,
    budget_s: float,
) -> list[ContactRow]:
    errors = {name: _worst_error(kernels[name], pictures, answers) for name, answers in truths.items()}
    timed = pictures[TIMED_SCENE]
    calls: dict[str, Callable[[], object]] = {n: partial(kernel, *timed) for n, kernel in kernels.items()}
    turns = take_turns(calls | floor_kernels(timed), budget_s=budget_s)
    best = _best_peer(turns)
    return [
        ContactRow(
            reading=reading,
            variant=name,
            size=size,
            time=timing(own),
            to_floor=ratio(own, turns[FLOOR]),
            to_best_peer=ratio(own, turns[best]) if best and name not in FLOORS else None,
            error=errors.get(name),
        )
        for name, own in turns.items()
    ]


def _worst_error(
    kernel: ContactKernel, pictures: list[BenchScene], answers: list[ExactContact]
) -> ContactError | None:
    pairs = zip(pictures, answers, strict=True)
    return worst([measure_error(kernel(*scene), truth) for scene, truth in pairs])


def _best_peer(turns: Mapping[str, list[list[int]]]) -> str | None:
    medians = {n: timing(t).median_us for n, t in turns.items() if n not in FLOORS and not n.startswith(OURS)}
    return min(medians, key=lambda name: medians[name]) if medians else None


def filter_rows(*, budget_s: float) -> list[FilterRow]:
    """Measure the EMG low-passes on short blocks and in bulk, and in bulk on one channel alone."""
    errors = _filter_errors()
    rows: list[FilterRow] = []
    bulk = signal(BULK_ROWS)
    cases: dict[FilterCase, Samples] = {
        "block": signal(BLOCK_ROWS),
        "bulk": bulk,
        "one channel": np.ascontiguousarray(bulk[:, :1]),
    }
    for case, samples in cases.items():
        calls = {name: partial(run, samples) for name, run in filters(samples[0]).items()}
        turns = take_turns(calls, budget_s=budget_s)
        best = _best_peer(turns)
        for name, own in turns.items():
            time = timing(own)
            rows.append(
                FilterRow(
                    case=case,
                    variant=name,
                    n_rows=len(samples),
                    time=time,
                    ns_per_sample=time.median_us * 1000 / samples.size,
                    to_best_peer=ratio(own, turns[best]) if best else None,
                    error_of_full_scale=errors[name],
                )
            )
    return rows


def _filter_errors() -> dict[str, float]:
    samples = signal(ERROR_ROWS)
    truth = true_response(samples)
    blocks = np.split(samples, ERROR_ROWS // BLOCK_ROWS)
    return {
        name: error_of_full_scale(np.concatenate([run(block) for block in blocks]), truth, FULL_SCALE)
        for name, run in filters(samples[0]).items()
    }
