"""Write the files of a LeRobot dataset, format v3.0.

The layout is the public one: ``meta/info.json``, ``meta/stats.json``, ``meta/tasks.parquet``,
``meta/episodes/chunk-000/file-000.parquet``, ``data/chunk-000/file-000.parquet`` with many episodes in a file, and
``videos/KEY/chunk-000/file-000.mp4`` likewise.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tega.errors import ConfigError, RecordingError
from tega.recording.mcap_folder import recorded_task
from tega.recording.mcap_reader import Progress
from tega.recording.origin import note_copy, origins, span
from tega.runtime.files.foreign_file import plain_name, reports_damage
from tega.runtime.lifecycle import require
from tega.runtime.words import printable
from tega_lerobot.episode import Episode, check_scene, own_scenes, read_episode, scene_frames
from tega_lerobot.video import (
    CODEC,
    FILES_PER_CHUNK,
    PIXELS,
    PLACE,
    VIDEO_MB,
    VIDEOS,
    EpisodeCamera,
    Values,
    VideoPlace,
)

FORMAT = "v3.0"
DATA = f"data/{PLACE}.parquet"
EPISODES = f"meta/episodes/{PLACE}.parquet"
_DATA_MB = 100
# Frames whose numbers are in memory at one time, and are a row group of the table.
_ROWS_PER_GROUP = 1 << 12
UNLABELLED = "grasp"
"""Task of a recording without a label."""
_Scenes = Mapping[str, tuple[Path, tuple[int, int]]]
"""Video of each scene camera, and height and width of its pictures."""
# Columns that every dataset has.
_COUNTERS = {
    "timestamp": "float32",
    "frame_index": "int64",
    "episode_index": "int64",
    "index": "int64",
    "task_index": "int64",
}


def export_lerobot(
    paths: Sequence[Path],
    folder: Path,
    *,
    fps: int = 30,
    task: str | None = None,
    scenes: Mapping[str, Path] = {},
    progress: Progress | None = None,
) -> Path:
    """Write recordings as a LeRobot dataset, one episode each.

    All must have the same inputs; ``folder`` must be new or empty. ``task`` is in words, for recordings of
    which their session's index says none; ``None`` for ``grasp``. ``scenes`` are videos of scene cameras with
    their time codes, by the cameras' names; none for the films in the recordings. ``progress`` is called as a
    file is read: once for its numbers, then for its pictures. A finger's name that cannot be a folder's
    raises :class:`UnsafeNameError`.
    """
    for module in ("pyarrow.parquet", "av"):
        require(module, driver="export", extra="lerobot")
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise ConfigError(f"{str(folder)!r} is not empty, or is a file", "name a new folder with --out")
    for name in scenes:
        plain_name(name, subject="camera", source="--scene")
    given = _sized(scenes)
    folder.mkdir(parents=True, exist_ok=True)
    for path in paths:
        note_copy(path, folder)
    dataset = _Dataset(folder, fps)
    try:
        for path in paths:
            with tempfile.TemporaryDirectory() as beside:
                filmed = given or _sized(own_scenes(path, Path(beside)))
                _add(path, dataset, recorded_task(path) or task or UNLABELLED, filmed, progress)
    finally:
        dataset.close()
    return folder


def _sized(videos: Mapping[str, Path]) -> _Scenes:
    return {name: (video, check_scene(video)) for name, video in videos.items()}


@reports_damage
def _add(path: Path, dataset: _Dataset, task: str, scenes: _Scenes, progress: Progress | None) -> None:
    """Read a recording and add it; whatever its content leads to on the way is damage of that file."""
    dataset.add(read_episode(path, fps=dataset.fps, progress=progress), task, scenes)


class _Dataset:
    def __init__(self, folder: Path, fps: int) -> None:
        self._arrow: Any = require("pyarrow", driver="export", extra="lerobot")
        self._parquet: Any = require("pyarrow.parquet", driver="export", extra="lerobot")
        self._folder, self.fps = folder, fps
        self._tasks: list[str] = []
        self._cameras: dict[str, EpisodeCamera] = {}
        self._features: dict[str, Any] = {}
        self._place = VideoPlace()
        self._writer: Any = None
        self._episodes: list[dict[str, Any]] = []
        self._values: dict[str, Values] = {}
        self._sources: list[dict[str, Any]] = []
        self._n_frames = 0

    def add(self, episode: Episode, task: str, scenes: _Scenes) -> None:
        """Add an episode of a task, with videos of scene cameras."""
        if task not in self._tasks:
            self._tasks.append(task)
        if both := sorted(set(scenes) & set(episode.shapes)):
            raise ConfigError(f"the scene camera {both[0]} is named as a finger", "name it otherwise")
        shapes = {**episode.shapes, **{name: size for name, (_, size) in scenes.items()}}
        features = self._described(episode, shapes)
        if not self._features:
            self._features = features
            for finger, shape in shapes.items():
                plain_name(finger, subject="finger", source=episode.path.name)
                key = f"observation.images.{finger}"
                self._cameras[finger] = EpisodeCamera(self._folder, key, self.fps, shape)
        elif features != self._features:
            names = {**features, **self._features}
            other = [name for name in names if features.get(name) != self._features.get(name)]
            raise RecordingError(
                f"{episode.path.name}: differs from the first recording in {', '.join(other)}",
                "export recordings of one setup together",
            )
        number, n = len(self._episodes), episode.n_frames
        where = self._begin_table()
        since = next((values.n_parts for values in self._values.values()), 0)
        for part in episode.parts(_ROWS_PER_GROUP):
            frames = part.first + np.arange(part.n_frames)
            rows: dict[str, NDArray[Any]] = {name: column.values for name, column in part.columns.items()}
            rows |= {
                "timestamp": (frames / self.fps).astype(np.float32),
                "frame_index": frames,
                "episode_index": np.full(len(frames), number),
                "index": self._n_frames + frames,
                "task_index": np.full(len(frames), self._tasks.index(task)),
            }
            self._write(rows, where)
        for camera in self._cameras.values():
            camera.begin(n)
        for finger, image, n_times in episode.pictures():
            self._cameras[finger].add(image, n_times)
        for name, (video, _) in scenes.items():
            for image, n_times in scene_frames(video, episode):
                self._cameras[name].add(image, n_times)
        known: dict[str, Any] = {"episode_index": number, "tasks": [task], "length": n}
        known |= {f"data/{name}": value for name, value in where.items()}
        known |= {"dataset_from_index": self._n_frames, "dataset_to_index": self._n_frames + n}
        for camera in self._cameras.values():
            known |= camera.end()
        known |= {"meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0}
        stats = {name: values.figures(since) for name, values in self._values.items()}
        stats |= {f"observation.images.{f}": c.episode.figures() for f, c in self._cameras.items()}
        known |= {
            f"stats/{name}/{subject}": v for name, known_ in stats.items() for subject, v in known_.items()
        }
        self._episodes.append(known)
        self._sources.append(_source(episode, number))
        self._n_frames += n

    def close(self) -> None:
        """Finish the files, and write the metadata."""
        for camera in self._cameras.values():
            camera.close()
        if self._writer is not None:
            self._writer.close()
        if not self._episodes:
            return
        stats = {name: values.figures() for name, values in self._values.items()}
        stats |= {f"observation.images.{f}": c.total.figures() for f, c in self._cameras.items()}
        self._json("stats", stats)
        self._json("info", self._info())
        self._json("tega", {"episodes": self._sources})
        names = {name: [episode[name] for episode in self._episodes] for name in self._episodes[0]}
        path = self._folder / EPISODES.format(chunk_index=0, file_index=0)
        path.parent.mkdir(parents=True, exist_ok=True)
        self._parquet.write_table(self._arrow.table(names), path)
        self._write_tasks()

    def _json(self, name: str, content: Mapping[str, Any]) -> None:
        path = self._folder / "meta" / f"{name}.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(content, indent=4, ensure_ascii=False) + "\n", encoding="utf-8")

    def _write_tasks(self) -> None:
        """Write the tasks as pandas writes a table with named rows."""
        table = self._arrow.table({"task_index": list(range(len(self._tasks))), "task": self._tasks})
        kinds = (("task_index", "int64", "int64"), ("task", "unicode", "object"))
        columns = [
            {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy, "metadata": None}
            for name, kind, numpy in kinds
        ]
        pandas = {"index_columns": ["task"], "column_indexes": [], "columns": columns}
        table = table.replace_schema_metadata({"pandas": json.dumps(pandas)})
        self._parquet.write_table(table, self._folder / "meta" / "tasks.parquet")

    def _described(self, episode: Episode, shapes: Mapping[str, tuple[int, int]]) -> dict[str, Any]:
        features: dict[str, Any] = {}
        for finger, (height, width) in shapes.items():
            if not height * width or height % 2 or width % 2:
                raise RecordingError(
                    f"{episode.path.name}: {finger}: {width}×{height} pixels are none, or not even",
                    "a video in this format needs even numbers of pixels",
                )
            features[f"observation.images.{finger}"] = {
                "dtype": "video",
                "shape": [height, width, 3],
                "names": ["height", "width", "channels"],
                "info": {
                    "video.height": height,
                    "video.width": width,
                    "video.codec": CODEC,
                    "video.pix_fmt": PIXELS,
                    "video.is_depth_map": False,
                    "video.fps": self.fps,
                    "video.channels": 3,
                    "has_audio": False,
                },
            }
        for name, column in next(episode.parts(1)).columns.items():
            shape = list(column.values.shape[1:])
            features[name] = {"dtype": "float32", "shape": shape, "names": column.names}
        counters = {"shape": [1], "names": None}
        return features | {name: {"dtype": kind, **counters} for name, kind in _COUNTERS.items()}

    def _begin_table(self) -> dict[str, int]:
        """Return where an episode's rows go: into a new file where the last one is large."""
        path = self._folder / DATA.format(**self._place.numbers())
        if self._writer is not None and path.stat().st_size > _DATA_MB * 2**20:
            self._writer.close()
            self._writer = None
            self._place.next()
        return self._place.numbers()

    def _write(self, rows: Mapping[str, NDArray[Any]], where: Mapping[str, int]) -> None:
        table = self._arrow.table({name: self._column(values) for name, values in rows.items()})
        if self._writer is None:
            path = self._folder / DATA.format(**where)
            path.parent.mkdir(parents=True, exist_ok=True)
            # Measured numbers rarely repeat, so a dictionary takes memory and makes the file larger.
            self._writer = self._parquet.ParquetWriter(path, table.schema, use_dictionary=False)
        self._writer.write_table(table, row_group_size=_ROWS_PER_GROUP)
        for name, values in rows.items():
            if name not in self._values:
                self._values[name] = Values(values)
            self._values[name].add(values)

    def _column(self, values: NDArray[Any]) -> Any:
        numbers = np.ascontiguousarray(values).ravel()
        kind = self._arrow.from_numpy_dtype(numbers.dtype)
        # The general way, from any object, loads pandas to ask whether it is one of its own.
        column = self._arrow.Array.from_buffers(kind, len(numbers), [None, self._arrow.py_buffer(numbers)])
        if values.shape[1:] == (1,):
            return column
        for n in reversed(values.shape[1:]):
            column = self._arrow.FixedSizeListArray.from_arrays(column, n)
        return column

    def _info(self) -> dict[str, Any]:
        n = len(self._episodes)
        return {
            "codebase_version": FORMAT,
            "robot_type": "allegro_hand",
            "total_episodes": n,
            "total_frames": self._n_frames,
            "total_tasks": len(self._tasks),
            "chunks_size": FILES_PER_CHUNK,
            "data_files_size_in_mb": _DATA_MB,
            "video_files_size_in_mb": VIDEO_MB,
            "fps": self.fps,
            "splits": {"train": f"0:{n}"},
            "data_path": DATA,
            "video_path": VIDEOS if self._cameras else None,
            "features": self._features,
        }


def _source(episode: Episode, number: int) -> dict[str, Any]:
    head = episode.tables.get("tega", {})
    return {
        "episode_index": number,
        "session": printable(episode.path.resolve().parent.name),
        "file": printable(episode.path.name),
        "start_ns": episode.start_ns,
        "epoch_ns": int(head.get("epoch_ns", "0")),
        "config_sha256": head.get("config_sha256", ""),
        "markers": [
            {
                "frame_index": max(0, (marker.t_ns - episode.start_ns) * episode.fps // 1_000_000_000),
                "timestamp": round((marker.t_ns - episode.start_ns) / 1e9, 6),
                "text": marker.text,
                "source": marker.source,
            }
            for marker in episode.markers
        ],
        "span": span(episode.tables).table(),
        "origins": origins(episode.tables),
        "versions": episode.tables.get("versions", {}),
    }
