"""Record demonstrations on the emulated bench, train ACT on them, and let the policy close the hand; draw the rollout.

    python -m tega_figures.lerobot_policy policy --picture docs/images/lerobot-rollout.png

Every step is LeRobot's own program, with the options of docs/lerobot.md; needs LeRobot 0.4 and the plug-in. What is in
the folder already is kept, so that a rollout can be repeated.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

EXAMPLE: Final = Path(__file__).resolve().parents[3] / "examples" / "lerobot" / "person.py"
TASK: Final = "close the hand while the thumb is touched"
TOUCHED_N: Final = 0.05
CLOSED: Final = 0.25
WITHIN_S: Final = 2.0
"""A press is followed if the closure passes :data:`CLOSED` within this time, before the release; a release likewise."""

_HEIGHT, _WIDTH = 40, 30
_ROBOT: Final = (
    "--robot.type=tega",
    "--robot.settings=lab.toml",
    f"--robot.height={_HEIGHT}",
    f"--robot.width={_WIDTH}",
    "--robot.observe=[state, touch_si]",
)
_TELEOP: Final = ("--teleop.type=tega", "--teleop.settings=lab.toml")
_DATASET: Final = (
    "--dataset.push_to_hub=false",
    f"--dataset.single_task={TASK}",
    "--dataset.reset_time_s=0",
    "--dataset.fps=10",
    "--dataset.vcodec=h264",
    "--play_sounds=false",
)
_POLICY: Final = {
    "type": "act",
    "device": "cpu",
    "push_to_hub": "false",
    "pretrained_backbone_weights": "null",
    "use_vae": "false",
    "dim_model": "128",
    "n_heads": "4",
    "dim_feedforward": "512",
    "n_encoder_layers": "2",
    "chunk_size": "10",
    "n_action_steps": "2",
    "optimizer_lr": "3e-4",
    "optimizer_lr_backbone": "3e-4",
}


class Episodes(NamedTuple):
    """Frames of a dataset.

    Attributes:
        time_s: float64 (n,), in the frame's episode.
        episode: int64 (n,).
        force_n: float64 (n,), at the thumb.
        closure: float64 (n,), of the action.
        joint_rad: float64 (n,), first joint of the index finger.
    """

    time_s: NDArray[np.float64]
    episode: NDArray[np.int64]
    force_n: NDArray[np.float64]
    closure: NDArray[np.float64]
    joint_rad: NDArray[np.float64]


def read_episodes(root: Path) -> Episodes:
    """Read a dataset of LeRobot."""
    from pyarrow import parquet

    names = json.loads((root / "meta" / "info.json").read_text())["features"]["observation.state"]["names"]
    table = parquet.read_table(root / "data" / "chunk-000" / "file-000.parquet")
    state = np.array(table["observation.state"].to_pylist())
    return Episodes(
        np.array(table["timestamp"]),
        np.array(table["episode_index"]),
        state[:, names.index("thumb.force_n")],
        np.array(table["action"].to_pylist())[:, 1],
        state[:, names.index("index_j1")],
    )


def followed(episodes: Episodes) -> dict[str, list[float]]:
    """Return after how long, seconds, each press and each release was followed by the closure.

    Infinite if it was not; negative where the closure was there before.
    """
    found: dict[str, list[float]] = {"press": [], "release": []}
    for number in np.unique(episodes.episode):
        mine = episodes.episode == number
        time_s, closed = episodes.time_s[mine], episodes.closure[mine] > CLOSED
        touched = episodes.force_n[mine] > TOUCHED_N
        changes = np.flatnonzero(touched[1:] != touched[:-1]) + 1
        for k, end in zip(changes, [*changes[1:], len(touched)], strict=True):
            if time_s[end - 1] - time_s[k] < WITHIN_S and end == len(touched):
                continue  # the episode ends before it could be followed
            late = [
                t - time_s[k] for t, c in zip(time_s[k:end], closed[k:end], strict=True) if c == touched[k]
            ]
            after_s = late[0] if late and late[0] <= WITHIN_S else math.inf
            before = closed[k - 1] == touched[k]
            found["press" if touched[k] else "release"].append(-1.0 if before else float(after_s))
    return found


def table(name: str, episodes: Episodes) -> list[str]:
    """Return what became of presses and releases, as lines of a table."""
    lines = []
    for change, after_s in followed(episodes).items():
        times = [t for t in after_s if 0 <= t < math.inf]
        median = f"{np.median(times):.1f}" if times else "–"
        before, never = sum(t < 0 for t in after_s), sum(t == math.inf for t in after_s)
        lines.append(f"| {name} | {change} | {len(after_s)} | {len(times)} | {median} | {before} | {never} |")
    return lines


@contextmanager
def emulated(folder: Path, environment: Mapping[str, str]) -> Iterator[None]:
    """Keep the emulated bench up, with its settings in ``lab.toml``."""
    for name in ("lab.toml", "lab/moves.json"):
        (folder / name).unlink(missing_ok=True)
    words = [sys.executable, "-m", "tega.ui.cli", "init", "--emulated", "--out", "lab.toml"]
    with (folder / "bench.log").open("w") as log:
        bench = subprocess.Popen(words, cwd=folder, env=environment, stdout=log, stderr=log)
        try:
            until_s = time.monotonic() + 120
            while not (folder / "lab" / "moves.json").exists():
                if bench.poll() is not None or time.monotonic() > until_s:
                    raise SystemExit(f"the emulated bench did not start: {folder / 'bench.log'}")
                time.sleep(0.2)
            yield
        finally:
            bench.terminate()
            bench.wait(30)


def lerobot(folder: Path, program: str, options: Sequence[str], environment: Mapping[str, str]) -> None:
    """Run one of LeRobot's programs; its lines go into a file."""
    words = [sys.executable, "-m", f"lerobot.scripts.lerobot_{program}", *options]
    log = folder / f"{program}-{time.strftime('%H%M%S')}.log"
    began_s = time.monotonic()
    with log.open("w") as file:
        code = subprocess.run(
            words, cwd=folder, env=environment, stdout=file, stderr=file, check=False
        ).returncode
    print(f"lerobot_{program}: {time.monotonic() - began_s:.0f} s, code {code}, {log}", flush=True)
    if code:
        raise SystemExit(code)


def record(
    folder: Path, name: str, options: Sequence[str], environment: Mapping[str, str], *, passive: bool
) -> None:
    """Have LeRobot record a dataset while the thumb is pressed and released."""
    with emulated(folder, environment):
        words = [sys.executable, str(EXAMPLE), "lab/moves.json", "3000", *(["--passive"] if passive else [])]
        person = subprocess.Popen(words, cwd=folder, env=environment)
        try:
            # LeRobot takes datasets of a policy only under a name that begins with eval_.
            where = (f"--dataset.repo_id=lab/eval_{name}" if passive else f"--dataset.repo_id=lab/{name}",)
            options = [*_ROBOT, *_DATASET, *where, f"--dataset.root={name}", *options]
            lerobot(folder, "record", options, environment)
        finally:
            person.terminate()
            person.wait(30)


def draw(root: Path, picture: Path) -> None:
    """Draw the first episode: pictures of the thumb, its force, the closure that was asked for and a joint."""
    import matplotlib as mpl

    mpl.use("Agg")
    import av
    import matplotlib.pyplot as plt

    episodes = read_episodes(root)
    mine = episodes.episode == episodes.episode[0]
    time_s, touched = episodes.time_s[mine], episodes.force_n[mine] > TOUCHED_N
    figure, axes = plt.subplots(4, 1, figsize=(8, 5.4), sharex=True, layout="constrained")
    with av.open(str(next((root / "videos").rglob("file-000.mp4")))) as film:
        images = [
            frame.to_ndarray(format="rgb24") for frame, _ in zip(film.decode(video=0), time_s, strict=False)
        ]
    displayed = np.linspace(0, len(images) - 1, 12).astype(int)
    width_s = time_s[-1] / len(displayed) * 0.8
    for k in displayed:
        axes[0].imshow(images[k], extent=(time_s[k], time_s[k] + width_s, 0, 1), aspect="auto")
    axes[0].set_yticks([])
    lines = (
        (episodes.force_n, "thumb, N"),
        (episodes.closure, "closure asked"),
        (episodes.joint_rad, "index joint 1, rad"),
    )
    axes[0].set_ylabel("thumb")
    for ax, (values, label) in zip(axes[1:], lines, strict=True):
        ax.plot(time_s, values[mine], drawstyle="steps-post", color="#1f5f8b")
        ax.set_ylabel(label)
        ax.fill_between(time_s, *ax.get_ylim(), where=touched, step="post", color="#ddd", zorder=0)
    axes[0].set_xlim(0, time_s[-1])
    axes[-1].set_xlabel("time, s; grey: the thumb is touched")
    figure.savefig(picture, dpi=90)


def main() -> None:
    """Do what is not done yet, and print what became of presses and releases."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--steps", type=int, default=800)
    parser.add_argument("--episode-s", type=float, default=30.0, help="length of a rollout")
    parser.add_argument("--rollouts", type=int, default=2)
    parser.add_argument("--picture", type=Path)
    args = parser.parse_args()
    folder: Path = args.folder
    folder.mkdir(parents=True, exist_ok=True)
    offline = {"HF_HUB_OFFLINE": "1", "HF_HOME": str(folder.resolve() / "hf"), "OMP_NUM_THREADS": "1"}
    environment: dict[str, Any] = os.environ | offline
    if not (folder / "demos").exists():
        record(
            folder,
            "demos",
            [*_TELEOP, "--dataset.num_episodes=10", "--dataset.episode_time_s=9"],
            environment,
            passive=False,
        )
    policy = folder / f"policy-{args.steps}"
    if not policy.exists():
        options = [f"--policy.{name}={value}" for name, value in _POLICY.items()]
        options += ["--dataset.repo_id=lab/demos", "--dataset.root=demos", "--dataset.video_backend=pyav"]
        options += [f"--steps={args.steps}", f"--save_freq={args.steps}", "--batch_size=8", "--num_workers=0"]
        options += ["--eval_freq=0", "--log_freq=50", f"--output_dir={policy.name}"]
        lerobot(folder, "train", options, environment)
    rollout = folder / f"rollout-{args.steps}"
    if not rollout.exists():
        options = [f"--policy.path={policy.name}/checkpoints/last/pretrained_model"]
        options += [f"--dataset.num_episodes={args.rollouts}", f"--dataset.episode_time_s={args.episode_s:g}"]
        record(folder, rollout.name, options, environment, passive=True)
    print(
        "| frames of | change of touch | n | followed | after s, median | closure there before | not followed |"
    )
    print("|---|---|---|---|---|---|---|")
    for name, root in (("demonstrations", folder / "demos"), ("policy", rollout)):
        print("\n".join(table(name, read_episodes(root))))
    if args.picture is not None:
        draw(rollout, args.picture)


if __name__ == "__main__":
    main()
