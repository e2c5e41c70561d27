"""Train a small network that reads force from pictures, compare it with a linear model, and write it for TEGA.

Usage: python train.py VIDEOS FORCES --out force.onnx
VIDEOS holds NAME.avi, one press each, untouched at its beginning; FORCES holds NAME_forces.csv with the columns
frame and force_n. Each press is held out in turn; both models are trained on the others. Needs: scikit-learn, onnx,
onnxruntime, opencv-python-headless.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper
from sklearn.linear_model import RidgeCV
from sklearn.neural_network import MLPRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

HEIGHT, WIDTH = 12, 16


def press(video: Path, forces: Path) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    """Return the inputs of a press, float32 (frames, 3 x 12 x 16), and its forces, newtons."""
    reader, frames = cv2.VideoCapture(str(video)), []
    while (read := reader.read())[0]:
        small = cv2.resize(read[1].astype(np.float32), (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
        frames.append(small.transpose(2, 0, 1))
    with forces.open() as file:
        rows = [(int(row["frame"]), float(row["force_n"])) for row in csv.DictReader(file)]
    used = [(frames[k], force) for k, force in rows if k < len(frames) and np.isfinite(force)]
    untouched = np.median(frames[:3], axis=0)
    x = np.stack([(frame - untouched) / 255.0 for frame, _ in used]).astype(np.float32)
    return x.reshape(len(x), -1), np.array([force for _, force in used])


def linear() -> Any:
    """Return the baseline: a ridge regression on the same pixels."""
    return make_pipeline(StandardScaler(), RidgeCV(np.logspace(-1, 5, 13)))


def network() -> Any:
    """Return the network: one layer of 32 rectified units."""
    layers = MLPRegressor(
        hidden_layer_sizes=(32,), alpha=1.0, early_stopping=True, max_iter=2000, random_state=0
    )
    return make_pipeline(StandardScaler(), layers)


def write(model: Any, out: Path, made: str) -> None:
    """Write the network as ONNX with the scaling in its first layer, and its card."""
    scaler, layers = model[0], model[1]
    first, second = layers.coefs_
    arrays = {
        "w1": first / scaler.scale_[:, None],
        "b1": layers.intercepts_[0] - (scaler.mean_ / scaler.scale_) @ first,
        "w2": second,
        "b2": layers.intercepts_[1],
    }
    nodes = [
        helper.make_node("Flatten", ["picture"], ["x"]),
        helper.make_node("Gemm", ["x", "w1", "b1"], ["h"]),
        helper.make_node("Relu", ["h"], ["r"]),
        helper.make_node("Gemm", ["r", "w2", "b2"], ["force"]),
    ]
    graph = helper.make_graph(
        nodes,
        "force",
        [helper.make_tensor_value_info("picture", TensorProto.FLOAT, [1, 3, HEIGHT, WIDTH])],
        [helper.make_tensor_value_info("force", TensorProto.FLOAT, [1, 1])],
        [numpy_helper.from_array(array.astype(np.float32), name) for name, array in arrays.items()],
    )
    whole = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    onnx.checker.check_model(whole)
    data = whole.SerializeToString()
    out.write_bytes(data)
    out.with_suffix(".toml").write_text(
        f'sha256 = "{hashlib.sha256(data).hexdigest()}"\nlicence = "not for distribution"\nmade = "{made}"\n\n'
        f'[input]\nkind = "picture"\nheight = {HEIGHT}\nwidth = {WIDTH}\n\n[outputs]\nmodel_force = "N"\n'
    )


def main() -> None:
    """Compare both models on held-out presses, and write the network trained on all of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("videos", type=Path)
    parser.add_argument("forces", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    forces = {path.name.removesuffix("_forces.csv"): path for path in given.forces.rglob("*_forces.csv")}
    presses = {
        path.stem: press(path, forces[path.stem])
        for path in sorted(given.videos.rglob("*.avi"))
        if path.stem in forces
    }
    if len(presses) < 2:
        parser.error(
            f"{len(presses)} videos of {given.videos} have forces in {given.forces}; two presses are needed"
        )
    kinds = {"mean force": None, "linear": linear, "network": network}
    errors: dict[str, list[float]] = {name: [] for name in kinds}
    for held, (x, y) in presses.items():
        others = [pair for name, pair in presses.items() if name != held]
        rest, targets = (np.concatenate(part) for part in zip(*others, strict=True))
        for name, make in kinds.items():
            predicted = (
                np.full(len(y), targets.mean()) if make is None else make().fit(rest, targets).predict(x)
            )
            errors[name].append(float(np.sqrt(np.mean((predicted - y) ** 2))))
        row = "  ".join(f"{name} {errors[name][-1]:5.2f} N" for name in kinds)
        print(f"{held:28} n = {len(y):3}  RMSE: {row}")
    wins = sum(a < b for a, b in zip(errors["network"], errors["linear"], strict=True))
    means = {name: float(np.mean(one)) for name, one in errors.items()}
    print(
        f"mean over {len(presses)} held-out presses: " + ", ".join(f"{k} {v:.2f} N" for k, v in means.items())
    )
    better = min(means, key=lambda name: means[name])
    print(f"the network is better in {wins} of {len(presses)} presses; lowest mean error: {better}")
    everything, targets = (np.concatenate(part) for part in zip(*presses.values(), strict=True))
    made = f"{len(presses)} presses, {len(targets)} pictures; held-out RMSE {means['network']:.2f} N"
    write(network().fit(everything, targets), given.out, made)


if __name__ == "__main__":
    main()
