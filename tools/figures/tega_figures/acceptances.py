"""Accept emulated devices as a person would, and print the reports for docs/evidence/devices.md.

``python -m tega_figures.acceptances OUT thumb emg vest hand tracker dead_man arm`` takes some four minutes; ``franky``
is the arm on franky-sim's robot, in an environment with the extra ``arm-sim``. Whoever answers is this program: it says
"yes, by a program", presses, squeezes, moves and lets go on the emulated devices when it is asked to.
"""

from __future__ import annotations

import sys
import tempfile
import threading
from collections.abc import Callable, Sequence
from pathlib import Path

from tega.config import check_tree, load_config
from tega_bench.acceptance import accept_device, acceptance_case, report_text, write_report
from tega_emulators.emulated_bench import EmulatedBench
from tega_emulators.lab import EmulatedLab, emulated_lab

__all__ = ["main"]

_ANSWER = "yes, by a program"
_LATER_S = 1.0
_SENSING = ("thumb", "emg", "vest", "hand")
_FRANKY = "franky"


class _Program:
    """Answers, and does what is said."""

    def __init__(self, act: Callable[[str], object]) -> None:
        self._act = act

    def say(self, text: str) -> None:
        self._act(text)

    def confirm(self, _text: str) -> bool:
        return True

    def ask(self, text: str) -> str:
        return "emulated" if text.startswith("Which device") else _ANSWER


def _sensing(bench: EmulatedBench, text: str) -> None:
    if text.startswith("Touch"):
        bench.moves.act("press thumb 0.5")
    elif "make a fist" in text:
        bench.moves.act("squeeze 1")
    elif text.startswith("Electrodes"):
        bench.moves.act("rest")


def _leading(lab: EmulatedLab, text: str) -> None:
    cap, headset = lab.cap, lab.headset
    assert headset is not None

    def press() -> None:
        for words in ("press 0", "lift 0", "push 300 0 0 0 0 0", "push 0 0 0 0 0 0"):
            cap.say(words)

    if text.startswith("Move the forearm"):
        threading.Timer(_LATER_S, lambda: headset.say("at 0 1.2 -0.1")).start()
    elif "out of the tracker" in text:
        headset.say("lose")
    elif text.startswith("Bring it back"):
        headset.say("find")
    elif text.startswith("Press and let go"):
        threading.Timer(_LATER_S, press).start()
    elif text.startswith(("Let go of dead-man", "Let go of the dead-man", "hold the dead-man")):
        for button in (0, 1):
            cap.say(f"{'press' if text.startswith('hold') else 'lift'} {button}")


def main(out: Path, names: Sequence[str]) -> None:
    """Accept those that are named, write their reports into a folder, and print them."""
    if wanted := [name for name in names if name in _SENSING]:
        _accept_bench(out, wanted)
    if wanted := [name for name in names if name not in {*_SENSING, _FRANKY}]:
        _accept_lab(out, wanted)
    if _FRANKY in names:
        _accept_lab(out, ["arm"], driver=_FRANKY)


def _accept_bench(out: Path, names: Sequence[str]) -> None:
    with tempfile.TemporaryDirectory() as place, EmulatedBench() as bench:
        file = Path(place) / "lab.toml"
        bench.write_settings(file)
        config = load_config(file, environ={}).config
        for name in names:
            program = _Program(lambda text: _sensing(bench, text))
            report = accept_device(config, acceptance_case(config, name), program, answered=True)
            write_report(report, out)
            print(report_text(report), flush=True)


def _accept_lab(out: Path, names: Sequence[str], *, driver: str = "simulated-arm") -> None:
    with (
        tempfile.TemporaryDirectory() as place,
        emulated_lab(Path(place), vest=False, fingers=(), arm=driver) as lab,
    ):
        config = check_tree(lab.tree, {}, base=Path(place)).config
        assert lab.headset is not None
        lab.go_ahead()  # a device has a processor of its own
        lab.headset.say("at 0 1.2 0")
        for name in names:
            program = _Program(lambda text: _leading(lab, text))
            report = accept_device(config, acceptance_case(config, name), program, answered=True)
            write_report(report, out)
            print(report_text(report), flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
