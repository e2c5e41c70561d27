"""Every format of EMG gives back what another program's writer put into it, and survives damage."""

from __future__ import annotations

import random
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from reference.emg_writers import RATE_HZ, WRITERS, content_of
from reference.mutated import draw_changes, mutated
from tega.errors import TegaError
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
def test_samples_come_back(
    kind: str, seed: int, n_channels: int, n: int, loud: float, tmp_path: Path
) -> None:
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


def _unexpected(kinds: Sequence[str], tmp_path: Path, n_mutants: int) -> list[str]:
    """Return what came of mutants, spread over writers, other than samples or an error of TEGA."""
    rng, wrong = random.Random(f"1 {kinds[0]}"), list[str]()
    # A record of EDF takes a second; text is judged cell by cell, which takes time.
    samples = np.random.default_rng(1).normal(0, 100, (130 if len(kinds) > 1 else 260, 3))
    wholes = {kind: content_of(kind, tmp_path, samples) for kind in kinds}
    for k in range(n_mutants):
        kind = kinds[k % len(kinds)]
        path = tmp_path / f"mutant-{WRITERS[kind].name}"
        columns = WRITERS[kind].channels
        path.write_bytes(mutated(wholes[kind], draw_changes(rng)))
        try:
            found = read_signals(path, Reading(channels=columns(3) if columns else ()))
            assert found.samples.dtype == np.float64
            assert found.samples.ndim == 2
        except TegaError:
            continue
        except Exception as error:
            wrong.append(f"{kind}, mutant {k}: {type(error).__name__}: {error}")
    return wrong


# All that is text goes through one reader; each other format has its own.
_TEXT = [kind for kind, writer in WRITERS.items() if writer.name.endswith((".csv", ".txt", ".lvm", ".gz"))]
_FORMATS = [_TEXT, *([kind] for kind in WRITERS if kind not in _TEXT)]


@pytest.mark.parametrize("kinds", _FORMATS, ids=lambda kinds: kinds[0])
def test_mutants_end_in_samples_or_in_errors_of_tega(kinds: list[str], tmp_path: Path) -> None:
    assert _unexpected(kinds, tmp_path, 50) == []


@pytest.mark.slow
@pytest.mark.parametrize("kinds", _FORMATS, ids=lambda kinds: kinds[0])
def test_ten_thousand_mutants_end_in_samples_or_in_errors_of_tega(kinds: list[str], tmp_path: Path) -> None:
    assert _unexpected(kinds, tmp_path, 10_000) == []
