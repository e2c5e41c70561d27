"""The hand as commanded stands beside the hand as measured: where the joints are led to, at the palm that is drawn."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reference.parts import observed

pytest.importorskip("viser", reason="needs the extra view")


from tega.config import check_tree
from tega.hand import CLOSURE_POSES_RAD
from tega.loop import run_session
from tega.loop.hand import ModelledAllegro
from tega.records.bus import Bus
from tega.ui.view.browser import BrowserView
from tega.ui.view.browser.feed import SessionFeed
from tega.ui.view.browser.hand_figure import STANDING, HandFigure
from tega.ui.view.state import ViewState

PALM = np.array([0.3, -0.2, 0.5, np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0])


def completed(folder: Path) -> list[ViewState]:
    """Run a second of muscles that are generated, and return what the page is given of it."""
    emg = {"driver": "synthetic-emg", "kind": "raw", "options": {"seed": 1, "duration_s": 3.0}}
    config = check_tree({"session": {"pace": "fast"}, "emg": emg}, {}, base=folder).config
    bus, seen = Bus(), []
    feed = SessionFeed({}, bus)
    run_session(
        config,
        bus=observed(lambda loop: seen.append(feed.complete(ViewState(loop.t_ns, loop))), bus),
        parts=[feed],
    )
    return seen


def test_a_hand_tells_where_it_steers_to_before_it_is_there() -> None:
    hand = ModelledAllegro()
    for _ in range(60):
        hand.step(5)
    target = hand.target_rad
    assert target is not None
    route = CLOSURE_POSES_RAD[4] - CLOSURE_POSES_RAD[0]
    assert (target - hand.angles_rad) @ route > 0.01
    for _ in range(1500):
        hand.step(5)
    np.testing.assert_allclose(np.array(hand.target_rad), CLOSURE_POSES_RAD[4], atol=1e-9)


def test_a_run_s_moments_tell_it_and_where_the_palm_is_drawn(tmp_path: Path) -> None:
    seen = completed(tmp_path)
    moved = [s for s in seen if s.loop.target_rad is not None]
    assert len(moved) > 80
    gaps = [np.abs(np.array(s.loop.target_rad) - np.array(s.loop.angles_rad)).max() for s in moved]
    assert max(gaps) > 0.02
    for state in moved:
        np.testing.assert_array_equal(state.palm, STANDING)


def test_a_figure_goes_where_its_palm_goes() -> None:
    figure = HandFigure()
    standing, led = figure.poses(CLOSURE_POSES_RAD[2]), figure.poses(CLOSURE_POSES_RAD[2], PALM)
    apart = np.linalg.norm(standing[:, None, :3] - standing[None, :, :3], axis=2)
    np.testing.assert_allclose(np.linalg.norm(led[:, None, :3] - led[None, :, :3], axis=2), apart, atol=1e-8)
    # What was up is along the world's x: the palm was turned by a right angle about y.
    route = standing[:, :3] - STANDING[:3]
    np.testing.assert_allclose(
        led[:, :3] - PALM[:3], np.stack([route[:, 2], route[:, 1], -route[:, 0]], 1), atol=1e-8
    )


def test_in_the_simulated_world_both_hands_coincide_where_the_command_is_what_is_measured() -> None:
    pytest.importorskip("mujoco", reason="the simulated world needs the extra sim")
    from tega_sim.world import World

    world, figure = World("bottle", seed=1), HandFigure()
    shapes, poses = world.shapes(), world.poses()
    ours = figure.poses(world.angles_rad, world.palm_row)
    for finger in ("thumb", "index", "middle", "ring"):
        (there,) = (row for shape, row in zip(shapes, poses, strict=True) if shape[0] == f"{finger}_pad")
        (here,) = (row for shape, row in zip(figure.shapes, ours, strict=True) if shape[0] == f"{finger}_pad")
        np.testing.assert_allclose(here[:3], there[:3], atol=1e-4)


def test_the_page_draws_it_while_there_is_a_command(tmp_path: Path) -> None:
    state: Any = next(s for s in completed(tmp_path) if s.loop.target_rad is not None)
    with BrowserView(port=0) as view:
        for k in range(3):
            view.page.paint(state, turn=k, rates_hz={}, latency_ms={})
        names = [handle.name for handle, _ in view.page.scene.ghost.solids.batches]
        assert names == ["/commanded/ball", "/commanded/tube"]
        view.page.paint(
            state._replace(loop=state.loop._replace(target_rad=None)), turn=0, rates_hz={}, latency_ms={}
        )
        assert view.page.scene.ghost.solids.batches == []
