"""Files that were damaged or made on purpose end with TEGA's own errors; formats of EMG give back what was written."""

from __future__ import annotations

import contextlib
import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reference.emg_writers import RATE_HZ, WRITERS, content_of
from reference.foreign_readers import READERS, npy, toml
from reference.mutated import (
    CHANGE,
    FEW,
    SPOT,
    ends_with_errors_however_mutated,
    mutated,
    odd,
    refuses_a_huge_file,
    refuses_what_is_no_file,
)
from tega.config import load_config
from tega.errors import RecordingError, TegaError
from tega.recording.inspection import inspect_file
from tega.recording.opened import open_recording
from tega.recording.replay import replay_file
from tega.recording.replay.play import play_file
from tega.records import EmgSamples
from tega.records.bus import Bus
from tega.records.display import DisplayPicture
from tega.runtime.files.foreign_file import load_npy
from tega.runtime.files.signals import read_signals
from tega.runtime.files.tables.table import Reading
from tega.stages.base import MeasuredPicture

# What is passed over where it is damaged, so that nothing tells of a pipe there.
_NEEDLESS = {"summary of a run", "unfinished calibration"}
_TOLD = [kind for kind in READERS if kind not in _NEEDLESS]


@pytest.mark.parametrize("kind", READERS)
def test_whatever_a_file_holds_only_errors_of_tega_come_of_it(kind: str, tmp_path: Path) -> None:
    ends_with_errors_however_mutated(READERS[kind], tmp_path)


@pytest.mark.parametrize("kind", _TOLD)
def test_a_pipe_a_device_and_a_socket_are_refused_at_once(kind: str, tmp_path: Path) -> None:
    refuses_what_is_no_file(READERS[kind], tmp_path)


@pytest.mark.parametrize("kind", _TOLD)
def test_a_file_larger_than_any_of_its_kind_is_refused_unread(kind: str, tmp_path: Path) -> None:
    refuses_a_huge_file(READERS[kind], tmp_path)


def test_the_mark_before_utf_8_is_passed_over(tmp_path: Path) -> None:
    path = tmp_path / "lab.toml"
    path.write_bytes(b"\xef\xbb\xbf" + toml().replace(b"\n", b"\r\n"))
    assert load_config(path, environ={}).config.session.preset == "paper"


def test_an_array_that_is_larger_than_its_file_asks_for_no_memory() -> None:
    data = npy(np.zeros((2, 3)))
    forged = data.replace(b"(2, 3)", b"(9999999999, 9999)", 1)
    forged = forged[:8] + (len(forged) - 48 - 10).to_bytes(2, "little") + forged[10:]
    with pytest.raises(RecordingError, match=r"not an \.npy array"):
        load_npy(forged, "emg.npy")
    objects = npy(np.zeros((2, 3)))
    with pytest.raises(RecordingError, match="Python objects"):
        load_npy(objects.replace(b"'<f8'", b"'|O' "), "emg.npy")


# A recording is valid by its format and still can hold anything: records are changed before they are written.


def _looked_at(path: Path) -> None:
    """Play a recording as fast as it goes while somebody looks at its pictures and samples."""
    from tega.config import check_tree

    bus = Bus()
    for kind in (MeasuredPicture, EmgSamples, DisplayPicture):
        bus.subscribe(kind, lambda _one: None)
    out = path.parent / "played"
    shutil.rmtree(out, ignore_errors=True)
    play_file(
        path, check_tree({"session": {"out_dir": str(out)}}, {}, base=path.parent).config, speed=None, bus=bus
    )


def _opened(path: Path) -> None:
    recording = open_recording(path)
    repr(recording)
    for name, topic in recording.items():
        if name.endswith(("/contact", "/samples", "/state")):
            topic.to_numpy()
        elif name.endswith("/image") and len(topic):
            topic[len(topic) // 2]


@settings(parent=FEW, max_examples=settings().max_examples // 4)
@given(
    spot=SPOT,
    changes=st.lists(CHANGE, min_size=1, max_size=3),
    kinds=st.sets(st.sampled_from(["attachment", "table", "message", "name", "time"]), max_size=2),
)
def test_a_recording_that_is_odd_is_told_to_be(short, spot, changes, kinds, tmp_path):
    path = tmp_path / "odd.mcap"
    if kinds:
        odd(short, path, spot, changes, kinds)
    else:
        path.write_bytes(mutated(short.read_bytes(), changes))
    for use in (inspect_file, replay_file, _looked_at, _opened):
        with contextlib.suppress(TegaError):
            use(path)


_MEDIA = [
    "stack npy", "stack npz", "video AV1", "video H.264", "video VP9", "BORIS project", "BORIS project packed",
    "BORIS table", "BORIS aggregated", "ELAN", "annotations",
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("kind", _MEDIA)
@pytest.mark.parametrize("n", [250, pytest.param(10_000, marks=pytest.mark.deep)])
def test_a_file_that_is_mutated_often_ends_with_an_error_of_tega(kind: str, n: int, tmp_path: Path) -> None:
    ends_with_errors_however_mutated(READERS[kind], tmp_path, n)


@pytest.mark.parametrize("kind", WRITERS)
@settings(FEW, max_examples=6)
@given(
    seed=st.integers(0, 2**32 - 1),
    n_channels=st.integers(2, 5),
    n=st.integers(260, 400),
    loud=st.floats(1, 900),
)
def test_samples_come_back(kind, seed, n_channels, n, loud, tmp_path):
    writer = WRITERS[kind]
    samples = np.random.default_rng(seed).normal(0, loud, (n, n_channels)).clip(-3000, 3000)
    path = tmp_path / writer.name
    writer.write(path, samples)
    found = read_signals(path, Reading(channels=writer.channels(n_channels) if writer.channels else ()))
    assert found.rate_hz == (RATE_HZ if writer.rate else None)
    assert found.decision.faults == []
    if not writer.step:
        np.testing.assert_array_equal(found.samples, samples)
        return
    assert len(found.samples) > n - RATE_HZ
    given_back = found.samples if kind != "WAV" else found.samples / 10
    step = writer.step if kind != "WAV" else 0.1
    assert np.abs(given_back - samples[: len(found.samples)]).max() <= step


# All that is text goes through one reader; each other format has its own.
_TEXT = [kind for kind, writer in WRITERS.items() if writer.name.endswith((".csv", ".txt", ".lvm", ".gz"))]


@pytest.mark.parametrize(
    "n", [50, pytest.param(250, marks=pytest.mark.slow), pytest.param(10_000, marks=pytest.mark.deep)]
)
@pytest.mark.parametrize("kind", WRITERS)
def test_mutants_end_in_samples_or_in_errors_of_tega(kind: str, n: int, tmp_path: Path) -> None:
    writer, n_alike = WRITERS[kind], len(_TEXT) if kind in _TEXT else 1
    # A record of EDF takes a second; text is judged cell by cell, which takes time.
    samples = np.random.default_rng(1).normal(0, 100, (130 if n_alike > 1 else 260, 3))

    def read(path: Path) -> None:
        found = read_signals(path, Reading(channels=writer.channels(3) if writer.channels else ()))
        assert found.samples.dtype == np.float64
        assert found.samples.ndim == 2

    reader = (writer.name, lambda folder: content_of(kind, folder, samples), read)
    ends_with_errors_however_mutated(reader, tmp_path, -(-n // n_alike))
