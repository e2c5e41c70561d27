"""Files of other programs that are not read, or not without a library, and what is said then."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tega.errors import RecordingError
from tega.runtime.files.formats import OTHERS
from tega.runtime.files.signals import read_signals
from tega.runtime.files.tables.timing import lost_by_counter


def test_formats_that_are_not_read_are_named_with_the_way_out(tmp_path: Path) -> None:
    for ending, (name, route) in OTHERS.items():
        path = tmp_path / f"a{ending}"
        path.write_bytes(b"\x01\x02\x03")
        with pytest.raises(RecordingError) as caught:
            read_signals(path)
        assert caught.value.message == f"a{ending}: {name} is not read as EMG"
        assert caught.value.hint == route


def test_a_missing_library_is_named_with_its_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    from tega.errors import MissingExtraError

    monkeypatch.setitem(sys.modules, "h5py", None)
    (tmp_path / "a.h5").write_bytes(b"\x89HDF\r\n\x1a\n")
    with pytest.raises(MissingExtraError, match=r"needs the package 'h5py'.*pip install 'tega\[formats\]'"):
        read_signals(tmp_path / "a.h5")


def test_a_counter_of_damaged_numbers_proves_no_loss() -> None:
    counter = np.arange(200.0)
    counter[120] = 1e300
    assert lost_by_counter(counter) == []
