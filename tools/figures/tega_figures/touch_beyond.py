"""Tells what the camera sees of loaded contacts that the demo's touch misses, and what telling them would cost.

``python -m tega_figures.touch_beyond`` runs the demo's three lifts and prints a table, a row a finger. A finger is to
be in contact in 98 % of the frames in which it carries 0.5 N; the table says what a lower threshold would tell besides.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import click
import numpy as np
from numpy.typing import NDArray

from tega.config import FINGERS
from tega.tactile.tracker import TouchTracker
from tega_figures.touch_demo import DEMO_OBJECTS, LOAD_N, RELEASE_S
from tega_sim.gel import Gel
from tega_sim.lab import Lab
from tega_sim.lift import Lift
from tega_sim.plan import TrialPlan
from tega_sim.rig import CAMERA_DELAY_NS
from tega_sim.streams import Streams

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tega.stages.base import MeasuredPicture
    from tega_sim.seams import Indenter

__all__ = ["Missed", "Seen", "count_missed"]

MAY_MISS: Final = 0.02
# The world's forces are kept at other times than the pictures.
_LOAD_NOT_KNOWN: Final = False


class Seen(NamedTuple):
    """One frame of a finger: what was so, and what the tracker made of it."""

    t_s: float
    loaded: bool
    """Whether the finger carries 0.5 N or more."""
    touches: bool
    told: bool
    difference: float
    """S, noise units."""
    share: float
    """S over the largest S since the finger was last told to touch nothing; NaN before."""
    changed_px: int
    """Pixels that are other than without this contact, the noise being the same; counted where the frame is missed."""
    changed_counts: int
    """The most that one of them is other by, in any colour."""


class Missed(NamedTuple):
    """What is missed of a finger's loaded frames, and what it would take to tell enough of them."""

    loaded: int
    missed: int
    to_tell: int
    """How many of the missed ones more would have to be told."""
    difference: float
    """The S from which on so many of them would be told; NaN where none has to be."""
    before: float
    """The largest S before the finger's first touch."""
    free: int
    """Untouched frames from 0.1 s after a touch on."""
    free_told: int
    """Those of them whose S is as large as ``difference``."""
    share: float
    """Median of the missed frames' S over the peak of their contact."""
    changed_px: float
    """Median of the pixels that the contact changes in a missed frame."""
    changed_counts: float
    """Median of the most that it changes one of them by."""


class _WatchedGel(Gel):
    """A gel that keeps what pressed it last."""

    pressing: Sequence[Indenter] = ()
    number = 0

    def frame(
        self,
        indenters: Sequence[Indenter],
        index: int,
        *,
        t_s: float | None = None,
        out: NDArray[np.uint8] | None = None,
    ) -> NDArray[np.uint8]:
        self.pressing, self.number = indenters, index
        return super().frame(indenters, index, t_s=t_s, out=out)


class _Misses(Streams):
    """Looks at every picture of one lift with trackers of its own, which say what the loop's do."""

    def __init__(self, lab: Lab, gels: dict[str, _WatchedGel], clean: dict[str, Gel]) -> None:
        super().__init__()
        self._gels, self._clean = gels, clean
        self._trackers = {finger: TouchTracker(lab.baselines[finger]) for finger in FINGERS}
        self._peak = dict.fromkeys(FINGERS, np.nan)
        self._last_ns: dict[str, int] = {}
        self.seen: dict[str, list[Seen]] = {finger: [] for finger in FINGERS}

    def picture_of(self, picture: MeasuredPicture) -> None:
        super().picture_of(picture)
        shown = picture.contact
        finger, t_ns, gel = shown.finger, shown.t_ns, self._gels[shown.finger]
        last_ns = self._last_ns.get(finger)
        self._last_ns[finger] = t_ns
        contact = self._trackers[finger].update(
            picture.image,
            dt_s=None if last_ns is None else (t_ns - last_ns) / 1e9,
            loaded=picture.metric.loaded,
        )
        if contact.in_contact != shown.in_contact:
            raise RuntimeError(f"{finger}: another tracker on the same pictures says something else")
        if contact.in_contact:
            self._peak[finger] = np.fmax(self._peak[finger], contact.difference)
        touches, changed = gel.truth.touches, (0, 0)
        if touches and not contact.in_contact:
            changed = self._changed(finger)
        share = contact.difference / self._peak[finger]
        if not touches and not contact.in_contact:
            self._peak[finger] = np.nan
        t_s = (t_ns - CAMERA_DELAY_NS) / 1e9
        self.seen[finger].append(
            Seen(t_s, _LOAD_NOT_KNOWN, touches, contact.in_contact, contact.difference, share, *changed)
        )

    def _changed(self, finger: str) -> tuple[int, int]:
        """Return how many pixels the contact changes, and by how many counts at most."""
        gel, clean = self._gels[finger], self._clean[finger]
        pressed, free = (clean.frame(shapes, gel.number).astype(np.int16) for shapes in (gel.pressing, ()))
        off = np.abs(pressed - free).max(axis=2)
        return int(np.count_nonzero(off)), int(off.max())


def watch_demo(seed: int = 1) -> dict[str, list[list[Seen]]]:
    """Run the demo's three lifts and return every finger's frames, a list a lift.

    Args:
        seed: Of the person and of all noise; the demo's own is 1.
    """
    lab = Lab(seed, "live")
    seeds = {finger: len(FINGERS) * seed + number for number, finger in enumerate(FINGERS)}
    gels = {finger: _WatchedGel(unit, memory=True) for finger, unit in seeds.items()}
    clean = {finger: Gel(unit) for finger, unit in seeds.items()}
    lab.gels = gels
    lifts: dict[str, list[list[Seen]]] = {finger: [] for finger in FINGERS}
    for name in DEMO_OBJECTS:
        plan, kept = TrialPlan(object=name, seed=seed), _Misses(lab, gels, clean)
        Lift(lab, plan, lab.person(plan), 0, streams=kept).go(
            real_time=False, observer=None, stop=lambda: False, paused=lambda: False
        )
        at_s = kept.array("truth", "t_s")
        for finger, seen in kept.seen.items():
            force_n = np.interp([one.t_s for one in seen], at_s, kept.array("truth", f"{finger}_force_n"))
            lifts[finger].append(
                [one._replace(loaded=bool(n >= LOAD_N)) for one, n in zip(seen, force_n, strict=True)]
            )
    return lifts


def count_missed(lifts: Sequence[Sequence[Seen]]) -> Missed:
    """Count what is missed of a finger's loaded frames, and what a lower threshold would tell.

    Args:
        lifts: Its frames in order of time, a list a lift.
    """
    before, free, loaded = [], [], []
    for seen in lifts:
        touched_s = np.nan
        for one in seen:
            loaded += [one] if one.loaded else []
            if one.touches:
                touched_s = one.t_s
            elif np.isnan(touched_s):
                before.append(one.difference)
            elif one.t_s - touched_s > RELEASE_S + 1e-6:
                free.append(one.difference)
    missed = sorted((one for one in loaded if not one.told), key=lambda one: -one.difference)
    to_tell = max(len(missed) - int(MAY_MISS * len(loaded)), 0)
    difference = missed[to_tell - 1].difference if to_tell else np.nan
    return Missed(
        len(loaded),
        len(missed),
        to_tell,
        difference,
        max(before, default=np.nan),
        len(free),
        int(np.sum(np.array(free) >= difference)),
        *(
            float(np.nanmedian([getattr(one, what) for one in missed])) if missed else np.nan
            for what in ("share", "changed_px", "changed_counts")
        ),
    )


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--seed", type=click.IntRange(0), default=1, show_default=True, help="Of the demo's person.")
def main(seed: int) -> None:
    """Print the table, a row a finger."""
    click.echo("| finger | " + " | ".join(Missed._fields) + " |\n" + "|---" * (1 + len(Missed._fields)) + "|")
    for finger, lifts in watch_demo(seed).items():
        click.echo(f"| {finger} | " + " | ".join(f"{n:.4g}" for n in count_missed(lifts)) + " |")


if __name__ == "__main__":
    main()
