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

from reference.option_effects import NUMBERS_OF_A_CONTACT, RUNS, Run, drawn, lift_muscles, recorded_lift
from reference.processes import until
from tega.errors import TegaError
from tega.hand import joined_level
from tega.records import Intent
from tega.stages.pulses import PulsesMapping, PulsesOptions
from tega.stages.registry import StageRecord, list_stages, stage_class
from tega_learn.decoders import fit

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


def has_effect(group: str, kind: Any, name: str, context: Context) -> bool:
    options = _options(kind, context)
    runs = RUNS[group](kind) if context.runs is None else context.runs
    # Of values that are given and not drawn it is an effect, too, that one of them is refused.
    may_refuse = name in context.given

    def changes(case: tuple[Run, dict[str, Any], Any]) -> bool:
        run, given, other = case
        if given[name] == other:
            return False
        one = _output(kind, run, given)
        if one is None:
            return False
        two = _output(kind, run, given | {name: other})
        return two != one and (two is not None or may_refuse)

    try:
        find(st.tuples(runs, st.fixed_dictionaries(options), options[name]), changes, settings=SEARCH)
    except NoSuchExample:
        return False
    return True


@pytest.mark.parametrize(
    ("stage", "name"), OPTIONS, ids=[f"{stage.group}-{stage.name}-{name}" for stage, name in OPTIONS]
)
def test_an_option_changes_what_its_stage_returns(stage, name, context_of):
    kind: Any = stage_class(stage.group, stage.name)  # type: ignore[arg-type]
    assert has_effect(stage.group, kind, name, context_of(stage)), (
        f"{stage.group} {stage.name}: no two values of {name} change what the stage returns"
    )


def test_an_option_that_changes_nothing_is_found() -> None:
    class More(PulsesOptions, frozen=True):
        idle: float = 1.0

    class Idle(PulsesMapping):
        options_type = More

    assert not has_effect("mapping", Idle, "idle", Context())
    assert has_effect("mapping", Idle, "contact", Context())
