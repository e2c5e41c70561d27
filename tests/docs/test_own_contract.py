"""The contract finds what is wrong with a stage or a driver: each example, with one mistake in it."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from typing import Any

import pytest

from tega.setup.contract import check_driver, check_stage

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
CLOSED = 'raise DeviceUnavailableError("own-emg is not open", "open it first")'
LIMITED = "np.minimum(frame.intensities, self._options.limit)"
UNCUT = "samples = self._received(self._opened_ns)"
BREAKING = [
    ("own_metric", "EmbeddingMetric", "finger=self._setup.finger", 'finger="thumb"', "the one it was made for"),
    ("own_metric", "EmbeddingMetric", 'return {f"pc{number}"', 'return {f"p{number}"', "every value of units"),
    ("own_decoder", "ProportionalDecoder", "self._n += len(samples)", "pass", "however the samples are cut"),
    ("own_decoder", "ProportionalDecoder", "closure=closure", "closure=2 * closure", "closure is 0 to 1"),
    ("own_mapping", "BarsMapping", "return levels", "return levels + 1", "every motor rests"),
    ("own_layout", "SLEEVE16", "SPACING_MM * row)", "SPACING_MM * row) if row else None", "are known, or none"),
    ("own_device/emg", "OwnEmg", CLOSED, "return None", "while closed raises"),
    ("own_device/emg", "OwnEmg", UNCUT, "samples = np.zeros((1, 9))", "one column per channel"),
    ("own_device/emg", "OwnEmg", "self._n_delivered += len(samples)", "pass", "first_index never goes back"),
    ("own_device/vest", "OwnVest", LIMITED, "(frame.intensities + 1)", "only ever lowers"),
]  # fmt: skip

pytestmark = pytest.mark.skipif(not EXAMPLES.is_dir(), reason="not a checkout")


@pytest.mark.parametrize(("file", "name", "right", "wrong", "rule"), BREAKING)
def test_the_contract_finds_what_is_wrong(
    file: str, name: str, right: str, wrong: str, rule: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package, _, part = file.partition("/")
    text = (EXAMPLES / package / "src" / package / f"{part or '__init__'}.py").read_text(encoding="utf-8")
    assert right in text
    path = tmp_path / "wrong.py"
    path.write_text(text.replace(right, wrong), encoding="utf-8")
    spec = importlib.util.spec_from_file_location(f"{package}_wrong", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, spec.name, module)
    spec.loader.exec_module(module)
    made: Any = getattr(module, name)
    with pytest.raises(AssertionError, match=rule):
        check_driver(made, made.options_type()) if part else check_stage(made)
