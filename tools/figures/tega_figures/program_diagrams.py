"""Diagrams of the program's pages, and ``python -m tega_figures.program_diagrams docs/images``, which writes all."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Final

from tega_figures.boxes import Arrow, Box, Diagram, svg
from tega_figures.hardware_diagrams import HARDWARE

__all__ = ["PROGRAM"]

PROGRAM: Final[dict[str, Diagram]] = {
    "own-device": Diagram(
        "A driver of yours stands between your device and the loop",
        {
            "d": Box(0, 0, "your device", "other"),
            "y": Box(1, 0, "your driver\nopen, read or write, close", "person"),
            "r": Box(2, 0, "TEGA\nfinds it by name"),
            "c": Box(1, 1, "python -m tega.setup.contract\nprints ok, or the broken rule"),
        },
        (Arrow("d", "y", both=True), Arrow("y", "r", both=True), Arrow("c", "y")),
        gap_x=50,
    ),
    "stages": Diagram(
        "The four kinds of stages in the loop",
        {
            "f": Box(0, 0, "fingertips\npictures", "robot"),
            "m": Box(1, 0, "metric\ncontacts: CCI, EDA, …"),
            "p": Box(2, 0, "mapping\na percent a motor"),
            "l": Box(2, 1, "layout\nwhere the motors are"),
            "v": Box(3, 0, "vest", "person"),
            "e": Box(0, 2, "muscles\nsamples", "person"),
            "d": Box(1, 2, "decoder\nlevel or closure"),
            "h": Box(3, 2, "hand", "robot"),
        },
        (
            Arrow("f", "m"),
            Arrow("m", "p"),
            Arrow("p", "v"),
            Arrow("l", "p"),
            Arrow("e", "d"),
            Arrow("d", "h", "limits of speed and torque"),
        ),
        gap_y=24,
    ),
    "play": Diagram(
        "Playing a recording: the same loop, another input",
        {
            "r": Box(0, 0, "recording\ntouch and levels", "other"),
            "l": Box(1, 0, "run\nlimits, states, guards"),
            "v": Box(2, 0, "vest of --to", "person"),
            "h": Box(2, 1, "hand of --to", "robot"),
        },
        (Arrow("r", "l", "at its times"), Arrow("l", "v"), Arrow("l", "h")),
        gap_x=90,
    ),
    "markers": Diagram(
        "Markers by the Lab Streaming Layer",
        {
            "t": Box(0, 0, "TEGA\nlsl_out"),
            "o": Box(1, 0, "LabRecorder, PsychoPy, …", "other"),
            "p": Box(1, 1, "another program's marks", "other"),
            "r": Box(0, 1, "recording\n/markers, lsl_in"),
        },
        (
            Arrow("t", "o", "states, trials, faults, pedals"),
            Arrow("p", "r", "times corrected between clocks"),
        ),
        gap_x=210,
    ),
    "arm-chain": Diagram(
        "From the forearm's pose to the arm's target",
        {
            "g": Box(0, 0, "gate\nrefuses lost, old, jumped"),
            "a": Box(1, 0, "axes\ninto the robot's"),
            "f": Box(2, 0, "One-Euro filter\nsmooths"),
            "c": Box(3, 0, "clutch\nrelative motion"),
            "w": Box(3, 1, "workspace\nbox and cone", "safe"),
            "k": Box(2, 1, "clip\n3 cm from the hand", "safe"),
            "l": Box(1, 1, "limits\n0.25 m/s, 2 m/s²", "safe"),
            "t": Box(0, 1, "target\nfor the arm", "robot"),
        },
        (
            Arrow("g", "a"),
            Arrow("a", "f"),
            Arrow("f", "c"),
            Arrow("c", "w"),
            Arrow("w", "k"),
            Arrow("k", "l"),
            Arrow("l", "t"),
        ),
    ),
    "arm-states": Diagram(
        "States of the arm",
        {
            "i": Box(0, 0, "idle\nat rest"),
            "f": Box(1, 0, "following"),
            "h": Box(2, 0, "holding\ncomes to rest"),
            "s": Box(1, 1, "stopped\nno force", "safe"),
        },
        (
            Arrow("i", "f", "clutch, dead-man"),
            Arrow("f", "h", "dead-man released,\nno pose 100 ms", both=True),
            Arrow("f", "s", "no pose 1 s, fault"),
            Arrow("s", "i", "recover"),
        ),
        gap_x=140,
        gap_y=60,
        note="nothing goes on by itself after a stop: a person recovers, then takes hold again",
    ),
    "run-states": Diagram(
        "States of a run",
        {
            "i": Box(0, 0, "idle\nhand opens, vest rests"),
            "a": Box(1, 0, "armed\nhand open, vest rests"),
            "x": Box(2, 0, "active\nhand follows, touch is felt"),
            "h": Box(2, 1, "hold\nhand keeps its level"),
            "s": Box(0, 1, "stopped\nzero torque, vest zeros", "safe"),
        },
        (
            Arrow("i", "a", "all devices ready"),
            Arrow("a", "x", "go"),
            Arrow("x", "h", "lost, or back", both=True),
            Arrow("h", "i", "after 2 s"),
            Arrow("i", "s", "any state: key, Ctrl-C, error"),
        ),
        gap_x=90,
        gap_y=60,
    ),
    "who-leads": Diagram(
        "Checks of a command at the robot's station",
        {
            "c": Box(0, 0, "command\nof an operator", "person"),
            "l": Box(1, 0, "of the leader?\nelse foreign", "safe"),
            "n": Box(2, 0, "newer than the last?\nelse repeated, reordered", "safe"),
            "o": Box(3, 0, "younger than ttl_ms?\nelse old", "safe"),
            "r": Box(4, 0, "limits, guard,\nwatchdogs, robot", "robot"),
        },
        (Arrow("c", "l"), Arrow("l", "n"), Arrow("n", "o"), Arrow("o", "r")),
    ),
    "stations": Diagram(
        "Two stations and the link between them",
        {
            "m": Box(0, 0, "EMG, tracker, switches", "person"),
            "o": Box(1, 0.5, "operator's station\nlevels, vest, page"),
            "v": Box(0, 1, "vest", "person"),
            "r": Box(2, 0.5, "robot's station\nmetrics, guard, limits"),
            "h": Box(3, 0, "hand, arm", "robot"),
            "f": Box(3, 1, "fingertips", "robot"),
        },
        (
            Arrow("m", "o"),
            Arrow("o", "v"),
            Arrow("o", "r", "levels, poses, switches\ntouch, states, pictures", both=True),
            Arrow("r", "h"),
            Arrow("f", "r"),
        ),
        gap_x=150,
        gap_y=20,
        note="TLS over one TCP port; every command has an age",
    ),
    "sim-loop": Diagram(
        "The simulated bench: blue is TEGA, the rest is simulated",
        {
            "p": Box(0, 0, "person\nEMG, 1 kHz", "person"),
            "d": Box(1, 0, "filter, levels, vote\n10 Hz"),
            "c": Box(2, 0, "controller, CAN\n333 Hz"),
            "w": Box(3, 0, "hand, arm, object\nphysics", "robot"),
            "g": Box(3, 1, "four gels\npictures, 60 Hz", "robot"),
            "m": Box(2, 1, "contact metrics"),
            "s": Box(1, 1, "sigmoid, columns\n30 Hz"),
            "v": Box(0, 1, "vest\nand eyes", "person"),
        },
        (
            Arrow("p", "d"),
            Arrow("d", "c"),
            Arrow("c", "w"),
            Arrow("w", "g"),
            Arrow("g", "m"),
            Arrow("m", "s"),
            Arrow("s", "v"),
            Arrow("v", "p", "feels, decides"),
        ),
    ),
    "study-flow": Diagram(
        "A study: the verbs and their files",
        {
            "p": Box(0, 0, "study plan\nstudy.toml, plan.csv"),
            "r": Box(1, 0, "study run\nevents.jsonl, recordings"),
            "o": Box(2, 0, "study observe, score\nraters' events"),
            "t": Box(3, 0, "study report\nreport.html, tables"),
        },
        (Arrow("p", "r", "never changed"), Arrow("r", "o"), Arrow("o", "t")),
        gap_x=100,
    ),
}

if __name__ == "__main__":
    for name, diagram in (HARDWARE | PROGRAM).items():
        Path(sys.argv[1], f"{name}.svg").write_text(svg(diagram), encoding="utf-8")
