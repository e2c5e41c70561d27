"""A running session as LeRobot observes it: the features of the export, and nothing that is of the past."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from reference.sessions import tree
from tega.config import SessionConfig, check_tree
from tega.errors import ConfigError, DeviceUnavailableError
from tega.loop.program import session
from tega.recording.opened import open_recording
from tega_lerobot import live as module
from tega_lerobot.dataset import export_lerobot
from tega_lerobot.live import Live, emg_channel_count, feature_names

pytest.importorskip("pyarrow.parquet", reason="needs the extra tega[lerobot]")
pytest.importorskip("av", reason="needs the extra tega[lerobot]")


@pytest.fixture
def config(tmp_path: Path) -> SessionConfig:
    made_up = {"driver": "synthetic-emg", "kind": "raw", "options": {"duration_s": 1.5}}
    return check_tree(tree(tmp_path / "session") | {"emg": made_up}, {}, base=Path.cwd()).config


def test_a_session_is_observed_under_the_names_of_the_export(config: SessionConfig, tmp_path: Path) -> None:
    with session(config) as s:
        for _ in s:
            pass
    path = tmp_path / "session" / s.summary["recording"]["file"]
    export_lerobot([path], tmp_path / "dataset", fps=25)
    exported = json.loads((tmp_path / "dataset" / "meta" / "info.json").read_text())["features"]
    known = feature_names(config, emg_channels=emg_channel_count(config))
    assert known
    assert known == {name: exported[name]["names"] for name in known}
    counters = {"timestamp", "frame_index", "episode_index", "index", "task_index"}
    pictures = {f"observation.images.{finger}" for finger in ("thumb", "ring")}
    assert set(exported) - set(known) == counters | pictures | {"observation.emg"}


def test_the_newest_values_are_those_of_the_recording(config: SessionConfig, tmp_path: Path) -> None:
    s = session(config)
    live = Live(s)
    known = feature_names(config, emg_channels=emg_channel_count(config))
    with s:
        live.wait({"observation.touch": known["observation.touch"]}, ["thumb", "ring"], patience_s=30)
        pictures = live.pictures(height=320, width=240)
        small = live.pictures(height=80, width=60)
        for _ in s:
            pass
    recording = open_recording(tmp_path / "session")
    joints = live.numbers(["observation.state"])
    last = recording["/hand/joints"][-1].angles_rad
    assert list(joints.values()) == pytest.approx(last)
    assert list(joints) == known["observation.state"]
    forces = live.numbers(["observation.touch_si"])
    for finger in ("thumb", "ring"):
        contact = recording[f"/tactile/{finger}/contact"][-1]
        assert forces[f"{finger}.force_n"] == pytest.approx(contact.force_n or 0.0)
        newest = recording[f"/tactile/{finger}/image"]
        assert any(np.array_equal(pictures[finger][..., ::-1], picture) for picture in newest)
        assert small[finger].shape == (80, 60, 3)
        assert abs(small[finger].mean() - pictures[finger].mean()) < 1


def test_the_past_is_an_error(config: SessionConfig, monkeypatch: pytest.MonkeyPatch) -> None:
    s = session(config)
    live = Live(s)
    with pytest.raises(DeviceUnavailableError, match="/emg/levels: nothing new"):
        live.closure_numbers()
    with s:
        live.wait({"observation.emg_levels": None}, ["thumb"], patience_s=30)
        level, closure = live.closure_numbers()
        assert 1 <= level <= 5
        assert 0 <= closure <= 1
        monkeypatch.setattr(module, "_STALE_S", 0.0)
        with pytest.raises(DeviceUnavailableError, match="/emg/levels: nothing new"):
            live.closure_numbers()
        with pytest.raises(DeviceUnavailableError, match=r"/tactile/.*/image: nothing new"):
            live.pictures(height=80, width=60)


def test_another_number_of_channels_is_an_error_that_says_what_to_set(config: SessionConfig) -> None:
    n_channels = emg_channel_count(config)
    wrong = feature_names(config, emg_channels=n_channels + 1)
    s = session(config)
    live = Live(s)
    text = f"the EMG has {n_channels} channels, not {n_channels + 1}; set emg_channels"
    with s, pytest.raises(ConfigError, match=text):
        live.wait({"observation.emg_levels": wrong["observation.emg_levels"]}, [], patience_s=30)


def test_what_never_comes_is_named(config: SessionConfig) -> None:
    s = session(config)
    live = Live(s)
    with s, pytest.raises(DeviceUnavailableError, match=r"run has ended|not yet observed: observation\.arm"):
        live.wait({"observation.arm": None}, [], patience_s=30)
