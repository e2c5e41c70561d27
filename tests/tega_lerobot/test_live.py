"""A running session as LeRobot observes it: the features of the export, and nothing that is of the past."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from reference.sessions import tree
from tega.config import SessionConfig, check_tree
from tega.errors import ConfigError, DeviceUnavailableError
from tega.hand import JOINT_NAMES
from tega.loop.program import session
from tega.recording.opened import open_recording
from tega_lerobot import live as module
from tega_lerobot.dataset import export_lerobot
from tega_lerobot.live import Live, emg_channel_count, feature_names

pytest.importorskip("pyarrow.parquet", reason="needs the extra tega[lerobot]")
pytest.importorskip("av", reason="needs the extra tega[lerobot]")


class Observed(NamedTuple):
    """What was observed of a session, and its settings, recording and summary."""

    config: SessionConfig
    live: Live
    pictures: dict[str, NDArray[np.uint8]]
    small: dict[str, NDArray[np.uint8]]
    errors: list[str]
    file: Path


@pytest.fixture(scope="module")
def observed(tmp_path_factory: pytest.TempPathFactory) -> Observed:
    folder = tmp_path_factory.mktemp("observed")
    made_up = {"driver": "synthetic-emg", "kind": "raw", "options": {"duration_s": 1.5}}
    config = check_tree(tree(folder) | {"emg": made_up}, {}, base=folder).config
    n_channels = emg_channel_count(config)
    known, other = (feature_names(config, emg_channels=n) for n in (n_channels, n_channels + 1))
    s, errors = session(config), list[str]()
    live = Live(s)

    def fails(call: Callable[..., object], *given: Any, **how: Any) -> None:
        with pytest.raises((ConfigError, DeviceUnavailableError)) as refused:
            call(*given, **how)
        errors.append(str(refused.value))

    fails(live.closure_numbers)
    with s:
        live.wait({"observation.touch": known["observation.touch"]}, ["thumb", "ring"], patience_s=30)
        live.wait({"observation.emg_levels": None}, [], patience_s=30)
        pictures, small = live.pictures(height=320, width=240), live.pictures(height=80, width=60)
        level, closure = live.closure_numbers()
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(module, "_STALE_S", 0.0)
            fails(live.closure_numbers)
            fails(live.pictures, height=80, width=60)
        fails(live.wait, {"observation.emg_levels": other["observation.emg_levels"]}, [], patience_s=30)
        fails(live.wait, {"observation.arm": None}, [], patience_s=30)
        for _ in s:
            pass
    assert 1 <= level <= 5
    assert 0 <= closure <= 1
    return Observed(config, live, pictures, small, errors, folder / s.summary["recording"]["file"])


def test_a_session_is_observed_under_the_names_of_the_export(observed: Observed, tmp_path: Path) -> None:
    export_lerobot([observed.file], tmp_path / "dataset", fps=25)
    exported = json.loads((tmp_path / "dataset" / "meta" / "info.json").read_text())["features"]
    known = feature_names(observed.config, emg_channels=emg_channel_count(observed.config))
    assert known
    assert known == {name: exported[name]["names"] for name in known}
    counters = {"timestamp", "frame_index", "episode_index", "index", "task_index"}
    pictures = {f"observation.images.{finger}" for finger in ("thumb", "ring")}
    assert set(exported) - set(known) == counters | pictures | {"observation.emg"}


def test_the_newest_values_are_those_of_the_recording(observed: Observed) -> None:
    recording, live = open_recording(observed.file), observed.live
    joints = live.numbers(["observation.state"])
    assert list(joints.values()) == pytest.approx(recording["/hand/joints"][-1].angles_rad)
    assert list(joints) == list(JOINT_NAMES)
    forces = live.numbers(["observation.touch_si"])
    for finger in ("thumb", "ring"):
        contact = recording[f"/tactile/{finger}/contact"][-1]
        assert forces[f"{finger}.force_n"] == pytest.approx(contact.force_n or 0.0)
        newest, picture = recording[f"/tactile/{finger}/image"], observed.pictures[finger]
        assert any(np.array_equal(picture[..., ::-1], one) for one in newest)
        assert observed.small[finger].shape == (80, 60, 3)
        assert abs(observed.small[finger].mean() - picture.mean()) < 1


def test_the_past_other_channels_and_what_never_comes_are_errors(observed: Observed) -> None:
    n = emg_channel_count(observed.config)
    for error, text in zip(
        observed.errors,
        (
            "/emg/levels: nothing new",
            "/emg/levels: nothing new",
            r"/tactile/.*/image: nothing new",
            f"the EMG has {n} channels, not {n + 1}; set emg_channels",
            r"run has ended|not yet observed: observation\.arm",
        ),
        strict=True,
    ):
        assert re.search(text, error)
