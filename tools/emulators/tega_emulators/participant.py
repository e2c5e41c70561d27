"""Rehearse a command on the emulated bench: a made-up participant does at each prompt what it asks for.

``python -m tega_emulators.participant calibrate lab.toml --person p01`` beside ``tega-teleop init --emulated --out
lab.toml``. Everything the command says is printed, and after it what was done. ``practice`` and ``study run --lab``
go likewise; in a study the participant lifts, and the experimenter's keys are pressed too. Presses, thresholds, lifts
and answers are chances of ``--seed``: they say nothing about people.
"""

from __future__ import annotations

import argparse
import json
import random
import re
import socket
import string
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import IO, Any, Final

from tega.config.calibration.wearing import column_sites, site_motors
from tega.errors import DeviceUnavailableError, InvalidValueError
from tega.runtime.child_process import python_command, python_environment

__all__ = ["History", "Participant", "Reach", "Wearer", "main"]

_HOLD_S, _LET_GO_S = 0.6, 0.5
_TRIES: Final = 4
KEYS: Final = string.ascii_lowercase[:21]
"""A key for each of the 21 marks of a scale."""


class Reach:
    """Moves the running emulated bench whose settings file, by ``tega-teleop init --emulated``, this is."""

    def __init__(self, settings: Path) -> None:
        beside = settings.with_suffix("") / "moves.json"
        try:
            port = json.loads(beside.read_text(encoding="utf-8"))["port"]
            self._socket = socket.create_connection(("127.0.0.1", port), timeout=30.0)
        except (OSError, ValueError, KeyError):
            raise DeviceUnavailableError(
                f"no emulated bench runs for {settings}", f"tega-teleop init --emulated --out {settings}"
            ) from None
        self._file = self._socket.makefile("rw", encoding="utf-8", newline="\n")
        self._saying = threading.Lock()

    def __call__(self, line: str) -> dict[str, Any]:
        """Make a move of :meth:`tega_emulators.bench_moves.Moves.act`."""
        with self._saying:
            self._file.write(line + "\n")
            self._file.flush()
            sentence: dict[str, Any] = json.loads(self._file.readline() or '{"error": "the bench has gone"}')
        if "error" in sentence:
            raise InvalidValueError(sentence["error"], "see tega_emulators.bench_moves.MOVES")
        return sentence


class Participant:
    """Does what lines of a command ask for; what takes time goes on in a thread.

    ``move`` moves the bench; ``seed`` is of thresholds, firmness, lifts and answers.
    """

    def __init__(self, move: Callable[[str], dict[str, Any]], seed: int = 0) -> None:
        self._move = move
        self._chance = random.Random(seed)
        threshold = {site: self._chance.choice((9, 12, 15)) for site in column_sites("x40")}
        self._wearer = Wearer(lambda: move("vest")["history"], threshold)
        self._seen = "", ""
        self._n_tries = 0

    def receive(self, line: str, type_keys: Callable[[str], None]) -> None:
        """Take in a line of the command's standard error, and do and type what it asks for.

        ``type_keys`` types a line.
        """
        if line.startswith(">"):
            self._n_tries = 0
            self._get_ready(line)
            if "[Enter]" in line:
                type_keys("")
        elif line.startswith("?"):
            type_keys(self._answer(line))
        elif line.startswith("["):
            self._study(line, type_keys)
        elif re.match(r"ok|   squeeze \d+: let go", line):
            self._move("rest")
        elif found := re.search(r"\btarget \S+ ([\d.]+)", line):
            self._move(f"squeeze {min(1.0, max(0.0, (float(found[1]) - 1) / 4.5)):.2f}")

    def _get_ready(self, line: str) -> None:
        if "take everything off" in line:
            self._move("release")
        elif found := re.search(r"> (\w+): press firmly", line):
            shape = "flat" if "flat" in line else "round"
            threading.Thread(target=self._press, args=(found[1], shape), daemon=True).start()
        elif "a fist" in line:
            self._move(f"squeeze {self._chance.uniform(0.95, 1.0):.2f}")
        elif found := re.search(r"> \D*(\d+) sits on", line):
            self._move(f"squeeze 0.5 {found[1]}")
        else:
            self._move("rest")

    def _press(self, finger: str, shape: str) -> None:
        time.sleep(_LET_GO_S)
        for firmness in (0.85, 0.9, 1.0):
            self._move(f"press {finger} {firmness - self._chance.uniform(0, 0.05):.2f} {shape}")
            time.sleep(_HOLD_S)
            self._move("release")
            time.sleep(_LET_GO_S)

    def _answer(self, line: str) -> str:
        if "what now?" in line:
            self._n_tries += 1
            return "a" if self._n_tries < _TRIES else "q"
        return self._wearer(line) or ""

    def _study(self, line: str, type_keys: Callable[[str], None]) -> None:
        phase, _, heading = line[1:].partition("]")
        if (phase, heading) == self._seen:
            return
        same, self._seen = phase == self._seen[0], (phase, heading)
        if phase == "questions":
            type_keys(self._chance.choice(KEYS) if " · question " in heading else "")
        elif same:
            return
        elif phase == "ready":
            self._move("rest")
            type_keys("")
        elif phase == "trial":
            threading.Thread(target=self._lift, args=(type_keys,), daemon=True).start()

    def _lift(self, type_keys: Callable[[str], None]) -> None:
        """Squeeze, lift to the mark and hold, with a slip now and then; the keys are the experimenter's."""
        strength = self._chance.uniform(0.35, 0.8)
        for wait_s, key in ((self._chance.uniform(0.8, 2.0), " "), (self._chance.uniform(0.8, 1.5), " ")):
            self._move(f"squeeze {strength:.2f}")
            time.sleep(wait_s)
            type_keys(key)
            if self._chance.random() < 0.3:
                type_keys(self._chance.choice("sd"))
        time.sleep(1.5)
        self._move("rest")


def main(arguments: list[str] | None = None) -> None:
    """Run a command of ``tega-teleop`` with a participant at its prompts; exit as it does."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "words", nargs=argparse.REMAINDER, help="of tega-teleop: calibrate lab.toml --person p01"
    )
    given = parser.parse_args(arguments)
    settings = next((Path(word) for word in given.words if word.endswith(".toml")), None)
    if settings is None:
        parser.error("name the settings file of an emulated bench, such as: calibrate lab.toml --person p01")
    try:
        participant = Participant(Reach(settings), given.seed)
    except DeviceUnavailableError as error:
        parser.error(f"{error.message}; start it: {error.hint}")
    process = subprocess.Popen(
        python_command("tega.ui.cli", *given.words),
        stdin=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        encoding="utf-8",
        env=python_environment(),
    )
    assert process.stdin is not None
    assert process.stderr is not None
    typed = process.stdin
    saying = threading.Lock()

    def type_keys(keys: str) -> None:
        with saying:
            _type(typed, keys)

    try:
        for line in process.stderr:
            print(line, end="", file=sys.stderr, flush=True)  # noqa: T201  # what the command says
            participant.receive(line.rstrip("\n"), type_keys)
        code = process.wait()
    except KeyboardInterrupt:  # the command has had it too
        for line in process.stderr:
            print(line, end="", file=sys.stderr, flush=True)  # noqa: T201
        code = process.wait()
    sys.exit(code)


def _type(typed: IO[str], keys: str) -> None:
    try:
        typed.write(keys + "\n")
        typed.flush()
    except OSError:
        return  # the command has ended


History = list[tuple[float, list[int]]]
"""Every change of the 40 motors: seconds, then percent."""


class Wearer:
    """A made-up wearer of the vest.

    ``history`` returns what the motors did so far. ``threshold`` is the lowest percent that is felt, by
    column, ``step`` the smallest increase in percent that is noticed, ``mirrored`` whether the back is felt
    mirrored. ``requested`` are the columns that vibrated before each question, ``loudest`` the highest
    percent so far.
    """

    def __init__(
        self,
        history: Callable[[], History],
        threshold: Mapping[str, int],
        *,
        step: int = 13,
        mirrored: bool = False,
    ) -> None:
        self._history = history
        self._threshold = threshold
        self._step = step
        self._mirrored = mirrored
        self._n_seen = len(history())
        self._n_again = 0
        self.requested: list[str] = []
        self.loudest = 0

    def __call__(self, prompt: str) -> str | None:
        """Answer one prompt, ``> …`` or ``? …``; ``q`` to a question that is not about the vest."""
        if prompt.startswith(">"):
            return ""
        bursts = self._bursts()
        self.requested += [site for site, _ in bursts[:1]]
        n_due, self._n_again = (2 if "stronger" in prompt else 1), self._n_again + 1
        # What a busy machine swallowed is asked for once more, as a person would; a silent trial stays silent.
        if len(bursts) != n_due and self._n_again < 3:
            return "r"
        self._n_again = 0
        if "Where" in prompt:
            site = bursts[0][0] if bursts else "n"
            return f"b{5 - int(site[1])}" if self._mirrored and site[0] == "b" else site
        if "Felt" in prompt:
            return "y" if bursts and bursts[0][1] >= self._threshold[bursts[0][0]] else "n"
        if "stronger" in prompt:
            (_, first), (_, second) = bursts if len(bursts) == 2 else [("", 0)] * 2
            return "s" if abs(first - second) < self._step else "12"[second > first]
        return "q"

    def _bursts(self) -> list[tuple[str, int]]:
        """What vibrated since the last question: column and percent, one each."""
        history = self._history()
        new, self._n_seen = history[self._n_seen :], len(history)
        bursts: list[tuple[str, int]] = []
        dark = True
        for _, motors in new:
            lit = {k for k, v in enumerate(motors) if v}
            self.loudest = max(self.loudest, *motors)
            if lit and dark:
                (site,) = [s for s in column_sites("x40") if lit == set(site_motors(s, "x40"))]
                bursts.append((site, max(motors)))
            dark = not lit
        return bursts


if __name__ == "__main__":
    main()
