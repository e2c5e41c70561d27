"""The score of level series against force, and what the presets reach on real recordings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reference.squeezes import squeezes
from tega.errors import CalibrationError, InvalidValueError, ShapeError
from tega.ui.cli.main import main
from tega_learn.compare import Log, compare, two_halves
from tega_learn.score import DecoderFigures, changes_per_second, delay_s, judge, rank_correlation

Scores = dict[str, dict[str, DecoderFigures]]
RECORDINGS = ("v1", "v2", "v8", "v10")


@pytest.fixture(scope="module")
def scores() -> Scores:
    return {one.name: figures(one) for one in map(squeezes, RECORDINGS)}


def figures(log: Log) -> dict[str, DecoderFigures]:
    found = compare(*two_halves(log), ["rules-paper", "rules"])
    return {"paper": found[0].figures, "live": found[1].figures}


def test_live_follows_the_force_over_the_graded_recordings(scores: Scores) -> None:
    assert np.mean([score["live"].level_rank_correlation for score in scores.values()]) >= 0.85


@pytest.mark.parametrize("name", RECORDINGS)
def test_live_is_steady_and_prompt_on_each_graded_recording(name: str, scores: Scores) -> None:
    live, paper = scores[name]["live"], scores[name]["paper"]
    assert live.changes_per_s <= 0.7 < paper.changes_per_s
    assert live.level_delay_s <= 0.150
    assert live.level_rank_correlation >= paper.level_rank_correlation - 0.03


def test_rank_correlation_equals_scipys() -> None:
    stats = pytest.importorskip("scipy.stats", reason="scipy is not installed")
    rng = np.random.default_rng(4)
    for _ in range(20):
        a, b = rng.integers(0, 6, 50), rng.normal(size=50)
        assert rank_correlation(a, b) == pytest.approx(stats.spearmanr(a, b).statistic, abs=1e-14)


def test_a_series_that_never_changes_has_no_correlation_no_delay_and_no_changes() -> None:
    assert np.isnan(rank_correlation([1, 1, 1], [1, 2, 3]))
    assert np.isnan(delay_s([1, 1, 1, 1], [1, 2, 1, 1], 0.1))
    assert changes_per_second([1, 2, 2, 1], 0.5) == 1.0
    assert changes_per_second([3], 0.1) == changes_per_second([], 0.1) == 0.0


@pytest.mark.parametrize("blocks", [-3, -1, 0, 1, 2, 5])
def test_a_shifted_series_is_late_by_the_shift(blocks: int) -> None:
    levels = np.repeat(np.random.default_rng(6).integers(1, 6, 40), 4)
    shifted = np.roll(levels, blocks)
    assert delay_s(shifted, levels, 0.1) == pytest.approx(0.1 * blocks, abs=0.005)


def test_bad_input_is_refused() -> None:
    emg, force = np.random.default_rng(7).normal(size=(400, 3)), np.ones(400)
    with pytest.raises(InvalidValueError, match="never above 0"):
        figures(Log("downwards", emg, -force, 200))
    with pytest.raises(CalibrationError, match="channel 1"):
        figures(Log("flat", np.zeros((400, 3)), force, 200))
    with pytest.raises(ShapeError, match="three blocks"):
        judge([0, 1], [1, 5], [0, 1], 0.1)
    with pytest.raises(ShapeError, match="series"):
        rank_correlation([1, 2], [1, 2, 3])
    with pytest.raises(InvalidValueError, match="block_s"):
        changes_per_second([1, 2], 0.0)
    with pytest.raises(InvalidValueError, match="block_s"):
        delay_s([1, 2], [1, 2], np.nan)


def test_emg_compare_asks_which_columns_are_emg(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "squeeze.csv"
    np.savetxt(file, np.random.default_rng(1).normal(size=(4000, 4)), delimiter=",")
    with pytest.raises(SystemExit) as left:
        main(["emg", "compare", str(file), "--target", "1", "--rate-hz", "200"])
    assert left.value.code == 2
    assert "--target 1 is a column beside the EMG: name that with --channels" in capsys.readouterr().err
