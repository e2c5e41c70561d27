"""Wire a loop in a test, with outputs of the test's own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tega.loop.hand import Hand, ModelledAllegro
from tega.loop.inbox.stream import Stream
from tega.loop.loop import DualLoop
from tega.loop.outputs import HandOutput, VestOutput
from tega.loop.pacing import Pacer
from tega.loop.reflex import ReflexArc
from tega.loop.snapshot import Moments
from tega.loop.touch import TouchLoop
from tega.records import Contact, Intent
from tega.records.bus import Bus


def wired_loop(
    pacer: Pacer,
    touch: TouchLoop,
    *,
    contacts: Mapping[str, Stream[Contact]],
    levels: Stream[Intent] | None = None,
    vests: Sequence[Any] = (),
    hands: Sequence[Any] = (),
    bus: Bus | None = None,
    reflex: ReflexArc | None = None,
    poll_hand: Any = None,
    **vest: Any,
) -> DualLoop:
    """Return a loop with a modelled hand.

    Args:
        pacer: Deadlines.
        touch: The back loop.
        contacts: Stream of each finger.
        levels: Stream of intents.
        vests: Sinks of vest frames.
        hands: Sinks of the hand's frames.
        bus: Bus of the run; a new one where none is given.
        reflex: Reflex of the hand.
        poll_hand: Looks at hand and arm.
        vest: Options of the vest's output.
    """
    bus = Bus() if bus is None else bus
    hand: Hand = ModelledAllegro()
    return DualLoop(
        pacer=pacer,
        touch=touch,
        contacts=contacts,
        levels=levels,
        hand=HandOutput(hand, hands, bus=bus, reflex=reflex),
        vest=VestOutput(touch, vests, bus=bus, now_ns=pacer.elapsed_ns, **vest),
        bus=bus,
        moments=Moments(
            bus, None if levels is None else hand, complete=[] if reflex is None else [reflex.displayed]
        ),
        poll_hand=poll_hand,
    )
