"""The audit of readings: marks, the composed frame, scores, and what it says of real presses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tega.audit import READINGS, Mark, audit_frames, far_field, mean_difference, read_marks
from tega.cli.main import main
from tega.errors import RecordingError
from tega.sim.gel import Gel, ball

GEL = Gel(seed=5)
BASELINE = GEL.still()
FORCES_N = (1.5, 3.0, 5.0)
FRAMES = [GEL.frame([ball(force_n=n, centre_xy=(120.0, 150.0))], k) for k, n in enumerate(FORCES_N)]


def test_every_reading_scores_every_frame() -> None:
    scores = audit_frames(FRAMES, BASELINE, at_rest=GEL.frame([], 0))
    assert [s.reading for s in scores] == list(READINGS)
    by_name = {s.reading: s for s in scores}
    assert by_name["print, absolute"].eda == [BASELINE[..., 0].size] * 3
    live = by_name["live"]
    assert (live.n_found, live.eda_at_rest) == (3, 0)
    assert live.eda == sorted(live.eda)
    assert live.cci == sorted(live.cci)
    assert live.iou is None


def test_masks_have_as_many_pixels_as_eda_says() -> None:
    for name, read in READINGS.items():
        outcome = read(FRAMES[1], BASELINE)
        if name != "print, signed":  # its threshold is compared in rounded grey values for display only
            assert int(outcome.mask.sum()) == outcome.eda, name


def test_overlap_with_a_mark_is_one_for_the_mark_itself() -> None:
    marks = [Mark((120.0, 150.0), 60.0)] * 3
    score = audit_frames(FRAMES, BASELINE, marks=marks, readings=["live"])[0]
    assert score.iou is not None
    assert score.area_ratio is not None
    assert 0.5 < score.iou <= 1
    assert score.area_ratio == pytest.approx(score.eda[1] / np.sum(marks[0].distance((320, 240)) <= 1))


def test_the_composed_frame_holds_no_press() -> None:
    frames = [GEL.frame([ball(force_n=4.0, centre_xy=xy)], 0) for xy in ((60.0, 60.0), (180.0, 260.0))]
    marks = [Mark((60.0, 60.0), 45.0), Mark((180.0, 260.0), 45.0)]
    at_rest = far_field(frames, marks, BASELINE)
    assert audit_frames([at_rest], BASELINE, readings=["live"])[0].eda == [0]


def test_marks_are_read_by_base_name_and_doubtful_ones_left_out(tmp_path: Path) -> None:
    table = tmp_path / "marks.csv"
    table.write_text(
        "img_name,center_x,center_y,radius\n/data/set/a.png,1,2,3\nset\\b.png,4,5,6\nc.png,1,1,1\nc.png,2,2,2\n"
    )
    assert read_marks(table) == {"a.png": Mark((1.0, 2.0), 3.0), "b.png": Mark((4.0, 5.0), 6.0)}
    table.write_text("img_name,center_x,center_y,radius\na.png,1,two,3\n")
    with pytest.raises(RecordingError, match=r"marks\.csv:2"):
        read_marks(table)
    with pytest.raises(RecordingError, match="cannot be read"):
        read_marks(tmp_path / "none.csv")


def test_the_mean_difference_rises_with_the_press() -> None:
    press = mean_difference([BASELINE, *FRAMES], BASELINE)
    assert press[0] == 0
    assert list(press) == sorted(press)


def test_the_verb_prints_draws_and_speaks_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cv2 = pytest.importorskip("cv2", reason="needs the extra tega[lab]")
    for number, frame in enumerate([BASELINE, *FRAMES]):
        cv2.imwrite(str(tmp_path / f"{number}.png"), frame)
    words = ["audit", str(tmp_path), "--baseline", str(tmp_path / "0.png")]
    pictures = tmp_path / "drawn"
    pictures.mkdir()
    with pytest.raises(SystemExit) as done:
        main([*words, "--picture", str(pictures / "out.png"), "--curves", str(pictures / "curves.png")])
    assert done.value.code == 0
    assert "live" in capsys.readouterr().out
    assert (pictures / "out.png").stat().st_size > 10_000
    assert (pictures / "curves.png").stat().st_size > 10_000
    with pytest.raises(SystemExit):
        main([*words, "--json"])
    scores = json.loads(capsys.readouterr().out)
    assert [s["n_frames"] for s in scores] == [3] * len(READINGS)


def test_a_lab_s_own_masks_and_forces_are_held_against_the_readings(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cv2 = pytest.importorskip("cv2", reason="needs the extra tega[lab]")
    masks = tmp_path / "masks"
    masks.mkdir()
    forces = ["img_name,force_n"]
    for number, force_n in enumerate((0.0, *FORCES_N)):
        frame = FRAMES[number - 1] if number else GEL.frame([], 9)
        touching = (
            Mark((120.0, 150.0), 55.0).distance(frame.shape) <= 1
            if number
            else np.zeros((320, 240), np.bool_)
        )
        cv2.imwrite(str(tmp_path / f"{number}.png"), frame)
        cv2.imwrite(str(masks / f"{number}.png"), 255 * touching.astype(np.uint8))
        forces.append(f"{number}.png,{force_n}")
    cv2.imwrite(str(tmp_path / "still.png"), BASELINE)
    table = tmp_path / "forces.csv"
    table.write_text("\n".join(forces))
    words = ["audit", str(tmp_path), "--baseline", str(tmp_path / "still.png"), "--masks", str(masks)]
    words += ["--forces", str(table)]
    with pytest.raises(SystemExit) as done:
        main([*words, "--json"])
    assert done.value.code == 0
    live = next(s for s in json.loads(capsys.readouterr().out) if s["reading"] == "live")
    assert (live["n_frames"], live["n_touched"], live["n_felt"], live["n_false"]) == (4, 3, 3, 0)
    assert live["force_rank"] == pytest.approx(1.0)
    assert live["iou"] > 0.5
    with pytest.raises(SystemExit):
        main(words)
    printed = capsys.readouterr().out
    assert "3 of 3" in printed
    assert "false" in printed

    cv2.imwrite(str(masks / "1.png"), np.zeros((10, 10), np.uint8))
    with pytest.raises(SystemExit) as done:
        main(words)
    assert done.value.code != 0
    assert "a mask of 10 x 10 pixels" in capsys.readouterr().err
    for line, said in (
        ("1.png,much", "not a force"),
        ("1.png,-3", "wanted 0 to"),
        ("other.png,1", "no picture has"),
    ):
        table.write_text(f"img_name,force_n\n{line}\n")
        with pytest.raises(SystemExit) as done:
            main(words)
        assert done.value.code != 0
        assert said in capsys.readouterr().err


def test_live_finds_the_marked_circles_of_real_presses(recordings: Path) -> None:
    cv2 = pytest.importorskip("cv2", reason="needs the extra tega[lab]")
    folder = recordings / "digit" / "digit_ball_D20641"
    marks = read_marks(folder / "annotate.csv")
    frames = [cv2.imread(str(folder / name)) for name in marks]
    baseline = cv2.imread(str(folder / "background.png"))
    at_rest = far_field(frames, list(marks.values()), baseline)
    live = audit_frames(frames, baseline, marks=list(marks.values()), at_rest=at_rest, readings=["live"])[0]
    assert live.n_found == live.n_frames == 30
    assert live.eda_at_rest == 0
    assert live.iou is not None
    assert live.iou_low is not None
    assert live.area_ratio is not None
    assert live.iou >= 0.78
    assert live.iou_low >= 0.60
    assert 0.9 <= live.area_ratio <= 1.1
