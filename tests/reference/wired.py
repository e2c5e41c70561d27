"""Wire a loop in a test, with outputs of the test's own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tega.config.calibration import TouchMaxima
from tega.loop.hand import ModelledAllegro
from tega.loop.inbox.stream import Stream
from tega.loop.loop import DualLoop
from tega.loop.outputs import HandOutput, VestOutput
from tega.loop.pacing import Pacer
from tega.loop.reflex import ReflexArc
from tega.loop.snapshot import Moments
from tega.loop.touch import TouchLoop
from tega.records import Contact, Intent
from tega.records.bus import Bus
from tega.runtime.clock import ManualClock

FULL = TouchMaxima(cci_max=1.0, eda_max=100.0)


def wired_loop(
    pacer: Pacer | None = None,
    touch: TouchLoop | None = None,
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
    """Return a loop with a modelled hand; ``vests`` and ``hands`` are sinks, ``vest`` options of the vest's output.

    By default it is paced by a manual clock, and touch has 32 motors and the maxima :data:`FULL`.
    """
    pacer = pacer or Pacer(ManualClock())
    touch = touch or TouchLoop(dict.fromkeys(contacts, FULL), layout="paper32")
    bus = Bus() if bus is None else bus
    hand, displayed = ModelledAllegro(), [] if reflex is None else [reflex.displayed]
    return DualLoop(
        pacer=pacer,
        touch=touch,
        contacts=contacts,
        levels=levels,
        hand=HandOutput(hand, hands, bus=bus, reflex=reflex),
        vest=VestOutput(touch, vests, bus=bus, now_ns=pacer.elapsed_ns, **vest),
        bus=bus,
        moments=Moments(bus, None if levels is None else hand, complete=displayed),
        poll_hand=poll_hand,
    )
