"""The pure parts of a calibration: the ladder, presses, gels, records."""

from __future__ import annotations

import re
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference.kept import NOW, muscles, worn
from reference.scripted import touching
from tega.config.calibration.records import read_record, write_record
from tega.config.calibration.wearing import column_sites, judge_wearing
from tega.config.person_settings import felt_by
from tega.haptics import FeltMap, vest_frame
from tega.loop.maxima import block_length, touch_maxima
from tega.setup.calibration.gel import compare_gels, judge_rest
from tega.setup.calibration.presses import PRESSES, PressMeter
from tega.setup.calibration.staircase import LEVEL_PERCENT, TOP_LEVEL, Ladder, highest_level
from tega.wire import vest_levels

LEVELS = st.integers(1, TOP_LEVEL)
SITES = column_sites("x40")
# Up to the ceiling two at a time, down from two above, up from two below, and one question about nothing.
MOST_QUESTIONS = 8 + 16 + 16 + 1


@given(ceiling=LEVELS, answers=st.lists(st.booleans(), min_size=MOST_QUESTIONS, max_size=MOST_QUESTIONS))
def test_the_ladder_ends_and_never_asks_above_its_ceiling(ceiling: int, answers: list[bool]) -> None:
    ladder = Ladder(ceiling)
    requested = []
    for felt in answers:
        if ladder.level is None:
            break
        requested.append(ladder.level)
        ladder.answer(felt=felt)
    assert ladder.level is None
    assert 0 <= min(requested) <= max(requested) <= ceiling
    assert requested.count(0) <= 1
    found = ladder.result()
    assert found.n_trials == len(requested)
    assert found.level is None or 1 <= found.level <= ceiling


@given(ceiling=LEVELS, threshold=st.integers(1, TOP_LEVEL + 1))
def test_the_ladder_finds_a_sure_person_s_threshold(ceiling: int, threshold: int) -> None:
    ladder = Ladder(ceiling)
    while (level := ladder.level) is not None:
        ladder.answer(felt=level >= threshold)
    assert ladder.result().level == (threshold if threshold <= ceiling else None)
    assert ladder.result().n_false == 0


@given(st.integers(0, 100))
def test_percentages_are_those_of_the_motors_levels(percent: int) -> None:
    level = highest_level(percent)
    assert LEVEL_PERCENT[level] <= percent
    assert level == TOP_LEVEL or LEVEL_PERCENT[level + 1] > percent
    assert vest_levels([LEVEL_PERCENT[level]] * 40).tolist() == [level] * 40


@given(
    st.lists(st.integers(2000, 12000), min_size=PRESSES, max_size=PRESSES),
    st.integers(-1, PRESSES - 1),
    st.integers(0, 2),
)
def test_maxima_are_of_the_firm_presses_and_no_spike_decides(sizes, spiked, weak) -> None:
    meter, t_ns = PressMeter(76_800), 0
    for n, size in enumerate([500] * weak + sizes):
        # One frame is ten times too large.
        frames = [10 * size if n - weak == spiked and k == 50 else size for k in range(120)]
        for eda in (*frames, *[0] * 20):
            found = touching(eda, t_ns=t_ns)
            meter.take({"live": found, "paper": found})
            t_ns += 16_000_000
    assert len(meter.presses) == PRESSES + weak
    assert 500 not in [p.eda_px for p in meter.firm]
    middle = float(np.median(sizes))
    assert len(meter.firm) == sum(size >= middle / 2 for size in sizes)
    assert bool(meter.problems()) == (len(meter.firm) < PRESSES)
    maximum = touch_maxima(meter.frames("live")).eda_max
    assert maximum is not None
    assert min(sizes) <= maximum <= max(sizes)


@given(seed=st.integers(0, 2**16), shift=st.integers(-30, 30), side=st.integers(0, 20))
def test_a_gel_s_shift_and_its_dark_spot_are_told_apart(seed: int, shift: int, side: int) -> None:
    random = np.random.default_rng(seed)
    then = random.integers(100, 140, (120, 160, 3)).astype(np.uint8)
    now = (then.astype(int) + shift).astype(np.uint8)
    now[40 : 40 + side, 60 : 60 + side] -= 50
    change = compare_gels(now, then, noise_now=3.0, noise_then=3.0, when="then")
    assert change.shift == (shift, shift, shift)
    assert change.wear == change.dark_px / (120 * 160)  # nothing is brighter
    assert abs(change.dark_px - side**2) <= 4 * side + 4
    if side > 7:
        (column,) = re.findall(r"a dark spot of \d+ pixels at \((\d+), ", " ".join(change.words))
        assert 60 <= int(column) < 60 + side
    assert any("counts" in words for words in change.words) == (abs(shift) > 1.9 * 3.0)


@given(seed=st.integers(0, 2**16), noise=st.floats(1.5, 4.0), drift=st.floats(-10, 10))
def test_noise_is_measured_and_a_light_that_changes_is_told(seed: int, noise: float, drift: float) -> None:
    random = np.random.default_rng(seed)
    pictures = [
        np.clip(110 + drift * k / 29 + random.normal(0, noise, (48, 64, 3)), 0, 255).round().astype(np.uint8)
        for k in range(30)
    ]
    rest = judge_rest(pictures)
    assert abs(max(rest.noise) - noise) < 0.25
    if abs(drift) < 2.5:
        assert not rest.problems
    if abs(drift) > 4:
        assert any("light still changes" in message for message in rest.problems)


@given(st.permutations(SITES), st.sets(st.sampled_from(SITES), max_size=3))
def test_judging_places_takes_any_answer(answers: list[str], unfelt: set[str]) -> None:
    message = {
        displayed: "n" if displayed in unfelt else a for displayed, a in zip(SITES, answers, strict=True)
    }
    wearing = judge_wearing(message, "x40")
    assert wearing.n_asked == 8
    assert wearing.n_right == sum(displayed == a for displayed, a in message.items())
    assert any("not felt at all" in p for p in wearing.notes) == bool(unfelt)


def test_places_named_right_or_by_a_neighbour_are_no_problem() -> None:
    assert not judge_wearing({s: s for s in SITES}, "x40").notes
    assert not judge_wearing({**{s: s for s in SITES}, "f2": "f1", "b3": "b4"}, "x40").notes
    mirrored = {s: f"{s[0]}{5 - int(s[1])}" for s in SITES}
    assert judge_wearing(mirrored, "x40").notes == ('front and back felt mirrored: set vest.mirror = "all"',)
    exchanged = {s: f"{'fb'[s[0] == 'f']}{s[1]}" for s in SITES}
    assert judge_wearing(exchanged, "x40").notes == (
        "front and back are felt exchanged: is the vest on the right way round?",
    )


def again(record: Any) -> Any:
    """Return a record as it is read from the file that was written."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "record.toml"
        write_record(record, path)
        assert list(Path(folder).iterdir()) == [path]
        return read_record(path, type(record))


PERCENT = st.floats(0.1, 60) | st.just(-1.0)
TEXT = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)


@given(st.lists(PERCENT, min_size=8, max_size=8), st.lists(PERCENT, min_size=8, max_size=8), TEXT)
def test_a_vest_record_is_read_as_written_and_makes_a_map(threshold, step, note) -> None:
    record = worn(notes=(note,), sites=SITES, threshold_percent=tuple(threshold), step_percent=tuple(step))
    assert again(record) == record
    if max(threshold) < 0:
        return
    thresholds, steps = felt_by(record)
    felt = FeltMap(threshold=thresholds, step=steps).apply(vest_frame([1] * 4, [1] * 4, layout="x40"))
    for k, t in enumerate(threshold[:4]):
        if t > 0:
            assert felt.intensities[k] >= round(t) - 1


@given(st.lists(st.floats(1e-6, 1e6), min_size=3, max_size=3), TEXT, st.none() | st.just(NOW))
def test_an_emg_record_is_read_as_written(numbers, text, refreshed) -> None:
    three = tuple(numbers)
    record = muscles(
        settings=text,
        muscles=("ECR", "FCU", text),
        offset=three,
        live_max=three,
        answers=(three,) * 3,
        refreshed=refreshed,
    )
    assert again(record) == record


@pytest.mark.parametrize(("rate_hz", "n"), [(10.0, 1), (200.0, 20), (1000.0, 100), (1259.3, 126)])
def test_a_block_lasts_100_ms_where_no_decoder_says_otherwise(rate_hz: float, n: int) -> None:
    assert block_length(rate_hz) == n
