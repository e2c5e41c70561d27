"""Measure what each skip saves, with it and without it in turns, and write the table of docs/evidence/pareto.md.

::

    python -m tega_figures.skipped             # measures, and writes benches/skips.json and the page's table
    python -m tega_figures.skipped --tables    # the table alone, from the committed figures

A row says which scene lets TEGA leave something out, what that is, what the scene takes with and without it, and which
test shows what changes by it.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Final

import click
import msgspec
import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from tega.config.calibration import TouchMaxima
from tega.haptics import FINGERS
from tega.loop.hand import ModelledAllegro
from tega.loop.hand_output import HandOutput
from tega.loop.inbox.stream import PulledStream
from tega.loop.inbox.stuck_frames import is_repeat, kept_picture
from tega.loop.loop import DualLoop
from tega.loop.pacing import Pacer
from tega.loop.touch import TouchLoop
from tega.loop.vest_output import VestOutput
from tega.records import Contact, Intent
from tega.records.bus import Bus
from tega.runtime.clock import ManualClock
from tega.tactile.tracker import TouchTracker
from tega.wire import x40_ble_frame
from tega_figures.bench.machine import describe_machine
from tega_figures.bench.timing import single_threaded, take_turns, timing
from tega_sim.gel import Gel, ball
from tega_sim.seams import Indenter
from tega_sim.trial import TrialPlan, run_trial

PROJECT: Final = Path(__file__).resolve().parents[3]
RESULTS: Final = PROJECT / "benches" / "skips.json"
PAGE: Final = PROJECT / "docs" / "evidence" / "pareto.md"
MINUTE_NS: Final = 60_000_000_000
TOUCH: Final = Contact(
    finger="thumb",
    t_ns=0,
    mass=1.0,
    centroid_xy=(1.0, 1.0),
    spread=1.0,
    threshold=1.0,
    eda=50,
    cci=0.5,
    peak=9.0,
    peak_xy=(1, 1),
    in_contact=True,
)


class SavedWork(msgspec.Struct, frozen=True):
    """One skip.

    Attributes:
        scene: What lets it happen.
        left_out: What is not done then.
        with_us: What the scene takes with the skip, median microseconds.
        without_us: Without it.
        changes: What is another by it.
        shown_by: The tests that show that.
    """

    scene: str
    left_out: str
    with_us: float
    without_us: float
    changes: str
    shown_by: str


class Kept(msgspec.Struct, frozen=True):
    """What was measured, and on which machine."""

    where: str
    skips: list[SavedWork]


class Nowhere:
    """A vest or hand that keeps nothing."""

    def write(self, t_ns: int, what: Any) -> Any:  # noqa: ARG002
        """Take it."""
        return what


class Says(msgspec.Struct, frozen=True):
    """What a skip is said to be; its times are measured."""

    scene: str
    left_out: str
    changes: str
    shown_by: str


def _reading() -> dict[Says, tuple[Callable[[], object], Callable[[], object]]]:
    gel = Gel(5)
    still, pressed = gel.still(), gel.frame([ball(force_n=2.5)], 1)
    rest, touched = TouchTracker(still), TouchTracker(still)
    for k in range(30):
        rest.update(gel.frame([], k))
        touched.update(pressed)
    untouched = gel.frame([], 40)
    copy = pressed.copy()
    last = kept_picture(pressed, TOUCH)
    shown = still.copy()
    shown.flags.writeable = False
    constant = kept_picture(shown, TOUCH)
    loop = TouchLoop({finger: TouchMaxima(cci_max=1.0, eda_max=20_000.0) for finger in FINGERS}, layout="x40")
    for finger in FINGERS:
        loop.update(finger, TOUCH)
    frame, again = loop.frame(1), loop.frame(1)
    return {
        Says(
            "a finger touches nothing (`live`, tracker)",
            "the robust fit of light, depth, outline",
            "nothing while S is far under its threshold; a touch that only the robust fit would see "
            "is detected a little later",
            "`tega-tactile` `tests/tracker.rs`, "
            "`tests/tega_sim/test_sim_touch.py::test_untouched_frames_are_never_contact`",
        ): (partial(rest.update, untouched), partial(touched.update, pressed)),
        Says(
            "a picture under its old number",
            "reading it, telling it, recording it",
            "nothing; counted as `duplicate`",
            "`test_repeats.py::test_a_frame_delivered_again_is_neither_measured_nor_new`",
        ): (lambda: None, partial(touched.update, pressed)),
        Says(
            "a picture with the pixels of the one before",
            "reading it",
            "nothing; counted as `identical`",
            "`test_repeats.py::test_equal_pixels_are_measured_once_and_give_the_same`, "
            "`test_pictures_are_equal_exactly_when_every_pixel_is`",
        ): (partial(is_repeat, copy, last), partial(touched.update, pressed)),
        Says(
            "a picture that is the very array of the one before, in memory that cannot be written",
            "comparing it, reading it",
            "nothing; counted as `identical`",
            "`test_repeats.py::test_a_buffer_that_is_filled_again_is_not_taken_for_a_stuck_sensor`",
        ): (partial(is_repeat, shown, constant), partial(rest.update, untouched)),
        Says(
            "the vest shows this frame already",
            "its packet, and a write to the radio link, which is not in these times",
            "no motor: a frame that stands is renewed every 0.1 s",
            "`test_vest_pace.py::test_a_frame_that_stands_is_renewed_and_what_comes_alike_is_not_sent_beside_it`",
        ): (lambda: bool(again == frame), lambda: x40_ble_frame(frame.x40())),
        Says(
            "a simulated fingertip that nothing touches",
            "rendering its picture",
            "nothing in the lift's tables; the picture has no noise of its own",
            "`test_sim_trial.py::test_a_lift_repeats_bit_for_bit_and_is_the_same_with_every_fingertip_rendered`",
        ): (lambda: shown, partial(gel.frame, [], 41)),
        **_cells(gel, still),
    }


def _cells(
    gel: Gel, still: NDArray[np.uint8]
) -> dict[Says, tuple[Callable[[], object], Callable[[], object]]]:
    """Make both ways of a fingertip that the reading alone sees: its cells' sums read, and its picture."""
    found: dict[Says, tuple[Callable[[], object], Callable[[], object]]] = {}
    for state, pressing in {"untouched": [], "touched": [ball(force_n=2.5)]}.items():
        by_sums, by_picture = TouchTracker(still), TouchTracker(still)
        told = [
            (by_sums.update_sums(gel.sums(pressing, k)), by_picture.update(gel.frame(pressing, k)))
            for k in range(30)
        ]
        if any(repr(sums) != repr(picture) for sums, picture in told) or told[-1][0].in_contact != bool(
            pressing
        ):
            raise SystemExit(f"{state}: the reading of the sums is not that of the picture")
        found[
            Says(
                f"a simulated fingertip that only the reading sees, {state}",
                "painting the picture and summing it",
                "nothing: sums, contacts, and every byte of vest and hand are those of painted pictures",
                "`test_sim_cells.py::test_sums_are_those_of_the_picture_and_are_read_as_it_is`, "
                "`test_what_is_read_by_cells_gives_vest_and_hand_the_bytes_of_painted_pictures`, "
                "`tega-gel` `sums_are_those_of_the_painted_picture`",
            )
        ] = (
            partial(_read_sums, gel, pressing, by_sums),
            partial(_read_picture, gel, pressing, by_picture),
        )
    return found


def _read_sums(gel: Gel, pressing: list[Indenter], tracker: TouchTracker) -> object:
    return tracker.update_sums(gel.sums(pressing, 41))


def _read_picture(gel: Gel, pressing: list[Indenter], tracker: TouchTracker) -> object:
    return tracker.update(gel.frame(pressing, 41))


def _minute(*, emg: bool) -> object:
    contacts = [replace(TOUCH, t_ns=k * 16_666_667) for k in range(3600)]
    blocks = [Intent(t_ns=k * 100_000_000, channels=(2,), level=2) for k in range(1, 600)]
    pacer, bus = Pacer(ManualClock()), Bus()
    touch = TouchLoop({"thumb": TouchMaxima(cci_max=1.0, eda_max=100.0)}, layout="x40")
    loop = DualLoop(
        pacer=pacer,
        touch=touch,
        contacts={"thumb": PulledStream(contacts, end_ns=MINUTE_NS)},
        levels=PulledStream(blocks, end_ns=MINUTE_NS) if emg else None,
        hand=HandOutput(ModelledAllegro(), [Nowhere()], bus=bus),
        vest=VestOutput(touch, [Nowhere()], bus=bus, now_ns=pacer.elapsed_ns),
        bus=bus,
    )
    loop.run()
    return loop


def _timed_us(call: Callable[[], object]) -> float:
    started_ns = time.process_time_ns()
    call()
    return (time.process_time_ns() - started_ns) / 1000


def _whole() -> list[SavedWork]:
    """Measure skips that take a run: processor time, each twice, in turns."""
    plan = TrialPlan(object="container", condition="non-haptic", operator="scripted", seed=3)
    run_trial(plan)
    runs: dict[Says, tuple[Callable[[], object], Callable[[], object]]] = {
        Says(
            "a simulated lift without a vest, as a whole",
            "rendering and reading pictures that are not shown",
            "nothing: the result is the same",
            "`test_sim_trial.py::test_a_trial_whose_pictures_nobody_is_shown_is_the_same_without_them`",
        ): (partial(run_trial, plan), partial(run_trial, plan, skip_untouched=False)),
        Says(
            "no EMG in the settings, a minute of one finger",
            "the hand's ticks every 3 ms",
            "nothing of touch and vest",
            "`test_skips.py::test_without_emg_no_hand_ticks_and_nobody_wakes_for_it`",
        ): (partial(_minute, emg=False), partial(_minute, emg=True)),
    }
    found = []
    for says, (left_out, done) in runs.items():
        times = [(_timed_us(left_out), _timed_us(done)) for _ in range(2)]
        found.append(_skip(says, *(float(v) for v in np.min(times, axis=0))))
    return found


def _skip(says: Says, with_us: float, without_us: float) -> SavedWork:
    return SavedWork(says.scene, says.left_out, with_us, without_us, says.changes, says.shown_by)


def measure(*, budget_s: float) -> list[SavedWork]:
    """Measure every skip; those of a single call in turns, by the wall clock."""
    ways = list(_reading().items())
    calls = {
        f"{number} {way}": call for number, (_, pair) in enumerate(ways) for way, call in enumerate(pair)
    }
    turns = take_turns(calls, budget_s=budget_s)
    median_us = {name: timing(turn).median_us for name, turn in turns.items()}
    return [
        *(_skip(says, median_us[f"{n} 0"], median_us[f"{n} 1"]) for n, (says, _) in enumerate(ways)),
        *_whole(),
    ]


def table(skips: list[SavedWork]) -> str:
    """Make the page's table."""
    lines = [["scene", "left out", "with", "without", "saved", "what changes", "shown by"], ["---"] * 7]
    for skip in skips:
        saved = 100 * (1 - skip.with_us / skip.without_us)
        times = [_time(skip.with_us), _time(skip.without_us), f"{saved:.0f} %"]
        lines.append([skip.scene, skip.left_out, *times, skip.changes, skip.shown_by])
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _time(us: float) -> str:
    if us < 1000:
        return f"{us:.1f} µs"
    return f"{us / 1000:.1f} ms" if us < 100_000 else f"{us / 1000:,.0f} ms"


def page(text: str) -> str:
    """Return the page with the table of the committed figures."""
    kept = msgspec.json.decode(RESULTS.read_bytes(), type=Kept)
    head, found, rest = text.partition("<!-- made: skips -->\n")
    _, end, after = rest.partition("\n<!-- end -->")
    if not found or not end:
        raise SystemExit(f"{PAGE.name} has no part 'skips'")
    return f"{head}{found}\n{table(kept.skips)}\n\nMeasured on {kept.where}.\n{end}{after}"


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--tables", is_flag=True, help="Make the table of the committed figures; measure nothing.")
@click.option("--budget", default=3.0, show_default=True, help="Seconds that timing single calls may take.")
def main(*, tables: bool, budget: float) -> None:
    """Measure unless told not to, then write the page's table."""
    if not tables:
        machine = describe_machine()
        with single_threaded():
            skips = measure(budget_s=budget)
        load = "" if machine.load_per_core is None else f", load {machine.load_per_core:.1f} a core"
        kept = Kept(f"{machine.cpu}, {machine.instruction_set}{load}", skips)
        RESULTS.write_bytes(msgspec.json.format(msgspec.json.encode(kept), indent=1) + b"\n")
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
