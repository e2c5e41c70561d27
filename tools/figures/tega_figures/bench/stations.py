"""Two stations on emulated devices, each a program of its own: how long the way between them takes."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

import msgspec

from tega.config import FINGERS
from tega_figures.bench.machine import Machine, describe_machine

__all__ = ["StationsBench", "bench_stations"]

EMG_HZ = 1000.0


class StationsBench(msgspec.Struct, frozen=True, kw_only=True):
    """What a run gave.

    Attributes:
        machine: Where; both stations and all emulators ran on it.
        touch_ms: Camera at the robot's to the vest's bytes at the operator's, by stage; also ``whole``.
        intent_ms: EMG sample at the operator's station to the hand's torques at the robot's.
        command_ms: A command on its way, from being made to being received.
        feature_ms: What is read from a picture, likewise.
        clock: The operator's estimate, which on one machine should be 0.
        refused: Commands and features that were not used, by why.
    """

    machine: Machine
    seconds: float
    keys: bool
    touch_ms: dict[str, Any]
    intent_ms: dict[str, Any]
    command_ms: dict[str, Any]
    feature_ms: dict[str, Any]
    clock: dict[str, float]
    refused: dict[str, int]
    commands: int
    features: int
    images: int


def bench_stations(*, seconds: float, keys: bool) -> StationsBench:
    """Run four DIGITs and an Allegro Hand at one station, EMG at 1 kHz and a vest at the other.

    ``keys`` encrypt the link.
    """
    from tega_emulators.lab import PRESSED, emulated_lab, pressing
    from tega_emulators.stations import Program, free_port, split, write_trees
    from tega_link.keys import make_keys

    with tempfile.TemporaryDirectory(prefix="tega-bench-") as name:
        folder = Path(name)
        if keys:
            make_keys(folder / "keys", operators=["operator"], robots=["robot"])
        address = f"{'tls' if keys else 'tcp'}/127.0.0.1:{free_port()}"
        with emulated_lab(folder, emg_hz=EMG_HZ, hand=True, vest=True, fingers=FINGERS, touch=PRESSED) as lab:
            trees = split(lab.tree, listen=address, connect=address, keys=folder / "keys" if keys else None)
            files = write_trees(folder, trees)
            with Program("robot", files[0]) as robot, pressing(lab):
                robot.await_said("waits for an operator")
                with Program("operator", files[1]) as operator:
                    operator.await_said("\nactive: ")
                    robot.await_said("\nactive: ")
                    time.sleep(seconds)
                    here = operator.end()
                there = robot.end()
    refused: dict[str, int] = {}
    for side in (there["net"]["refused_commands"], here["net"]["refused_features"]):
        for why, n in side.items():
            refused[why] = refused.get(why, 0) + n
    return StationsBench(
        machine=describe_machine(),
        seconds=here["duration_s"],
        keys=keys,
        touch_ms=here["latency_ms"]["touch"],
        intent_ms=there["latency_ms"]["intent"],
        command_ms=there["net"]["way_ms"],
        feature_ms=here["net"]["way_ms"],
        clock=here["net"]["clock"],
        refused=refused,
        commands=there["net"]["commands"],
        features=sum(here["net"]["features"].values()),
        images=sum(there["net"]["images"].values()),
    )
