"""The score of level series against force, and what the presets reach on real recordings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reference.squeezes import squeezes
from tega.emg import Preset
from tega.errors import CalibrationError, InvalidValueError, ShapeError
from tega.ui.cli.main import main
from tega_learn.score import DecoderFigures, changes_per_second, delay_s, rank_correlation, score_recording

Scores = dict[str, dict[Preset, DecoderFigures]]
RECORDINGS = ("v1", "v2", "v8", "v10")


@pytest.fixture(scope="module")
def scores() -> Scores:
    return {
        one.name: score_recording(one.samples, one.target, 200, tau=20) for one in map(squeezes, RECORDINGS)
    }


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


def test_a_force_counted_downwards_is_followed_the_other_way_round() -> None:
    force = np.tile(np.repeat([0.5, 2.0, 0.5, 1.0], 400), 2)
    emg = (force * np.where(np.arange(3200) // 2 % 2, 1.0, -1.0))[:, None]
    up, down = (score_recording(emg, sign * force, 200, tau=20)["live"] for sign in (1, -1))
    assert up.level_rank_correlation > 0.85
    assert down.level_rank_correlation == pytest.approx(-up.level_rank_correlation)


def test_bad_input_is_refused() -> None:
    emg, force = np.random.default_rng(7).normal(size=(400, 3)), np.zeros(400)
    with pytest.raises(ShapeError, match="one force a sample"):
        score_recording(emg, force[:-1], 200, tau=20)
    with pytest.raises(ShapeError, match="at least 3"):
        score_recording(emg, force, 200, tau=100)
    with pytest.raises(CalibrationError, match="channel 1"):
        score_recording(np.zeros((400, 3)), force, 200, tau=20)
    with pytest.raises(ShapeError, match="series"):
        rank_correlation([1, 2], [1, 2, 3])
    with pytest.raises(InvalidValueError, match="block_s"):
        changes_per_second([1, 2], 0.0)
    with pytest.raises(InvalidValueError, match="block_s"):
        delay_s([1, 2], [1, 2], np.nan)


def test_emg_score_asks_which_columns_are_emg(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "squeeze.csv"
    np.savetxt(file, np.random.default_rng(1).normal(size=(4000, 4)), delimiter=",")
    with pytest.raises(SystemExit) as left:
        main(["emg", "score", str(file), "--force", "1", "--rate-hz", "200"])
    assert left.value.code == 2
    assert "--force 1 is a column beside the EMG: name that with --channels" in capsys.readouterr().err
