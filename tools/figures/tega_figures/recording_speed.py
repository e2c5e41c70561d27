"""Make a recording of any length, and measure what the commands that read it cost.

    python -m tega_figures.recording_speed make SESSION --seconds 60
    python -m tega_figures.recording_speed measure SESSION/trial-001.mcap [FILE ...] -n 3

The recording is a simulated lift that does not end: from 4 s on the person holds the bottle where it stands,
four fingers touch it, 60 pictures a second each. A lifted one creeps out of the hand, and falls after 43 min.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Final, NamedTuple

import tega
from tega_sim.lab import lab_of
from tega_sim.lift import Lift
from tega_sim.plan import TrialPlan
from tega_sim.rig import TrialSteering
from tega_sim.seams import Act, Percept
from tega_sim.streams import LiftRecorder

# All fingers touch the object by then, and the person has not begun to lift it.
_HELD_S: Final = 4.0
COMMANDS: Final = {
    "verify": ["verify"],
    "tables, CSV": ["recording", "export", "--format", "csv"],
    "tables, Parquet": ["recording", "export", "--format", "parquet"],
    "LeRobot": ["recording", "export", "--format", "lerobot"],
}


class Holding:
    """A person who grasps an object and never lifts it or lets go."""

    def __init__(self, person: TrialSteering) -> None:
        self._person = person
        self._held: Act | None = None

    def begin(self, name: str, *, width_m: float, trial: int = 0, rest_s: float = 60.0) -> None:
        """Start a lift."""
        self._person.begin(name, width_m=width_m, trial=trial, rest_s=rest_s)

    def act(self, percept: Percept) -> Act:
        """Return the person's action, the same from four seconds on.

        Its phase is ``place``: else an object that rises and stands again is dropped, which ends the lift.
        """
        if self._held is None:
            act = self._person.act(percept)
            if percept.t_s < _HELD_S:
                return act
            self._held = act._replace(phase="place")
        return self._held


def make(session: Path, seconds: float) -> None:
    """Record a lift of this length; it ends because the object was not lifted by then."""
    plan = TrialPlan(object="bottle", seed=1)
    lab = lab_of(plan.seed, plan.preset, plan.settings)
    recorder = LiftRecorder(session, real_time=False)
    lift = Lift(lab, plan, Holding(lab.person(plan)), 0, recorder=recorder, lift_by_s=seconds)
    lift.go()
    recorder.finish(lift.result(lift.end_s))


class Cost(NamedTuple):
    """Cost of a command: of all its processes together, memory of the largest of them."""

    wall_s: float
    processor_s: float
    mib: float


def cost_of(words: list[str]) -> Cost:
    """Run a command; return its cost."""
    began_s = time.perf_counter()
    child = subprocess.Popen(words, stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(child.pid, 0)
    if status:
        raise SystemExit(f"{' '.join(words)}: exit status {status}")
    return Cost(time.perf_counter() - began_s, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024)


def measure(paths: list[Path], n: int) -> None:
    """Print a table of every command on every recording: the least of n."""
    print(f"n = {n}, load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores at the start\n")
    print("| recording | command | s | times real time | processor s | MiB |\n|---|---|---|---|---|---|")
    program = str(Path(sys.executable).with_name("tega-teleop"))
    for path in paths:
        length_s = tega.open_recording(path).duration_s
        for name, words in COMMANDS.items():
            found = []
            for _ in range(n):
                with tempfile.TemporaryDirectory() as out:
                    more = [] if name == "verify" else ["--out", f"{out}/new"]
                    found.append(cost_of([program, *words, str(path), *more]))
            wall_s, processor_s, mib = (min(column) for column in zip(*found, strict=True))
            print(
                f"| {length_s:.0f} s | {name} | {wall_s:.1f} | {length_s / wall_s:.1f} "
                f"| {processor_s:.1f} | {mib:.0f} |",
                flush=True,
            )


def main() -> None:
    """Run the verb of the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    verbs = parser.add_subparsers(dest="verb", required=True)
    making = verbs.add_parser("make")
    making.add_argument("session", type=Path)
    making.add_argument("--seconds", type=float, default=60.0)
    measuring = verbs.add_parser("measure")
    measuring.add_argument("paths", type=Path, nargs="+")
    measuring.add_argument("-n", type=int, default=3)
    args = parser.parse_args()
    if args.verb == "make":
        make(args.session, args.seconds)
    else:
        measure(args.paths, args.n)


if __name__ == "__main__":
    main()
