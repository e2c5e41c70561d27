"""Small ONNX models with their cards, for pictures and for EMG."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
from onnx import TensorProto, helper, numpy_helper

HEIGHT, WIDTH = 6, 8
_RNG = np.random.default_rng(5)
PICTURE_WEIGHTS = _RNG.standard_normal((3 * HEIGHT * WIDTH, 2)).astype(np.float32)
EMG_WEIGHTS = np.full((3 * 100, 1), 1 / 300, np.float32)


def model(weights: Any, shape: list[int], *, square: bool = False) -> bytes:
    """Return a model: the input, flattened, times the weights."""
    nodes = [
        *([helper.make_node("Mul", ["given", "given"], ["m"])] if square else []),
        helper.make_node("Flatten", ["m" if square else "given"], ["x"]),
        helper.make_node("MatMul", ["x", "w"], ["made"]),
    ]
    graph = helper.make_graph(
        nodes,
        "g",
        [helper.make_tensor_value_info("given", TensorProto.FLOAT, shape)],
        [helper.make_tensor_value_info("made", TensorProto.FLOAT, [1, weights.shape[1]])],
        [numpy_helper.from_array(weights, "w")],
    )
    whole = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    data: bytes = whole.SerializeToString()
    return data


def written(folder: Path, data: bytes, card: str, sha256: str = "") -> tuple[Path, Path]:
    files = folder / "model.onnx", folder / "model.toml"
    files[0].write_bytes(data)
    files[1].write_text(
        f'sha256 = "{sha256 or hashlib.sha256(data).hexdigest()}"\nlicence = "MIT"\nmade = "by a test"\n{card}'
    )
    return files


PICTURE_CARD = (
    f'[input]\nkind = "picture"\nheight = {HEIGHT}\nwidth = {WIDTH}\nmean = [1.0, 2.0, 3.0]\n'
    'scale = [10.0, 20.0, 30.0]\n[outputs]\none = "N"\ntwo = "1"\n'
)
EMG_CARD = '[input]\nkind = "emg"\nchannels = 3\nrate_hz = 1000.0\nwindow = 100\nstep = 50\n[outputs]\nclosure = "1"\n'
