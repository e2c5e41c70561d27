"""A task of two places, scored from poses: the true ones of simulated trials, with noise as a camera has it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.typing import NDArray

from tega.ui.cli.main import cli
from tega_scene.outcomes import SceneOutcome, score_scene

pytest.importorskip("cv2")
pytest.importorskip("tega_figures")
pytest.importorskip("mujoco")

from reference.scene import noisy_track
from tega.stages.events.outcomes import STABLE_S
from tega_figures.scene.bench import bench_layout
from tega_figures.scene.trials import TrueTrial, true_trial
from tega_sim.operator.motor import AWAY_M
from tega_sim.plan import TrialPlan
from tega_sim.score import ON_MARK_M, REST_M_S
from tega_sim.trial import run_trial
from tega_sim.world.world import World


@pytest.fixture(scope="module")
def carried() -> TrueTrial:
    """Return what truly happens when an object is carried to the second mark."""
    return true_trial(
        TrialPlan(object="bag", condition="non-haptic", seed=3, operator="scripted", task="place")
    )


@pytest.fixture(scope="module")
def mark_m(carried: TrueTrial) -> NDArray[np.float64]:
    return World(carried.spec, seed=0).mark_m(AWAY_M)[:2]


def scored(trial: TrueTrial, mark_m: NDArray[np.float64], *, end_s: float | None = None) -> SceneOutcome:
    x, y = mark_m.tolist()
    return score_scene(noisy_track(trial), bench_layout(trial), end_s=end_s, mark_m=(x, y))


@pytest.mark.slow
def test_what_is_carried_to_the_second_mark_is_placed_as_far_from_it_as_in_truth(
    carried: TrueTrial, mark_m: NDArray[np.float64]
) -> None:
    outcome, reported = scored(carried, mark_m), run_trial(carried.plan)
    assert reported.off_mark_m is not None
    assert outcome.off_mark_m is not None
    assert outcome.off_mark_error_m is not None
    assert (outcome.on_mark, outcome.success) == (reported.placed, reported.success) == (True, True)
    assert abs(outcome.off_mark_m - reported.off_mark_m) < min(0.001, 3 * outcome.off_mark_error_m)
    kinds = {event.kind: event for event in outcome.events}
    # True rest: from the last moment off the table, or farther than 2 mm from where it stays.
    base = carried.object[:, :2, 3]
    moving = np.hypot(*(base - base[-1]).T) > REST_M_S * STABLE_S
    aloft = np.array([truth.lift_off for truth in carried.truths])
    since_s = float(carried.t_s[np.flatnonzero(moving | aloft)[-1]])
    assert abs(kinds["placed"].t_s - since_s - STABLE_S) < 0.05
    assert kinds["put_down"].t_s < kinds["placed"].t_s
    assert kinds["put_down"].size_m == kinds["placed"].size_m == outcome.off_mark_m
    assert outcome.rest is not None
    assert outcome.rest.let_go
    assert outcome.rest.lean_deg < 1


@pytest.mark.slow
def test_what_stands_beside_the_mark_is_not_placed_and_without_a_mark_nothing_is_said_of_one(
    carried: TrueTrial, mark_m: NDArray[np.float64]
) -> None:
    beside = scored(carried, mark_m + np.array([0.0, ON_MARK_M + 0.01]))
    assert beside.off_mark_m is not None
    assert beside.off_mark_m > ON_MARK_M
    assert (beside.on_mark, beside.success) == (False, False)
    without = score_scene(noisy_track(carried), bench_layout(carried))
    assert (without.on_mark, without.off_mark_m, without.success) == (None, None, True)
    for outcome in (beside, without):
        assert "placed" not in {event.kind for event in outcome.events}
        assert "put_down" in {event.kind for event in outcome.events}


@pytest.mark.slow
def test_what_is_held_yet_or_aloft_is_not_placed(carried: TrueTrial, mark_m: NDArray[np.float64]) -> None:
    put_s = next(event.t_s for event in scored(carried, mark_m).events if event.kind == "put_down")
    aloft = scored(carried, mark_m, end_s=put_s - 0.5)
    assert (aloft.rest, aloft.off_mark_m, aloft.on_mark) == (None, None, False)
    held = scored(carried, mark_m, end_s=put_s + 0.5)
    assert held.rest is not None
    assert (held.rest.let_go, held.on_mark) == (False, False)


@pytest.mark.slow
def test_what_leans_is_not_placed(carried: TrueTrial, mark_m: NDArray[np.float64]) -> None:
    """Tipped over its rim by 30° when the hand goes."""
    turn, thing = np.radians(30), carried.object.copy()
    gone = carried.t_s > 12.0
    thing[gone, :, :3] = np.array(
        [[1, 0, 0], [0, np.cos(turn), -np.sin(turn)], [0, np.sin(turn), np.cos(turn)]]
    )
    thing[gone, 2, 3] += np.sin(turn) * carried.spec.diameter_m / 2
    outcome = scored(carried._replace(object=thing), mark_m)
    assert outcome.rest is not None
    assert outcome.rest.lean_deg == pytest.approx(30, abs=1)
    assert outcome.on_mark is False


@pytest.mark.parametrize(
    ("mark", "text"),
    [
        ("50", "write it as"),
        ("a,b", "write it as"),
        ("nan,0", "not a place"),
        ("0,inf", "not a place"),
        ("900,900", "not on"),
    ],
)
def test_the_verb_refuses_such_a_mark_before_it_looks_at_a_video(
    tmp_path: Path, mark: str, text: str
) -> None:
    words = f"scene score {tmp_path / 'a.mp4'} --lens a.json --layout a.toml --mark {mark}"
    done = CliRunner().invoke(cli, words)
    assert done.exit_code != 0
    assert text in done.output + str(done.exception)
