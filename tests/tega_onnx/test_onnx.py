# mypy: allow-untyped-defs, allow-incomplete-defs, allow-untyped-calls, allow-untyped-decorators
"""ONNX models as metric and decoder: the runtime's own numbers, on time or missing, and hostile files refused."""

from __future__ import annotations

import math
import threading
import time
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

pytest.importorskip("onnxruntime", reason="needs the extra onnx")
pytest.importorskip("onnx", reason="needs the package onnx")

import onnx
import onnxruntime
from onnx import TensorProto

from reference.onnx_models import (
    EMG_CARD,
    EMG_WEIGHTS,
    HEIGHT,
    PICTURE_CARD,
    PICTURE_WEIGHTS,
    WIDTH,
    model,
    written,
)
from reference.sessions import tree
from tega.config import check_tree
from tega.errors import ConfigError
from tega.loop import run_session
from tega.recording.mcap_reader import McapReader
from tega.recording.replay import replay_file
from tega.setup.contract import check_stage
from tega.stages.base import FingerSetup, MuscleSetup
from tega_onnx.decoder import OnnxDecoder, OnnxDecoderOptions
from tega_onnx.metric import OnnxMetric, OnnxMetricOptions
from tega_onnx.model import Ahead, OnnxModel, PictureInput

PICTURES = model(PICTURE_WEIGHTS, [1, 3, HEIGHT, WIDTH])


@pytest.fixture
def picture_files(tmp_path: Path) -> tuple[Path, Path]:
    return written(tmp_path, PICTURES, PICTURE_CARD)


def decoder_options(folder: Path) -> OnnxDecoderOptions:
    file, card = written(folder, model(EMG_WEIGHTS, [1, 3, 100], square=True), EMG_CARD)
    return OnnxDecoderOptions(model=file, card=card, delay_ms=300.0)


def metric_options(files: tuple[Path, Path], **more: Any) -> OnnxMetricOptions:
    return OnnxMetricOptions(model=files[0], card=files[1], outputs={"one": "N", "two": "1"}, **more)


def test_the_metric_gives_the_runtime_s_own_numbers_a_delay_later(picture_files) -> None:
    baseline = np.full((120, 160, 3), 90, np.uint8)
    frames = [baseline + np.uint8(3 * k) for k in range(12)]
    options = metric_options(picture_files, delay_ms=1000.0, every_ms=1.0)
    metric = OnnxMetric(FingerSetup("thumb", baseline), options)
    session = onnxruntime.InferenceSession(picture_files[0].read_bytes())

    def wanted(frame: Any) -> list[float]:
        difference = frame.reshape(HEIGHT, 20, WIDTH, 20, 3).mean((1, 3)) - 90.0
        given = ((difference - [1, 2, 3]) / [10, 20, 30]).transpose(2, 0, 1)[None].astype(np.float32)
        made: list[float] = session.run(None, {"given": given})[0].ravel().tolist()
        return made

    for k, frame in enumerate(frames):
        contact = metric.update(frame, k * 200_000_000)
        assert [(one.name, one.unit) for one in contact.more] == [("one", "N"), ("two", "1")]
        of = frames[k - 5] if k >= 5 else baseline
        assert [one.value for one in contact.more] == pytest.approx(wanted(of), rel=1e-4, abs=1e-4)


def test_both_keep_the_contract_of_a_stage(picture_files, tmp_path: Path) -> None:
    check_stage(OnnxMetric, metric_options(picture_files, delay_ms=1000.0))
    (tmp_path / "emg").mkdir()
    check_stage(OnnxDecoder, decoder_options(tmp_path / "emg"))


def test_the_decoder_gives_the_closure_of_the_window_before_and_holds_on_a_fault(tmp_path: Path) -> None:
    setup = MuscleSetup("raw", 1000.0, 100, ("a", "b", "c"), (10.0, 10.0, 10.0), "live")
    decoder = OnnxDecoder(setup, decoder_options(tmp_path))
    samples = (np.repeat([0.0, 5.0, 10.0], 200) * np.tile([1.0, -1.0], 300))[:, None] * np.ones(3)
    times = np.arange(1, 601) * 1_000_000
    intents = decoder.decode(samples, times)
    assert [one.t_ns // 1_000_000 for one in intents] == list(range(50, 601, 50))
    window = [np.concatenate([np.zeros((100, 3)), samples])[end : end + 100] for end in range(50, 601, 50)]
    closures = [float(np.mean((one / 10) ** 2)) for one in window]
    late = [0.0] * 6  # 0.3 s of windows
    assert [one.closure for one in intents] == pytest.approx([*late, *closures[:-6]], abs=1e-5)
    assert (intents[6].channels, intents[-1].channels) == ((3, 3, 3), (5, 5, 5))
    samples[:100, 1] = np.inf
    faulty = decoder.decode(samples[:100], times[:100] + 600_000_000)
    assert [one.closure for one in faulty] == [intents[-1].closure] * 2
    assert faulty[-1].channels == (1, 0, 1)
    # A delay later comes no result of a window with a fault in it; an offset is no effort.
    full = np.tile(samples[-1:] * [[1], [-1]], (500, 1))
    after = decoder.decode(full, np.arange(701, 1701) * 1_000_000)
    assert [one.closure for one in after] == pytest.approx(
        [closures[5], *closures[9:12], *[1.0] * 16], abs=1e-5
    )
    assert decoder.decode(full[:100] + 512, times[:100] + 1_700_000_000)[-1].channels == (5, 5, 5)
    assert decoder.decode(full[:100] / 2 + 512, times[:100] + 1_800_000_000)[-1].channels == (3, 3, 3)


def test_a_slow_model_never_delays_and_its_late_results_are_missing() -> None:
    going = threading.Event()

    def slow(given: Any) -> Any:
        going.wait(20)
        return given

    ahead = Ahead(slow, np.zeros(1), delay_ms=20.0, every_ms=1.0)
    ahead.give(0, lambda: np.ones(1, np.float32))
    time.sleep(0.03)  # as in real time: the delay has passed, the result is not there
    assert math.isnan(ahead.at(25_000_000)[0])
    assert ahead.n_late == 1
    for k in range(100):
        t_ns = (30 + k) * 1_000_000
        if ahead.wants(t_ns):
            ahead.give(t_ns, lambda: np.ones(1, np.float32))
    assert len(ahead._waiting) == 8  # bounded, however slow it is
    assert not going.is_set()  # all this while the first computation went on
    going.set()


def test_a_run_records_the_model_and_a_replay_gives_the_same(picture_files, tmp_path: Path) -> None:
    options = {"model": str(picture_files[0]), "card": str(picture_files[1]), "delay_ms": 1000.0}
    given = tree(tmp_path / "session") | {
        "stages": {"metric": {"name": "onnx", "options": options | {"outputs": {"one": "N", "two": "1"}}}}
    }
    summary = run_session(check_tree(given, {}, base=tmp_path).config)
    path = tmp_path / "session" / summary["recording"]["file"]
    values = [m.value.more for m in McapReader(path).messages() if m.topic == "/tactile/thumb/contact"]
    assert {one.name for more in values for one in more} == {"one", "two"}
    assert len({more[0].value for more in values}) > 3
    for file in picture_files:
        file.unlink()  # the recording has them
    assert replay_file(path).same


CARDS = {
    "no TOML": "[",
    "another key": PICTURE_CARD + "more = 1\n",
    "no size": '[input]\nkind = "picture"\n[outputs]\none = "N"\n',
    "huge": PICTURE_CARD.replace(f"height = {HEIGHT}", "height = 999999"),
    "no scale": PICTURE_CARD.replace("10.0", "0.0"),
    "other size": PICTURE_CARD.replace(f"height = {HEIGHT}", "height = 7"),
    "other outputs": PICTURE_CARD.replace('two = "1"\n', ""),
    "emg": EMG_CARD,
}


def hostile() -> dict[str, bytes]:
    outside, unknown = (onnx.load_from_string(PICTURES) for _ in range(2))
    weights = outside.graph.initializer[0]
    weights.ClearField("raw_data")
    weights.data_location = TensorProto.EXTERNAL
    weights.external_data.add(key="location", value="/etc/hostname")
    unknown.graph.node[0].op_type = "Launch"
    endless = np.full_like(PICTURE_WEIGHTS, np.inf)
    return {
        "empty": b"",
        "noise": np.random.default_rng(1).bytes(4000),
        "cut": PICTURES[: len(PICTURES) // 2],
        "weights in another file": outside.SerializeToString(),
        "unknown operator": unknown.SerializeToString(),
        "no numbers": model(endless, [1, 3, HEIGHT, WIDTH]),
    }


@pytest.mark.parametrize("name", [*hostile(), *CARDS])
def test_a_hostile_file_and_a_card_that_does_not_fit_are_clear_errors(tmp_path: Path, name: str) -> None:
    files = written(tmp_path, hostile().get(name, PICTURES), CARDS.get(name, PICTURE_CARD))
    where = r"model\.(onnx|toml)" if name in CARDS else r"^model\.onnx: "
    with pytest.raises(ConfigError, match=where) as raised:
        OnnxModel(*files, PictureInput)
    assert len(raised.value.message) <= 500
    assert raised.value.hint


def test_another_file_than_the_card_names_is_refused(tmp_path: Path) -> None:
    setup = FingerSetup("thumb", np.zeros((24, 32, 3), np.uint8))
    with pytest.raises(ConfigError, match="SHA-256"):
        OnnxModel(*written(tmp_path, PICTURES, PICTURE_CARD, sha256="0" * 64), PictureInput)
    with pytest.raises(ConfigError, match="names no model"):
        OnnxMetric(setup, OnnxMetricOptions())
    options = metric_options(written(tmp_path, PICTURES, PICTURE_CARD))
    with pytest.raises(ConfigError, match="the card has"):
        OnnxMetric(setup, msgspec.structs.replace(options, outputs={"one": "mm"}))
