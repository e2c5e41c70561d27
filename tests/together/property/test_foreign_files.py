"""Files of guests and tools that were damaged, or made on purpose: every reader ends with TEGA's own errors."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference.filmed import packets, write_scene
from reference.guest_readers import GUEST_READERS
from reference.mutated import (
    CHANGE,
    FEW,
    SPOT,
    ends_with_errors_however_mutated,
    ends_with_errors_of_tega,
    mutated,
    odd,
    refuses_a_huge_file,
    refuses_what_is_no_file,
    valid_files,
)
from tega.errors import TegaError
from tega.recording.replay.followed_file import PlayedMoment
from tega.records.bus import Bus
from tega.records.display import DisplayPicture
from tega_scene.played import followed_scene

# What is passed over where it is damaged, so that nothing tells of a pipe there.
_NEEDLESS = {"board of a session", "commands to a session"}
_TOLD = [kind for kind in GUEST_READERS if kind not in _NEEDLESS]
_SMALL = [kind for kind in _TOLD if kind != "recording of a scene"]


@pytest.fixture(scope="module")
def valid(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], bytes]:
    return valid_files(GUEST_READERS, tmp_path_factory)


@pytest.mark.parametrize("kind", GUEST_READERS)
@FEW
@given(changes=st.lists(CHANGE, max_size=4))
def test_whatever_a_file_holds_only_errors_of_tega_come_of_it(kind, valid, changes, tmp_path):
    ends_with_errors_of_tega(GUEST_READERS[kind], mutated(valid(kind), changes), tmp_path)


@pytest.mark.parametrize("kind", _TOLD)
def test_a_pipe_a_device_and_a_socket_are_refused_at_once(kind: str, tmp_path: Path) -> None:
    refuses_what_is_no_file(GUEST_READERS[kind], tmp_path)


@pytest.mark.parametrize("kind", _SMALL)
def test_a_file_larger_than_any_of_its_kind_is_refused_unread(kind: str, tmp_path: Path) -> None:
    refuses_a_huge_file(GUEST_READERS[kind], tmp_path)


@pytest.mark.parametrize("kind", ["ROS 2 pictures", "ROS 2 arrays"])
@pytest.mark.parametrize("n", [60, pytest.param(10_000, marks=pytest.mark.slow)])
def test_a_mutated_bag_ends_with_an_error_of_tega(kind: str, n: int, tmp_path: Path) -> None:
    ends_with_errors_however_mutated(GUEST_READERS[kind], kind, n, tmp_path)


def _scene_at(path: Path) -> None:
    bus = Bus()
    bus.subscribe(DisplayPicture, lambda _one: None)
    file = followed_scene(path, bus, start_ns=0, end_ns=3_000_000_000)
    for n, at_ns in enumerate((0, 1_400_000_000, 300_000_000, 2_900_000_000)):
        file.follow(PlayedMoment(n, at_ns, 0), threading.Event())


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    film = packets([k * 50_000_000 for k in range(40)])
    return write_scene(tmp_path_factory.mktemp("scene") / "scene.mcap", {"front": film, "side": film[:20]})


@FEW
@given(changes=st.lists(CHANGE, max_size=4), spot=SPOT, whole=st.booleans())
def test_a_scene_recording_that_is_odd_is_told_to_be(scene, changes, spot, whole, tmp_path):
    path = tmp_path / "odd.mcap"
    if whole:
        odd(scene, path, spot, changes, {"message"})
    else:
        path.write_bytes(mutated(scene.read_bytes(), changes))
    with contextlib.suppress(TegaError):
        _scene_at(path)
