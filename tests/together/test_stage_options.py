"""Every option of every stage changes what the stage returns on a recorded lift, for some values and some context."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, nullcontext
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
import pytest
from hypothesis import Phase, find, settings
from hypothesis import strategies as st
from hypothesis.errors import NoSuchExample

from reference.processes import until
from reference.sessions import Recorded, read_recorded
from tega.config.choose import muscle_setup
from tega.devices.base import EmgChunk, TactileFrame
from tega.errors import TegaError
from tega.hand import joined_level
from tega.haptics import FeltMap
from tega.haptics.motor_layout import SHIPPED
from tega.loop.inbox.sources import chunk_of, frame_of
from tega.records import Contact, EmgSamples, Event, Intent, NamedValue, Picture
from tega.stages.base import FingerSetup, MuscleSetup, ReflexSetup, StageOptions, VestSetup
from tega.stages.pulses import PulsesMapping, PulsesOptions
from tega.stages.registry import StageRecord, list_stages, stage_class
from tega_learn.decoders import fit

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
    """Draw how certain events are: for a slip that depends on what the rig reports beside touch."""
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
            columns = [mapping.columns(finger, one) for finger, one in contacts.items()]
            displayed.append(repr(columns).encode())
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


pytestmark = pytest.mark.slow

STAGES = [record for record in list_stages() if record.group != "layout"]
OPTIONS = [(stage, option.name) for stage in STAGES for option in stage.options]
SEARCH = settings(max_examples=5000, phases=[Phase.generate], derandomize=True, database=None, deadline=None)


class Context(NamedTuple):
    """What a stage needs to run at all: options that no type draws, the first to run with, and runs but its kind's."""

    given: Mapping[str, Sequence[Any]] = {}
    runs: Any = None


def of_models(folder: Path) -> Context:
    """Return two models of the lift's muscles, learned from its own levels, of one person."""
    lift, muscles = recorded_lift(), lift_muscles()
    emg = np.concatenate([chunk.samples for chunk in lift.chunks])
    times_ns = [one.t_ns for one in lift.recorded.of(Intent)]
    levels = [joined_level(one.level, one.closure) for one in lift.recorded.of(Intent)]
    closure = np.interp(np.arange(len(emg)) * 1e6, times_ns, (np.array(levels) - 1) / 4)
    files = []
    for name, target in (("one", closure), ("two", np.sqrt(closure))):
        files.append(folder / f"{name}.json")
        fit(
            np.tile(emg, (2, 1)),
            np.tile(target, 2),
            rate_hz=muscles.rate_hz,
            tau=muscles.block,
            channels=muscles.channels,
            person="p01",
        ).save(files[-1])
    return Context({"model": files, "person": ["p01", "p02"]})


def of_onnx(group: str, folder: Path) -> Context:
    """Return two ONNX models, of pictures or of the lift's muscles, each with a card of the same outputs."""
    pytest.importorskip("onnx", reason="needs the package onnx")
    pytest.importorskip("onnxruntime", reason="needs the extra onnx")
    from reference import onnx_models as made

    card, weights, shape = made.EMG_CARD, made.EMG_WEIGHTS, [1, 3, 100]
    if group == "metric":
        card, weights, shape = made.PICTURE_CARD, made.PICTURE_WEIGHTS, [1, 3, made.HEIGHT, made.WIDTH]
    pairs = []
    for name, factor in (("one", 1.0), ("two", 0.5)):
        (folder / name).mkdir()
        model = made.model(np.float32(factor) * weights, shape, square=group == "decoder")
        pairs.append(made.written(folder / name, model, card))
    files, cards = zip(*pairs, strict=True)
    # On a busy machine a result has to be in time, too.
    given: dict[str, Sequence[Any]] = {"model": files, "card": cards, "delay_ms": [500.0, 300.0]}
    return Context(
        given | ({"outputs": [{"one": "N", "two": "1"}, {"one": "1"}]} if group == "metric" else {})
    )


# It sends a closure with stamps that are 0.6 s old, from a while after it is started.
SENDER = """
import sys, time
import pylsl
time.sleep(float(sys.argv[3]))
info = pylsl.StreamInfo(sys.argv[1], "TEGA", 1, pylsl.IRREGULAR_RATE, "double64", sys.argv[1])
out = pylsl.StreamOutlet(info)
print("ready", flush=True)
while True:
    out.push_sample([float(sys.argv[2])], pylsl.local_clock() - 0.6)
    time.sleep(0.02)
"""


@contextmanager
def sender(name: str, closure: float, after_s: float = 0.0) -> Iterator[None]:
    words = [sys.executable, "-c", SENDER, name, str(closure), str(after_s)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as program:
        try:
            if not after_s and program.stdout is not None:
                program.stdout.readline()
            yield
        finally:
            program.kill()


@contextmanager
def of_programs(kind: Any) -> Iterator[Context]:
    """Run two programs that send a closure; a third starts with each run that looks for it."""
    pytest.importorskip("pylsl", reason="needs the extra lsl")
    one, two, late = (f"tega-test-option-{name}" for name in ("one", "two", "late"))
    lift, muscles = recorded_lift(), lift_muscles()
    samples = np.concatenate([chunk.samples for chunk in lift.chunks])
    times_ns = (1 + np.arange(len(samples))) * round(1e9 / muscles.rate_hz)

    def run(options: Any) -> bytes:
        with sender(late, 0.7, after_s=1.5) if options.stream == late else nullcontext():
            decoder = kind(muscles, options)
            until(lambda: decoder.decode(samples[:1000], times_ns[:1000])[-1].closure > 0)
            return msgspec.json.encode(decoder.decode(samples[1000:], times_ns[1000:]))

    with sender(one, 0.3), sender(two, 0.4):
        yield Context({"stream": [one, two, late], "start_s": [5.0, 0.5]}, st.just(run))


@pytest.fixture(scope="module")
def context_of(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[StageRecord], Context]]:
    with ExitStack() as stack:

        @cache
        def context(group: str, name: str) -> Context:
            kind: Any = stage_class(group, name)  # type: ignore[arg-type]
            if getattr(kind, "outside", False):
                return stack.enter_context(of_programs(kind))
            folder = tmp_path_factory.mktemp(f"{group}-{name}")
            if "card" in kind.options_type.__struct_fields__:
                return of_onnx(group, folder)
            return of_models(folder) if "model" in kind.options_type.__struct_fields__ else Context()

        yield lambda stage: context(stage.group, stage.name)


def _options(kind: Any, context: Context) -> dict[str, st.SearchStrategy[Any]]:
    found = {}
    for field in msgspec.inspect.type_info(kind.options_type).fields:  # type: ignore[attr-defined]
        if field.name in context.given:
            values = context.given[field.name]
            found[field.name] = st.just(values[0]) | st.sampled_from(values)
        else:
            default = field.default if field.default is not msgspec.NODEFAULT else field.default_factory()
            found[field.name] = st.just(default) | drawn(field.type, NUMBERS_OF_A_CONTACT)
            if isinstance(default, tuple):
                found[field.name] |= st.permutations(default).map(tuple)
    return found


def _output(kind: Any, run: Run, options: Mapping[str, Any]) -> bytes | None:
    try:
        return run(kind.options_type(**options))
    except TegaError:
        return None


def has_effect(group: str, kind: Any, name: str, context: Context, search: settings = SEARCH) -> bool:
    options = _options(kind, context)
    runs = RUNS[group](kind) if context.runs is None else context.runs

    def changes(case: tuple[Run, dict[str, Any], Any]) -> bool:
        run, given, other = case
        if given[name] == other:
            return False
        one, two = _output(kind, run, given), _output(kind, run, given | {name: other})
        # Of values that are given and not drawn it is an effect, too, that one of them is refused.
        return one is not None and two != one and (two is not None or name in context.given)

    try:
        find(st.tuples(runs, st.fixed_dictionaries(options), options[name]), changes, settings=search)
    except NoSuchExample:
        return False
    return True


@pytest.mark.parametrize(
    ("stage", "name"), OPTIONS, ids=[f"{stage.group}-{stage.name}-{name}" for stage, name in OPTIONS]
)
def test_an_option_changes_what_its_stage_returns(stage, name, context_of):
    kind: Any = stage_class(stage.group, stage.name)
    assert has_effect(stage.group, kind, name, context_of(stage)), "no two values change what it returns"


def test_an_option_that_changes_nothing_is_found() -> None:
    class More(PulsesOptions, frozen=True):
        idle: float = 1.0

    class Idle(PulsesMapping):
        options_type = More

    assert not has_effect("mapping", Idle, "idle", Context(), settings(SEARCH, max_examples=300))
    assert has_effect("mapping", Idle, "contact", Context())
