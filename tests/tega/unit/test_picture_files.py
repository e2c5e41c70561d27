"""Pictures of other programs: the order and times in their names, stacks, and baselines that are not theirs."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference.command import call
from reference.recordings import pressed
from tega.devices.fingertip.images import ImageFolder, ImageFolderOptions
from tega.devices.fingertip.picture_stack import StackFile, StackFileOptions
from tega.errors import CalibrationError, RecordingError
from tega.loop.baseline_match import check_baseline
from tega.runtime.files.picture_stack import name_times_s, sorted_names


def gel(noise: int = 0, *, depth: float = 0.0) -> np.ndarray[Any, np.dtype[np.uint8]]:
    """Return a picture whose light differs by colour, row and column, as that of a gel's three lamps does."""
    y, x = np.mgrid[:120, :96]
    light = np.stack([60 + y / 2 + x / 8, 100 - x / 3 + y / 6, 170 - y / 3 + x / 5], axis=2)
    dent = depth * np.exp(-((y - 50) ** 2 + (x - 60) ** 2) / 200)[..., None]
    flicker = np.random.default_rng(noise).integers(-1, 2, light.shape)
    picture: np.ndarray[Any, np.dtype[np.uint8]] = np.clip(np.rint(light + dent + flicker), 0, 255).astype(
        np.uint8
    )
    return picture


# Whole seconds alone may be numbers that count.
_TIMES = st.floats(1.0e9, 1.99e9).map(lambda t: round(t, 6)).filter(lambda t: t % 1 > 0)


@given(st.lists(_TIMES, min_size=2, max_size=30, unique=True))
def test_names_by_time_time_come_in_the_order_of_their_times(times: list[float]) -> None:
    files = [Path(f"{t}.png") for t in times]
    found = [float(path.stem) for path in sorted_names(files)]
    assert found == sorted(times)
    in_names = name_times_s([repr(t) for t in found])
    assert in_names is not None
    assert in_names == pytest.approx([t - found[0] for t in found], abs=1e-6)


@pytest.mark.parametrize(
    "names",
    [
        ["0.0", "0.0333", "0.1", "0.25", "0.5", "10.25"],
        ["t_0,5", "t_0,75", "t_1"],
        ["take.2", "take.10"],
        ["1.1", "1.2", "1.9", "1.10", "1.11"],
        ["2026-11-26 9.05.03", "2026-11-26 10.05.03"],
        ["2026-11-26T10:05:03", "2026-11-26T10:05:03.100000", "2026-11-26T10:05:04"],
        ["a_9_1700000000123456789", "a_10_1700000000223456789"],
    ],
)
def test_numbers_in_names_count_by_their_values(names: list[str]) -> None:
    files = [Path(f"{name}.png") for name in names]
    random.Random(1).shuffle(files)
    assert [path.stem for path in sorted_names(files)] == names


def test_times_in_names_are_used_or_compared(tmp_path: Path) -> None:
    for k in range(6):
        cv2.imwrite(str(tmp_path / f"{1_700_000_000 + (k + 0.4 * (k > 3)) / 4}.png"), pressed(0, noise=k))
    with ImageFolder(ImageFolderOptions(folder=tmp_path)) as source:
        times_s = [frame.t_ns / 1e9 for _ in range(6) if (frame := source.read(0)) is not None]
        assert (
            "the names state the times: 3.704 pictures per second, at most 0.35 s apart" in source.info.notes
        )
    assert times_s == [0, 0.25, 0.5, 0.75, 1.1, 1.35]
    with ImageFolder(ImageFolderOptions(folder=tmp_path, rate_hz=60)) as source:
        assert "the names state 3.704 pictures per second, 60 is used" in source.info.notes[0]
        stamps = [frame.t_ns for _ in range(2) if (frame := source.read(0)) is not None]
    assert stamps == [0, 16_666_667]


def test_a_counter_of_ten_digits_is_no_time() -> None:
    assert name_times_s([str(1_000_000_000 + k) for k in range(9)]) is None


def stack_of(path: Path, **options: Any) -> list[Any]:
    found = []
    with StackFile(StackFileOptions(file=path, **options)) as source:
        while (frame := source.read(0)) is not None:
            found.append(frame)
        assert source.info.n_items == len(found)
    return found


def test_a_stack_gives_the_pictures_that_numpy_saved(tmp_path: Path) -> None:
    pictures = np.random.default_rng(1).integers(0, 256, (7, 20, 30, 3)).astype(np.uint8)
    np.save(tmp_path / "a.npy", pictures)
    np.savez_compressed(
        tmp_path / "b.npz", gel=pictures, t_ns=np.cumsum([5, 10, 20, 30, 40, 50, 60]) * 1_000_000
    )
    np.savez(tmp_path / "c.npz", one=pictures, two=pictures[:3])
    np.save(tmp_path / "grey.npy", pictures[..., 0])
    for path in ("a.npy", "b.npz"):
        frames = stack_of(tmp_path / path)
        np.testing.assert_array_equal([f.image for f in frames], pictures)
    assert [f.t_ns // 1_000_000 for f in frames] == [0, 10, 30, 60, 100, 150, 210]
    assert [f.t_ns for f in stack_of(tmp_path / "a.npy", rate_hz=50)] == [k * 20_000_000 for k in range(7)]
    rgb = stack_of(tmp_path / "c.npz", variable="one", order="rgb")
    np.testing.assert_array_equal([f.image for f in rgb], pictures[..., ::-1])
    np.testing.assert_array_equal(stack_of(tmp_path / "grey.npy")[2].image[..., 1], pictures[2, ..., 0])
    with pytest.raises(RecordingError, match=r"2 arrays that could be pictures.*one, two"):
        stack_of(tmp_path / "c.npz")


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda a: a.transpose(0, 3, 1, 2).copy(), r"\(7, 3, 20, 30\).*put the colours last"),
        (lambda a: a / 255, "float64.*convert it"),
        (lambda a: a[0], "this is one picture"),
        (np.asfortranarray, "ascontiguousarray"),
    ],
)
def test_another_array_is_refused_with_the_way_out(change, text, tmp_path):
    np.save(tmp_path / "a.npy", change(np.zeros((7, 20, 30, 3), np.uint8)))
    with pytest.raises(RecordingError, match=text):
        stack_of(tmp_path / "a.npy")


def test_a_stack_that_was_cut_short_names_the_picture(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.zeros((7, 20, 30, 3), np.uint8))
    data = (tmp_path / "a.npy").read_bytes()
    (tmp_path / "a.npy").write_bytes(data[: len(data) // 2])
    with pytest.raises(RecordingError, match=r"a\.npy: cut short at picture 3 of 7"):
        stack_of(tmp_path / "a.npy")


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda p: p[..., ::-1], "nearly everywhere: it looks like them in RGB order"),
        (lambda p: p[::-1, ::-1], "nearly everywhere: it looks like them turned by 180 degrees"),
        (lambda p: p[:, ::-1], "nearly everywhere: it looks like them mirrored left to right"),
        (lambda p: p[::-1], "nearly everywhere: it looks like them mirrored top to bottom"),
        (lambda p: p[::-1, ::-1, ::-1], "in RGB order and turned by 180 degrees"),
        (lambda p: np.rot90(p, -1), "120×96 pixels, .* have 96×120: it looks like .* 90 degrees clockwise"),
        (lambda p: np.rot90(p, 1), "it looks like them turned by 90 degrees counterclockwise"),
        (lambda p: p.transpose(1, 0, 2), "it looks like them mirrored and turned by 90 degrees"),
        (lambda p: p[::-1, ::-1].transpose(1, 0, 2), "it looks like them mirrored and turned by 90 degrees"),
        (lambda p: cv2.resize(p, (48, 60)), "48×60 pixels, the pictures of frames have 96×120; give"),
        (lambda p: p // 3, "nearly everywhere: another sensor, other lights"),
    ],
)
def test_a_baseline_that_is_not_the_pictures_is_refused_with_what_it_looks_like(change, text):
    pictures = [gel(k, depth=40 * (k % 3)) for k in range(1, 6)]
    check_baseline(gel(), pictures, name="b.png", label="frames")
    check_baseline(
        np.clip(gel().astype(int) + 5, 0, 255).astype(np.uint8), pictures, name="b.png", label="frames"
    )
    with pytest.raises((CalibrationError, RecordingError), match=text):
        check_baseline(np.ascontiguousarray(change(gel())), pictures, name="b.png", label="frames")


def test_replay_refuses_a_baseline_in_rgb(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "frames").mkdir()
    for k in range(8):
        cv2.imwrite(str(tmp_path / "frames" / f"frame_{k}.png"), gel(k, depth=60 * (k > 4)))
    cv2.imwrite(str(tmp_path / "rgb.png"), gel()[..., ::-1])
    words = ["replay", "--tactile", f"thumb={tmp_path / 'frames'}", "--out", tmp_path / "out", "--baseline"]
    _, text = call(capsys, *words, f"thumb={tmp_path / 'rgb.png'}", code=1)
    assert "unlike the pictures of frames nearly everywhere: it looks like them in RGB order" in text
