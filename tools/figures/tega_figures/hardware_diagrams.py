"""Diagrams of the hardware pages: what is wired to what."""

from __future__ import annotations

from typing import Final

from tega_figures.boxes import Arrow, Box, Diagram

__all__ = ["HARDWARE"]

HARDWARE: Final[dict[str, Diagram]] = {
    "calibrate-full": Diagram(
        "Calibration: from presses and squeezes to a run",
        {
            "press": Box(0, 0, "fingertips\nuntouched, then six presses", "person"),
            "squeeze": Box(0, 1, "muscles\nrest, then three fists", "person"),
            "feel": Box(0, 2, "vest\nfelt or not, stronger or not", "person"),
            "full": Box(1, 0, "baseline and maxima\nzero and full scale"),
            "emg": Box(1, 1, "rest and maxima\nof each channel"),
            "step": Box(1, 2, "threshold and step\nof each column"),
            "run": Box(2, 1, "a run with --person p01\nchecks age and device", "tega"),
        },
        (
            Arrow("press", "full"),
            Arrow("squeeze", "emg"),
            Arrow("feel", "step"),
            Arrow("full", "run"),
            Arrow("emg", "run"),
            Arrow("step", "run"),
        ),
        gap_x=60,
    ),
    "wire-digit": Diagram(
        "Four DIGITs: two on each USB controller",
        {
            "a": Box(0, 0, "DIGIT, thumb\n9.2 MB/s", "robot"),
            "b": Box(0, 1, "DIGIT, index\n9.2 MB/s", "robot"),
            "c": Box(0, 2, "DIGIT, middle\n9.2 MB/s", "robot"),
            "d": Box(0, 3, "DIGIT, ring\n9.2 MB/s", "robot"),
            "u": Box(1, 0.5, "USB controller 1\n35 MB/s", "other"),
            "v": Box(1, 2.5, "USB controller 2\n35 MB/s", "other"),
            "pc": Box(2, 1.5, "computer\nlsusb -t shows it"),
        },
        (
            Arrow("a", "u", "data cable"),
            Arrow("b", "u"),
            Arrow("c", "v", "data cable"),
            Arrow("d", "v"),
            Arrow("u", "pc"),
            Arrow("v", "pc"),
        ),
        gap_x=90,
        gap_y=14,
        note="a cable that only charges gives light, and no camera",
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
            "p": Box(1, 0, "bhaptics-player\nthe vendor's Player", "tega"),
            "b": Box(1, 1, "bhaptics-ble\nBluetooth LE", "tega"),
            "h": Box(1, 2, "hid-vest\nTEGA's own USB reports", "tega"),
            "s": Box(1, 3, "on-screen-vest\na terminal", "tega"),
            "v": Box(2, 0.5, "bHaptics vest\nX40, Pro, X16", "person"),
            "o": Box(2, 2, "a board of your own\nand its motors", "person"),
        },
        (
            Arrow("run", "p"),
            Arrow("run", "b"),
            Arrow("run", "h"),
            Arrow("run", "s"),
            Arrow("p", "v"),
            Arrow("b", "v"),
            Arrow("h", "o"),
        ),
        gap_x=60,
        gap_y=14,
    ),
    "wire-allegro": Diagram(
        "Allegro Hand: supply with a switch, CAN with two ends",
        {
            "s": Box(0, 0, "12 V supply", "other"),
            "w": Box(1, 0, "switch\nwithin reach", "safe"),
            "h": Box(2, 0, "Allegro Hand v4\n120 Ω inside", "robot"),
            "pc": Box(1, 1, "computer\ncan0, 1 Mbit/s"),
            "a": Box(2, 1, "CAN adapter\n120 Ω at this end", "other"),
        },
        (
            Arrow("s", "w", "12 V"),
            Arrow("w", "h", "12 V"),
            Arrow("pc", "a", "USB", both=True),
            Arrow("a", "h", "CAN", both=True),
        ),
        gap_x=70,
        gap_y=50,
        note="one adapter for each hand; between CAN H and L you measure 60 Ω with the power off",
    ),
    "arm-process": Diagram(
        "A process of its own leads the arm; each stage holds whatever the one before it does",
        {
            "run": Box(0, 0, "run\ntarget, hold"),
            "leash": Box(1, 0, "leash\nrefuses old commands", "safe"),
            "slew": Box(2, 0, "slew\nlimits the speed", "safe"),
            "body": Box(3, 0, "body\nlimits the pull", "safe"),
            "arm": Box(4, 0, "arm\nits own limits, its stop", "robot"),
        },
        (Arrow("run", "leash"), Arrow("leash", "slew"), Arrow("slew", "body"), Arrow("body", "arm")),
        gap_x=36,
        note="back to the run: where the hand is, phase, problem, health of the loop",
    ),
    "wire-franka": Diagram(
        "Franka arm: real-time computer, control box, stop",
        {
            "pc": Box(0, 0, "computer\nPREEMPT_RT kernel"),
            "box": Box(1, 0, "control box\nrobot server 3 to 10", "other"),
            "arm": Box(2, 0, "Panda or FR3\n7 joints", "robot"),
            "stop": Box(1, 1, "emergency stop\nin the operator's hand", "safe"),
            "hand": Box(2, 1, "Allegro Hand\n1.1 kg: tell load_kg", "robot"),
        },
        (
            Arrow("pc", "box", "Ethernet", both=True),
            Arrow("box", "arm"),
            Arrow("stop", "box"),
            Arrow("arm", "hand"),
        ),
        gap_x=80,
        gap_y=44,
    ),
    "tracker-axes": Diagram(
        "From the tracker to the robot's base",
        {
            "t": Box(0, 0, "forearm or wrist\none place, one turn", "person"),
            "a": Box(1, 0, "openxr axes\ny up, -z forward", "other"),
            "y": Box(2, 0, "yaw calibration\ncalibrate --only arm"),
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
            "l": Box(2, 0, "OpenXR's loader\nextra openxr", "other"),
            "t": Box(3, 0, "driver openxr\n90 poses a second"),
        },
        (Arrow("d", "r"), Arrow("r", "l"), Arrow("l", "t")),
    ),
    "input-seats": Diagram(
        "Seats: the effect of each switch in a run",
        {
            "dm": Box(0, 0, "dead_man\nheld: things may move", "person"),
            "cl": Box(0, 1, "clutch\nheld: the arm follows", "person"),
            "mo": Box(0, 2, "motion\nsix axes move the arm", "person"),
            "re": Box(0, 3, "recover\npressed after a fault", "person"),
            "ma": Box(0, 4, "marker\nmarks a moment", "person"),
            "run": Box(1, 0.5, "run\nactive or hold"),
            "arm": Box(1, 2, "arm\nfollowing or idle", "robot"),
            "rec": Box(1, 4, "recording, LSL"),
        },
        (
            Arrow("dm", "run", "released: hold, at once"),
            Arrow("cl", "arm"),
            Arrow("mo", "arm"),
            Arrow("re", "arm"),
            Arrow("ma", "rec"),
            Arrow("run", "arm"),
        ),
        gap_x=150,
        gap_y=12,
    ),
    "motor-onset": Diagram(
        "Motor onset: from the frame to the vibration, heard by a microphone on the motor",
        {
            "f": Box(0, 0, "frame handed over\nits time is known"),
            "v": Box(1, 0, "radio, vest's processor\nunknown", "other"),
            "m": Box(2, 0, "motor spins up\ntens of ms", "person"),
            "s": Box(3, 0, "microphone\ntaped onto the motor", "other"),
        },
        (Arrow("f", "v"), Arrow("v", "m"), Arrow("m", "s")),
        note="onset = the moment at which the vibration begins in the recording, less the moment of the frame",
    ),
}
