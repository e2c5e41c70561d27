"""Options of stages drawn by their types, and the stages' output on a recorded lift under them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
from hypothesis import strategies as st

from reference.sessions import Recorded, read_recorded
from tega.config.choose import muscle_setup
from tega.devices.base import EmgChunk, TactileFrame
from tega.haptics import FeltMap
from tega.haptics.motor_layout import SHIPPED
from tega.loop.inbox.sources import chunk_of, frame_of
from tega.records import Contact, EmgSamples, Event, Intent, NamedValue, Picture
from tega.stages.base import FingerSetup, MuscleSetup, ReflexSetup, StageOptions, VestSetup

LIFT = Path(__file__).parents[2] / "examples" / "recorded-lift" / "trial-001.mcap"
TICK_NS = 33_333_333
SHARES = st.floats(0, 1)


class Lift(NamedTuple):
    recorded: Recorded
    frames: list[TactileFrame]
    chunks: list[EmgChunk]


Tick = tuple[int, dict[str, Contact], list[Event]]


@cache
def ticks() -> list[Tick]:
    """Return time, newest contacts and events since, thirty times a second of the lift."""
    recorded = recorded_lift().recorded
    contacts = sorted((one for row in recorded.contacts.values() for one in row), key=lambda c: c.t_ns)
    events, newest, found = list(recorded.of(Event)), dict[str, Contact](), list[Tick]()
    first_ns, last_ns = contacts[0].t_ns, contacts[-1].t_ns
    for t_ns in range(first_ns, last_ns, TICK_NS):
        newest |= {one.finger: one for one in contacts if t_ns - TICK_NS < one.t_ns <= t_ns}
        found.append((t_ns, dict(newest), [one for one in events if t_ns - TICK_NS < one.t_ns <= t_ns]))
    return found


@cache
def recorded_lift() -> Lift:
    raw = read_recorded(LIFT, Picture, EmgSamples)
    frames = [frame_of(one) for one in raw.of(Picture) if one.finger == "thumb"]
    return Lift(read_recorded(LIFT), frames, [chunk_of(one) for one in raw.of(EmgSamples)])


def _number(kind: Any) -> st.SearchStrategy[Any]:
    low = next((bound for bound in (kind.ge, kind.gt) if bound is not None), -1e6)
    high = next((bound for bound in (kind.le, kind.lt) if bound is not None), 1e6)
    if isinstance(kind, msgspec.inspect.IntType):
        return st.integers(int(low), int(high)) | st.integers(int(low), int(min(high, low + 8)))
    # As a person writes them; small ones would not come up where a range goes to a million.
    ranges = [st.floats(low, most) for most in (0.1, 1, 10, 100, high) if low < most <= high]
    return st.one_of(ranges).map(lambda number: round(number, 3)).filter(lambda n: _fits(n, kind))


def _fits(number: float, kind: Any) -> bool:
    return (kind.gt is None or number > kind.gt) and (kind.lt is None or number < kind.lt)


def drawn(kind: msgspec.inspect.Type, texts: Sequence[str] = ()) -> st.SearchStrategy[Any]:
    """Return the values of a type of option; ``texts`` are those of a text without choices."""
    inside = msgspec.inspect
    found: st.SearchStrategy[Any]
    match kind:
        case inside.Metadata():
            found = drawn(kind.type, texts)
        case inside.UnionType():
            found = st.one_of([drawn(one, texts) for one in kind.types])
        case inside.NoneType():
            found = st.none()
        case inside.BoolType():
            found = st.booleans()
        case inside.LiteralType():
            found = st.sampled_from(kind.values)
        case inside.FloatType() | inside.IntType():
            found = _number(kind)
        case inside.TupleType():
            found = st.tuples(*(drawn(one, texts) for one in kind.item_types))
        case inside.VarTupleType():
            found = st.lists(drawn(kind.item_type, texts), max_size=4).map(tuple)
        case inside.StrType() if texts:
            found = st.sampled_from(texts)
        case _:
            raise NotImplementedError(f"a context has to give values of {kind}")
    return found


Run = Callable[[StageOptions], bytes]
"""A stage's run on an input: it is given the options and returns everything that the stage returned."""


def _encoded(outputs: Any) -> bytes:
    return msgspec.json.encode(outputs, enc_hook=lambda one: np.asarray(one).tolist())


@st.composite
def metric_runs(draw: st.DrawFn, kind: Any) -> Run:
    lift = recorded_lift()
    frames = lift.frames if kind.memory else lift.frames[::40]
    setup = FingerSetup("thumb", lift.recorded.head.baselines["thumb"])
    loaded = draw(st.booleans())

    def run(options: StageOptions) -> bytes:
        metric = kind(setup, options)
        metric.loaded = loaded
        return _encoded([metric.update(frame.image, frame.t_ns) for frame in frames])

    return run


def lift_muscles() -> MuscleSetup:
    emg = recorded_lift().recorded.head.calibration.emg
    assert emg is not None
    return muscle_setup(emg, "live")


@st.composite
def decoder_runs(draw: st.DrawFn, kind: Any, setup: MuscleSetup | None = None) -> Run:
    lift, muscles = recorded_lift(), setup or lift_muscles()
    muscles = muscles._replace(preset=draw(st.sampled_from(["paper", "live"])))
    # The same electrodes may give more than at the calibration.
    samples = draw(st.floats(0.5, 8)) * np.concatenate([chunk.samples for chunk in lift.chunks])
    times_ns = (1 + np.arange(len(samples))) * round(1e9 / muscles.rate_hz)

    def run(options: StageOptions) -> bytes:
        block = max(1, round(kind.block_s(options) * muscles.rate_hz))
        decoder = kind(muscles._replace(block=block), options)
        return _encoded([decoder.decode(samples, times_ns), decoder.holds])

    return run


@st.composite
def mapping_runs(draw: st.DrawFn, kind: Any) -> Run:
    """Return runs of a mapping on the lift's contacts and events, on any vest and wearer.

    The events are as certain as drawn: how certain a slip is depends on what the rig reports beside touch.
    """
    lift = recorded_lift()
    layout = draw(st.sampled_from(list(SHIPPED.values())))
    felt = draw(st.none() | st.builds(FeltMap, threshold=st.floats(5, 40), step=st.floats(2, 10)))
    confidence = draw(SHARES)
    maxima = {
        finger: {"cci": max(c.cci for c in contacts) or 1.0, "eda": float(max(c.eda for c in contacts) or 1)}
        for finger, contacts in lift.recorded.contacts.items()
    }
    setup = VestSetup(layout, tuple(maxima), maxima, felt)

    def run(options: StageOptions) -> bytes:
        mapping = kind(setup, options)
        displayed = []
        for t_ns, contacts, events in ticks():
            reported = [msgspec.structs.replace(one, confidence=confidence) for one in events]
            levels = mapping.levels(t_ns, contacts, reported if mapping.wants_events else ())
            displayed.append(np.clip(levels, 0, 100).tobytes())
            displayed.append(
                repr([mapping.columns(finger, one) for finger, one in contacts.items()]).encode()
            )
        return b"".join(displayed)

    return run


@st.composite
def reflex_runs(draw: st.DrawFn, kind: Any) -> Run:
    lift = recorded_lift()
    names = draw(st.sampled_from([(), ("incipient",), ("slip_mm_s",), ("incipient", "slip_mm_s")]))
    most = draw(st.floats(0.2, 20))
    levels = {one.t_ns: float(one.level) for one in lift.recorded.of(Intent)}

    def run(options: StageOptions) -> bytes:
        reflex = kind(ReflexSetup(tuple(lift.recorded.contacts)), options)
        wishes, own = [], 1.0
        for step, (t_ns, contacts, events) in enumerate(ticks()):
            own = next((level for at_ns, level in levels.items() if t_ns - TICK_NS < at_ns <= t_ns), own)
            # A share of the rim that rises and falls, as the grip slips and holds again.
            share = most * (step % 15) / 15
            more = tuple(NamedValue(name, min(share, 1) if name == "incipient" else share) for name in names)
            seen = {f: msgspec.structs.replace(c, more=more) for f, c in contacts.items()}
            reported = [event for event in events if reflex.wants_events]
            wishes.append((reflex.wish(t_ns, own, own, seen, reported), reflex.cause))
        return _encoded(wishes)

    return run


RUNS: Mapping[str, Any] = {
    "metric": metric_runs,
    "decoder": decoder_runs,
    "mapping": mapping_runs,
    "reflex": reflex_runs,
}
NUMBERS_OF_A_CONTACT = tuple(
    field.name
    for field in msgspec.inspect.type_info(Contact).fields  # type: ignore[attr-defined]
    if "Float" in str(field.type) and "Tuple" not in str(field.type)
)
