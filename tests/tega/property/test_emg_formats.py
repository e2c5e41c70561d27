"""Every format of EMG gives back what another program's writer put into it, and survives damage."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from reference.emg_writers import RATE_HZ, WRITERS, content_of
from reference.mutated import ends_with_errors_however_mutated
from tega.runtime.files.signals import read_signals
from tega.runtime.files.tables.table import Reading

_FEW = settings(
    max_examples=6,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)


@pytest.mark.parametrize("kind", WRITERS)
@_FEW
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
    "n", [50, pytest.param(1000, marks=pytest.mark.slow), pytest.param(10_000, marks=pytest.mark.deep)]
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
    ends_with_errors_however_mutated(reader, kind, -(-n // n_alike), tmp_path)
