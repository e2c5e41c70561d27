"""The whole loop in real time on emulated devices, each in a process of its own: how long our part of it takes."""

from __future__ import annotations

import os
import sys
import tempfile
import threading
from pathlib import Path
from typing import Any, Literal

import msgspec

from tega.config import Pace, check_tree
from tega.loop.pacing import LATE_EDGES_NS
from tega_figures.bench.machine import Machine, describe_machine, processor_s
from tega_figures.bench.witness import LateTicks, witness

__all__ = ["LoopBench", "bench_loop"]

EMG_HZ = 1000.0


class LoopBench(msgspec.Struct, frozen=True, kw_only=True):
    """What a run gave.

    Attributes:
        machine: Where; the emulators ran on the same one.
        preset: Of the session: ``paper`` measures touch alike in all versions, ``live`` does not.
        latency_ms: Percentiles of every stage by path; see :mod:`tega.loop.latency`.
        pacing: Ticks, and how late they were.
        late_edges_ms: Upper bounds of the bins of both histograms of late ticks.
        late_ticks: The loop's own ticks: those at which the hand gets its level, and the vest's between them.
        hand_ticks: Sets of positions that the emulated hand sent, one every 3 ms, by how long after each, by
            the hand's own clock, the torques that answer it had come; these are its process's ticks.
        witness_ticks: Those of a bare native clock of 3 ms in a process of its own, at the same time on the
            same cores and at the priority of the hand's process.
        frames_hz: Pictures used, all fingers together.
        samples_hz: EMG samples used.
        hand_hz: Ticks of the loop for the hand; 333 are due.
        cpu_cores: Processor time of the run's process and of those of its recorder, its hand and that one's
            guard, their start included, per second.
        run_cores: That of the run's process alone.
        emulators_cores: That of the emulated devices.
        threads: Of the run's process, in the middle of the run, one of them the bench's own.
        vest: The summary's table of the vest: frames made, sent and left out.
        held_ticks: Hand ticks on which the muscles did not steer, those before the run was active included.
        devices_ahead: Whether the emulators went before every thread of ours, as devices do, which have
            processors of their own: what they took, they took from us.
    """

    machine: Machine
    preset: str
    seconds: float
    latency_ms: dict[str, Any]
    pacing: dict[str, Any]
    late_edges_ms: tuple[float, ...]
    late_ticks: LateTicks
    hand_ticks: LateTicks
    witness_ticks: LateTicks
    frames_hz: float
    samples_hz: float
    hand_hz: float
    cpu_cores: float
    run_cores: float
    emulators_cores: float
    threads: int
    vest: dict[str, Any]
    held_ticks: int
    devices_ahead: bool


def bench_loop(
    *,
    seconds: float,
    record: bool,
    pace: Pace = "by-frame",
    most_hz: float | None = None,
    preset: Literal["paper", "live"] = "live",
    n_fingers: int = 4,
) -> LoopBench:
    """Run DIGITs at 60 Hz, EMG at 1 kHz, an Allegro Hand and a vest for a while.

    The ``n_fingers`` DIGITs share four columns of the vest. With ``record`` the run is recorded and its tables are
    written as well. ``pace`` is ``vest.pace`` of a session's settings; ``most_hz`` is the greatest rate of the vest's
    link, ``None`` for the driver's own.
    """
    from tega.loop.session import run_session
    from tega_emulators.lab import PRESSED, emulated_lab, pressing

    fingers = [f"finger_{number}" for number in range(1, n_fingers + 1)]
    with tempfile.TemporaryDirectory(prefix="tega-bench-") as name:
        folder = Path(name)
        with emulated_lab(
            folder, emg_hz=EMG_HZ, hand="network", vest=True, fingers=fingers, touch=PRESSED, preset=preset
        ) as lab:
            lab.tree["session"] = {"duration_s": seconds, "preset": preset}
            columns = [column for k in range(4) if (column := fingers[k::4])]
            lab.tree["stages"] = {"mapping": {"options": {"fingers": columns}}}
            lab.tree["vest"]["pace"] = pace
            if most_hz is not None:
                lab.tree["vest"]["options"]["most_hz"] = most_hz
            if record:
                lab.tree["session"]["out_dir"] = str(folder / "out")
                lab.tree["recording"] = {"dir": str(folder / "recorded")}
            config = check_tree(lab.tree, {}, base=folder).config
            cpu_s: list[tuple[float, ...]] = []
            threads: list[int] = []

            def used_s() -> tuple[float, ...]:
                devices = [device.pid for device in lab.devices]
                return (*_processor_s(), processor_s(devices))

            def progress(subject: str, _done: int, _total: int) -> None:
                if subject == "running":
                    cpu_s.append(used_s())
                    lab.hand.say("answers")
                    beside.begin(seconds)
                    half.start()

            half = threading.Timer(seconds / 2, lambda: threads.append(_n_threads() - 1))
            with witness() as beside, pressing(lab):
                ahead = lab.go_ahead()
                summary = run_session(config, progress=progress)
                cpu_s.append(used_s())
                answers_ms = lab.hand.say("answers")["answers_ms"]
                witness_ticks = beside.late()
            whole_s, own_s, devices_s = (after - before for before, after in zip(*cpu_s, strict=True))
    wall_s, pacing = summary["duration_s"], summary["pacing"]
    return LoopBench(
        machine=describe_machine(),
        preset=preset,
        seconds=wall_s,
        latency_ms=summary["latency_ms"],
        pacing=pacing,
        late_edges_ms=tuple(edge_ns / 1e6 for edge_ns in LATE_EDGES_NS),
        late_ticks=LateTicks.of_bins(pacing["late"], worst_ms=pacing["worst_late_ms"]),
        hand_ticks=LateTicks.of([round(1e6 * answer_ms) for answer_ms in answers_ms]),
        witness_ticks=witness_ticks,
        frames_hz=sum(f["frames"] for f in summary["tactile"].values()) / wall_s,
        samples_hz=summary["emg"]["samples"] / wall_s,
        hand_hz=summary["hand"]["ticks"] / wall_s,
        cpu_cores=whole_s / wall_s,
        run_cores=own_s / wall_s,
        emulators_cores=devices_s / wall_s,
        threads=max(threads, default=0),
        vest=summary["vest"],
        held_ticks=summary["safety"]["held_ticks"],
        devices_ahead=ahead,
    )


def _processor_s() -> tuple[float, float]:
    """Return the processor time of this process with those that it has started and ended, and its own, seconds."""
    times = os.times()
    return sum(times[:4]), times.user + times.system


def _n_threads() -> int:
    """Return how many threads this process has, those of libraries among them; 0 but on Linux."""
    return len(list(Path("/proc/self/task").iterdir())) if sys.platform == "linux" else 0
