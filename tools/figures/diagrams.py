"""Write the block diagrams of the user pages: ``python tools/figures/diagrams.py docs/images``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Final

from boxes import Arrow, Box, Diagram, svg

DIAGRAMS: Final[dict[str, Diagram]] = {
    "calibrate-full": Diagram(
        "Calibration: from what a person does to what a run uses",
        {
            "press": Box(0, 0, "fingertips\nuntouched, then six presses", "person"),
            "squeeze": Box(0, 1, "muscles\nrest, then three fists", "person"),
            "feel": Box(0, 2, "vest\nfelt or not, stronger or not", "person"),
            "full": Box(1, 0, "baseline and maxima\nwhat is nothing, what is full"),
            "emg": Box(1, 1, "rest and maxima\nof each channel"),
            "step": Box(1, 2, "threshold and step\nof each column"),
            "run": Box(2, 1, "a run with --person p01\nchecks age and device", "tega"),
        },
        (
            Arrow("press", "full"), Arrow("squeeze", "emg"), Arrow("feel", "step"),
            Arrow("full", "run"), Arrow("emg", "run"), Arrow("step", "run"),
        ),
        gap_x=60,
    ),
    "wire-digit": Diagram(
        "Four DIGITs: two on each USB controller",
        {
            "a": Box(0, 0, "DIGIT, thumb\n9.2 MB/s", "robot"), "b": Box(0, 1, "DIGIT, index\n9.2 MB/s", "robot"),
            "c": Box(0, 2, "DIGIT, middle\n9.2 MB/s", "robot"), "d": Box(0, 3, "DIGIT, ring\n9.2 MB/s", "robot"),
            "u": Box(1, 0.5, "USB controller 1\n35 MB/s", "other"), "v": Box(1, 2.5, "USB controller 2\n35 MB/s", "other"),
            "pc": Box(2, 1.5, "computer\nlsusb -t shows it"),
        },
        (
            Arrow("a", "u", "data cable"), Arrow("b", "u"), Arrow("c", "v", "data cable"), Arrow("d", "v"),
            Arrow("u", "pc"), Arrow("v", "pc"),
        ),
        gap_x=90, gap_y=14, note="a cable that only charges gives light, and no camera",
    ),
    "wire-emg": Diagram(
        "EMG: nothing on the mains while electrodes are on a person",
        {
            "e": Box(0, 0, "electrodes\nthree pairs, one reference", "person"),
            "b": Box(1, 0, "EMG board\non a battery", "other"),
            "l": Box(2, 0, "laptop\non its battery"),
            "x": Box(2, 1, "no charger, no screen,\nno wired network", "safe"),
        },
        (Arrow("e", "b", "cables"), Arrow("b", "l", "USB or radio"), Arrow("x", "l")),
        gap_x=96,
    ),
    "wire-vest": Diagram(
        "Four ways from a session to a vest",
        {
            "run": Box(0, 1.5, "session\n40 intensities, 30 Hz and more"),
            "p": Box(1, 0, "bhaptics-player\nthe vendor's Player", "tega"), "b": Box(1, 1, "bhaptics-ble\nBluetooth LE", "tega"),
            "h": Box(1, 2, "hid-vest\nTEGA's own USB reports", "tega"), "s": Box(1, 3, "on-screen-vest\na terminal", "tega"),
            "v": Box(2, 0.5, "bHaptics vest\nX40, Pro, X16", "person"), "o": Box(2, 2, "a board of your own\nand its motors", "person"),
        },
        (
            Arrow("run", "p"), Arrow("run", "b"), Arrow("run", "h"), Arrow("run", "s"),
            Arrow("p", "v"), Arrow("b", "v"), Arrow("h", "o"),
        ),
        gap_x=60, gap_y=14,
    ),
    "wire-allegro": Diagram(
        "Allegro Hand: supply with a switch, CAN with two ends",
        {
            "s": Box(0, 0, "12 V supply", "other"), "w": Box(1, 0, "switch\nwithin reach", "safe"),
            "h": Box(2, 0, "Allegro Hand v4\n120 Ω inside", "robot"),
            "pc": Box(1, 1, "computer\ncan0, 1 Mbit/s"), "a": Box(2, 1, "CAN adapter\n120 Ω at this end", "other"),
        },
        (
            Arrow("s", "w", "12 V"), Arrow("w", "h", "12 V"), Arrow("pc", "a", "USB", both=True),
            Arrow("a", "h", "CAN", both=True),
        ),
        gap_x=70, gap_y=50, note="one adapter for each hand; between CAN H and L you measure 60 Ω with the power off",
    ),
    "arm-process": Diagram(
        "A process of its own leads the arm; each stage holds whatever the one before it does",
        {
            "run": Box(0, 0, "run\ntarget, hold"), "leash": Box(1, 0, "leash\nrefuses old commands", "safe"),
            "slew": Box(2, 0, "slew\nlimits the speed", "safe"), "body": Box(3, 0, "body\nlimits the pull", "safe"),
            "arm": Box(4, 0, "arm\nits own limits, its stop", "robot"),
        },
        (Arrow("run", "leash"), Arrow("leash", "slew"), Arrow("slew", "body"), Arrow("body", "arm")),
        gap_x=36, note="back to the run: where the hand is, phase, problem, health of the loop",
    ),
    "wire-franka": Diagram(
        "Franka arm: real-time computer, control box, stop",
        {
            "pc": Box(0, 0, "computer\nPREEMPT_RT kernel"), "box": Box(1, 0, "control box\nrobot server 3 to 10", "other"),
            "arm": Box(2, 0, "Panda or FR3\n7 joints", "robot"), "stop": Box(1, 1, "emergency stop\nin the operator's hand", "safe"),
            "hand": Box(2, 1, "Allegro Hand\n1.1 kg: tell load_kg", "robot"),
        },
        (Arrow("pc", "box", "Ethernet", both=True), Arrow("box", "arm"), Arrow("stop", "box"), Arrow("arm", "hand")),
        gap_x=80, gap_y=44,
    ),
    "tracker-axes": Diagram(
        "From what a tracker sees to the robot's base",
        {
            "t": Box(0, 0, "forearm or wrist\none place, one turn", "person"),
            "a": Box(1, 0, "openxr axes\ny up, -z forward", "other"),
            "y": Box(2, 0, "yaw calibration\ntega-teleop forward"),
            "b": Box(3, 0, "robot's base\nx forward, y left, z up", "robot"),
        },
        (Arrow("t", "a"), Arrow("a", "y"), Arrow("y", "b")),
        note="x, y, z of the base are -z, -x, y of the tracker, turned by the yaw",
    ),
    "openxr-chain": Diagram(
        "OpenXR: the runtime comes with the headset",
        {
            "d": Box(0, 0, "controller, Vive tracker,\nor a wrist that is seen", "person"),
            "r": Box(1, 0, "OpenXR runtime\nMonado, WiVRn, SteamVR", "other"),
            "l": Box(2, 0, "OpenXR's loader\nextra openxr", "other"), "t": Box(3, 0, "driver openxr\n90 poses a second"),
        },
        (Arrow("d", "r"), Arrow("r", "l"), Arrow("l", "t")),
    ),
    "input-seats": Diagram(
        "Seats: what each switch does in a run",
        {
            "dm": Box(0, 0, "dead_man\nheld: things may move", "person"), "cl": Box(0, 1, "clutch\nheld: the arm follows", "person"),
            "mo": Box(0, 2, "motion\nsix axes move the arm", "person"), "re": Box(0, 3, "recover\npressed after a fault", "person"),
            "ma": Box(0, 4, "marker\nmarks a moment", "person"),
            "run": Box(1, 0.5, "run\nactive or hold"), "arm": Box(1, 2, "arm\nfollowing or idle", "robot"), "rec": Box(1, 4, "recording, LSL"),
        },
        (
            Arrow("dm", "run", "released: hold, at once"), Arrow("cl", "arm"), Arrow("mo", "arm"), Arrow("re", "arm"),
            Arrow("ma", "rec"), Arrow("run", "arm"),
        ),
        gap_x=150, gap_y=12,
    ),
    "motor-onset": Diagram(
        "Motor onset: from the frame to the vibration, heard by a microphone on the motor",
        {
            "f": Box(0, 0, "frame handed over\nits time is known"), "v": Box(1, 0, "radio, vest's processor\nunknown", "other"),
            "m": Box(2, 0, "motor spins up\ntens of ms", "person"), "s": Box(3, 0, "microphone\ntaped onto the motor", "other"),
        },
        (Arrow("f", "v"), Arrow("v", "m"), Arrow("m", "s")),
        note="onset = the moment at which the vibration begins in the recording, less the moment of the frame",
    ),
    "own-device": Diagram(
        "A driver of yours stands between your device and the loop",
        {
            "d": Box(0, 0, "your device", "other"), "y": Box(1, 0, "your driver\nopen, read or write, close", "person"),
            "r": Box(2, 0, "TEGA\nfinds it by name"), "c": Box(1, 1, "python -m tega.contract\nsays ok, or what is broken"),
        },
        (Arrow("d", "y", both=True), Arrow("y", "r", both=True), Arrow("c", "y")),
        gap_x=50,
    ),
    "stages": Diagram(
        "The four kinds of stages in the loop",
        {
            "f": Box(0, 0, "fingertips\npictures", "robot"), "m": Box(1, 0, "metric\ncontacts: CCI, EDA, …"),
            "p": Box(2, 0, "mapping\na percent a motor"), "l": Box(2, 1, "layout\nwhere the motors are"),
            "v": Box(3, 0, "vest", "person"), "e": Box(0, 2, "muscles\nsamples", "person"),
            "d": Box(1, 2, "decoder\nlevel or closure"), "h": Box(3, 2, "hand", "robot"),
        },
        (
            Arrow("f", "m"), Arrow("m", "p"), Arrow("p", "v"), Arrow("l", "p"), Arrow("e", "d"),
            Arrow("d", "h", "limits of speed and torque"),
        ),
        gap_y=24,
    ),
    "play": Diagram(
        "Playing a recording: the same loop, another input",
        {
            "r": Box(0, 0, "recording\ntouch and levels", "other"), "l": Box(1, 0, "run\nlimits, states, guards"),
            "v": Box(2, 0, "vest of --to", "person"), "h": Box(2, 1, "hand of --to", "robot"),
        },
        (Arrow("r", "l", "at its times"), Arrow("l", "v"), Arrow("l", "h")),
        gap_x=90,
    ),
    "markers": Diagram(
        "Markers by the Lab Streaming Layer",
        {
            "t": Box(0, 0, "TEGA\nlsl_out"), "o": Box(1, 0, "LabRecorder, PsychoPy, …", "other"),
            "p": Box(1, 1, "another program's marks", "other"), "r": Box(0, 1, "recording\n/markers, lsl_in"),
        },
        (Arrow("t", "o", "states, trials, faults, pedals"), Arrow("p", "r", "times corrected between clocks")),
        gap_x=210,
    ),
    "arm-chain": Diagram(
        "From the forearm's pose to the arm's target",
        {
            "g": Box(0, 0, "gate\nrefuses lost, old, jumped"), "a": Box(1, 0, "axes\ninto the robot's"),
            "f": Box(2, 0, "One-Euro filter\nsmooths"), "c": Box(3, 0, "clutch\nrelative motion"),
            "w": Box(3, 1, "workspace\nbox and cone", "safe"), "k": Box(2, 1, "clip\n3 cm from the hand", "safe"),
            "l": Box(1, 1, "limits\n0.25 m/s, 2 m/s²", "safe"), "t": Box(0, 1, "target\nfor the arm", "robot"),
        },
        (
            Arrow("g", "a"), Arrow("a", "f"), Arrow("f", "c"), Arrow("c", "w"), Arrow("w", "k"), Arrow("k", "l"), Arrow("l", "t"),
        ),
    ),
    "arm-states": Diagram(
        "States of the arm",
        {
            "i": Box(0, 0, "idle\nat rest"), "f": Box(1, 0, "following"), "h": Box(2, 0, "holding\ncomes to rest"),
            "s": Box(1, 1, "stopped\nno force", "safe"),
        },
        (
            Arrow("i", "f", "clutch, dead-man"), Arrow("f", "h", "dead-man released,\nno pose 100 ms", both=True),
            Arrow("f", "s", "no pose 1 s, fault"), Arrow("s", "i", "recover"),
        ),
        gap_x=140, gap_y=60, note="nothing goes on by itself after a stop: a person recovers, then takes hold anew",
    ),
    "run-states": Diagram(
        "States of a run",
        {
            "i": Box(0, 0, "idle\nhand opens, vest rests"), "a": Box(1, 0, "armed\nhand open, vest rests"),
            "x": Box(2, 0, "active\nhand follows, touch is felt"), "h": Box(2, 1, "hold\nhand keeps its level"),
            "s": Box(0, 1, "stopped\nzero torque, vest zeros", "safe"),
        },
        (
            Arrow("i", "a", "all is there"), Arrow("a", "x", "go"), Arrow("x", "h", "lost, or back", both=True),
            Arrow("h", "i", "after 2 s"), Arrow("i", "s", "any state: key, Ctrl-C, error"),
        ),
        gap_x=90, gap_y=60,
    ),
    "who-leads": Diagram(
        "What the robot's station asks of a command",
        {
            "c": Box(0, 0, "command\nof an operator", "person"), "l": Box(1, 0, "of the leader?\nelse foreign", "safe"),
            "n": Box(2, 0, "newer than the last?\nelse repeated, reordered", "safe"), "o": Box(3, 0, "younger than ttl_ms?\nelse old", "safe"),
            "r": Box(4, 0, "limits, guard,\nwatchdogs, robot", "robot"),
        },
        (Arrow("c", "l"), Arrow("l", "n"), Arrow("n", "o"), Arrow("o", "r")),
    ),
    "stations": Diagram(
        "Two stations: what goes over the link",
        {
            "m": Box(0, 0, "EMG, tracker, switches", "person"), "o": Box(1, 0.5, "operator's station\nlevels, vest, page"),
            "v": Box(0, 1, "vest", "person"), "r": Box(2, 0.5, "robot's station\nmetrics, guard, limits"),
            "h": Box(3, 0, "hand, arm", "robot"), "f": Box(3, 1, "fingertips", "robot"),
        },
        (
            Arrow("m", "o"), Arrow("o", "v"), Arrow("o", "r", "levels, poses, switches\ntouch, states, pictures", both=True),
            Arrow("r", "h"), Arrow("f", "r"),
        ),
        gap_x=150, gap_y=20, note="TLS over one TCP port; every command has an age",
    ),
    "sim-loop": Diagram(
        "The simulated bench: blue is TEGA, the rest is simulated",
        {
            "p": Box(0, 0, "person\nEMG, 1 kHz", "person"), "d": Box(1, 0, "filter, levels, vote\n10 Hz"),
            "c": Box(2, 0, "controller, CAN\n333 Hz"), "w": Box(3, 0, "hand, arm, object\nphysics", "robot"),
            "g": Box(3, 1, "four gels\npictures, 60 Hz", "robot"), "m": Box(2, 1, "contact metrics"),
            "s": Box(1, 1, "sigmoid, columns\n30 Hz"), "v": Box(0, 1, "vest\nand eyes", "person"),
        },
        (
            Arrow("p", "d"), Arrow("d", "c"), Arrow("c", "w"), Arrow("w", "g"), Arrow("g", "m"), Arrow("m", "s"), Arrow("s", "v"),
            Arrow("v", "p", "feels, decides"),
        ),
    ),
    "study-flow": Diagram(
        "A study: the verbs, and what each writes",
        {
            "p": Box(0, 0, "study plan\nstudy.toml, plan.csv"), "r": Box(1, 0, "study run\nevents.jsonl, recordings"),
            "o": Box(2, 0, "study observe, score\nraters' events"), "t": Box(3, 0, "study report\nreport.html, tables"),
        },
        (Arrow("p", "r", "never changed"), Arrow("r", "o"), Arrow("o", "t")),
        gap_x=100,
    ),
}  # fmt: skip


def main(folder: Path) -> None:
    """Write every diagram into a folder."""
    for name, diagram in DIAGRAMS.items():
        (folder / f"{name}.svg").write_text(svg(diagram), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
