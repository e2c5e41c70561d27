"""The audit of readings, muscles and sessions: marks, forces, sweeps, with the stages that a run uses."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from reference.command import call
from reference.sessions import synthetic
from tega.config import load_config
from tega.config.choose import preset_metric
from tega.errors import ConfigError, RecordingError
from tega.records import Intent
from tega.ui.cli.main import main
from tega_figures.audit import (
    READINGS,
    AuditRequest,
    Mark,
    audit_recording,
    parse_sweep,
    read_forces,
    read_marks,
)
from tega_figures.audit.truth import FarField
from tega_sim.gel import Gel, ball

cv2 = pytest.importorskip("cv2", reason="needs the extra tega[lab]")
GEL = Gel(seed=5)
BASELINE = GEL.still()
FORCES_N = (1.5, 3.0, 5.0)
FRAMES = [GEL.frame([ball(force_n=n, centre_xy=(120.0, 150.0))], k) for k, n in enumerate(FORCES_N)]


def reported(*words: object, capsys: Any) -> list[dict[str, Any]]:
    return json.loads(call(capsys, "audit", *words, "--json")[0])  # type: ignore[no-any-return]


def refused(*words: object, capsys: Any) -> str:
    with pytest.raises(SystemExit) as done:
        main(["audit", *map(str, words)])
    assert done.value.code != 0
    return str(capsys.readouterr().err)


@pytest.fixture
def still(tmp_path: Path) -> Path:
    cv2.imwrite(str(tmp_path / "still.png"), BASELINE)
    return tmp_path / "still.png"


@pytest.fixture
def presses(still: Path) -> Path:
    folder = still.with_name("presses")
    folder.mkdir()
    for number, frame in enumerate(FRAMES):
        cv2.imwrite(str(folder / f"{number}.png"), frame)
    return folder


def mask_of(frame: NDArray[np.uint8]) -> NDArray[np.bool_]:
    return Mark((120.0, 150.0), 55.0).distance(frame.shape) <= 1


def test_every_reading_measures_every_picture(presses: Path, still: Path, capsys: Any) -> None:
    (report,) = reported(presses, "--baseline", still, capsys=capsys)
    assert [score["reading"] for score in report["touch"]] == list(READINGS["touch"])
    assert (report["emg"], report["vest"]) == ([], [])
    by_name = {score["reading"]: score for score in report["touch"]}
    assert by_name["print, absolute"]["eda"] == [BASELINE[..., 0].size] * 3
    live = by_name["live"]
    assert live["n_found"] == 3
    assert live["eda"] == sorted(live["eda"])
    assert live["cci"] == sorted(live["cci"])
    assert live["iou"] is None
    # The numbers are those of the stage that a run uses.
    metric = preset_metric("live", BASELINE, "index")
    want = [metric.update(frame, round(k * 1e9 / 60)) for k, frame in enumerate(FRAMES)]
    assert live["eda"] == [contact.eda for contact in want]
    assert live["cci"] == [contact.cci for contact in want]


def test_a_sequence_is_tracked_in_order_unless_its_pictures_are_separate(tmp_path: Path) -> None:
    folder = tmp_path / "lift"
    folder.mkdir()
    gel = Gel(seed=6, memory=True)
    for k in range(30):
        on = [ball(force_n=4.0, centre_xy=(120.0, 150.0))] if 8 <= k < 20 else []
        cv2.imwrite(str(folder / f"{k:02d}.png"), gel.frame(on, k))
    cv2.imwrite(str(tmp_path / "still.png"), gel.still())
    requested = AuditRequest(names=("live",))
    (whole,) = audit_recording(folder, requested, baseline=tmp_path / "still.png")
    (apart,) = audit_recording(folder, requested._replace(separate=True), baseline=tmp_path / "still.png")
    metric = preset_metric("live", gel.still(), "index")
    want = [
        metric.update(cv2.imread(str(folder / f"{k:02d}.png")), round(k * 1e9 / 60)).eda for k in range(30)
    ]
    assert whole.report.touch[0].eda == want
    assert apart.report.touch[0].eda != want


def test_masks_have_as_many_pixels_as_eda_says(presses: Path, still: Path) -> None:
    (found,) = audit_recording(presses, baseline=still)
    index = found.fingers["index"]
    areas = {name: int(area.sum()) for name, area in index.areas.items()}
    eda = {score.reading: score.eda[int(np.argmax(index.press))] for score in found.report.touch}
    eda.pop("D1 print, signed")  # its threshold is compared in rounded grey values for display
    assert eda.items() <= areas.items()


def test_overlap_with_a_mark_is_scored(presses: Path, still: Path, capsys: Any) -> None:
    table = presses.parent / "marks.csv"
    rows = [f"{k}.png,120,150,60" for k in range(3)]
    table.write_text("\n".join(["img_name,center_x,center_y,radius", *rows]))
    words = (presses, "--baseline", still, "--marks", table, "--reading", "live")
    (score,) = reported(*words, capsys=capsys)[0]["touch"]
    disc = np.sum(Mark((120.0, 150.0), 60.0).distance((320, 240)) <= 1)
    assert 0.5 < score["iou"] <= 1
    assert score["area_ratio"] == pytest.approx(score["eda"][1] / disc)
    assert score["eda_at_rest"] == 0


def test_the_composed_picture_holds_no_press() -> None:
    far = FarField(BASELINE)
    for xy in ((60.0, 60.0), (180.0, 260.0)):
        far.take(GEL.frame([ball(force_n=4.0, centre_xy=xy)], 0), Mark(xy, 45.0))
    assert (far.picture != BASELINE).any()
    assert preset_metric("live", BASELINE).update(far.picture, 0).eda == 0


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


def test_forces_are_of_pictures_or_over_time(tmp_path: Path) -> None:
    table = tmp_path / "forces.csv"
    table.write_text("t_s,force_n\n0,0\n1,2\n3,4\n")
    forces = read_forces(table)
    assert [forces.at(t) for t in (0, 500_000_000, 2_000_000_000, 3_500_000_000)] == [0.0, 1.0, 3.0, None]
    assert forces.of_picture("a.png", 7, 1_000_000_000) == 2.0
    table.write_text("t_s,force_n\n1,0\n1,2\n")
    with pytest.raises(RecordingError, match="does not rise"):
        read_forces(table)
    table.write_text("img_name,force_n\nset/a.png,1\n3,2\n")
    forces = read_forces(table)
    assert [forces.of_picture("a.png", 0, 0), forces.of_picture("x", 3, 0), forces.at(0)] == [1.0, 2.0, None]
    # Of a video by frame; the noise of a sensor about 0 is no force.
    table.write_text("frame,force_n,force_clean_n\n0,-0.02,0\n1,0.03,0\n2,0.4,0.3\n")
    with pytest.raises(RecordingError, match="--least-force-n"):
        read_forces(table)
    forces = read_forces(table, least_n=0.05)
    assert [forces.of_picture("", k, 0) for k in range(3)] == [0.0, 0.0, 0.4]


def test_own_masks_and_forces_are_held_against_the_readings(tmp_path: Path, still: Path, capsys: Any) -> None:
    pictures, masks = tmp_path / "pictures", tmp_path / "masks"
    pictures.mkdir()
    masks.mkdir()
    forces = ["img_name,force_n"]
    for number, force_n in enumerate((0.0, *FORCES_N)):
        frame = FRAMES[number - 1] if number else GEL.frame([], 9)
        cv2.imwrite(str(pictures / f"{number}.png"), frame)
        cv2.imwrite(str(masks / f"{number}.png"), mask_of(frame) * np.uint8(255 * (number > 0)))
        forces.append(f"{number}.png,{force_n}")
    table = tmp_path / "forces.csv"
    table.write_text("\n".join(forces))
    words = [pictures, "--baseline", still, "--masks", masks, "--forces", table]
    live = next(s for s in reported(*words, capsys=capsys)[0]["touch"] if s["reading"] == "live")
    assert (live["n_frames"], live["n_touched"], live["n_felt"], live["n_false"]) == (4, 3, 3, 0)
    assert live["force_rank"] == pytest.approx(1.0)
    assert live["iou"] > 0.5
    printed, _ = call(capsys, "audit", *words)
    assert "3 of 3" in printed
    assert "false" in printed

    cv2.imwrite(str(masks / "1.png"), np.zeros((10, 10), np.uint8))
    assert "a mask of 10 x 10 pixels" in refused(*words, capsys=capsys)
    for line, text in (
        ("1.png,much", "not a force"),
        ("1.png,-3", "wanted 0 to"),
        ("other.png,1", "no picture has"),
    ):
        table.write_text(f"img_name,force_n\n{line}\n")
        assert text in refused(*words, capsys=capsys)


def test_pictures_and_some_masks_may_share_a_folder(tmp_path: Path, still: Path, capsys: Any) -> None:
    both = tmp_path / "grasps"
    both.mkdir()
    for number, frame in enumerate(FRAMES):
        cv2.imwrite(str(both / f"frame_{number}.png"), frame)
        cv2.imwrite(str(both / f"mask_{number}.png"), mask_of(frame) * np.uint8(255))
    (both / "mask_2.png").rename(both / "mask_2.bmp.off")
    words = [both, "--baseline", still, "--masks", both, "--separate", "--reading", "live"]
    report = reported(*words, capsys=capsys)[0]
    (live,) = report["touch"]
    # Two frames have a mask; the third has none, and the masks themselves are no presses.
    assert (live["n_frames"], live["n_touched"], report["n_left_out"]) == (2, 2, 3)
    assert live["iou"] > 0.5
    assert "3 pictures left out" in call(capsys, "audit", *words)[0]


@pytest.mark.slow
def test_a_sweep_scores_every_value_and_is_drawn(presses: Path, still: Path, capsys: Any) -> None:
    table, drawn = presses.parent / "forces.csv", presses.parent / "sweep.png"
    rows = [f"{k}.png,{force_n}" for k, force_n in enumerate(FORCES_N)]
    table.write_text("\n".join(["img_name,force_n", *rows]))
    words = (
        presses, "--baseline", still, "--forces", table, "--picture", drawn,
        "--set", "stages.metric.name=reading", "--set", "stages.metric.options.threshold=D4",
        "--sweep", "stages.metric.options.factor=0.5:2.5:0.25",
    )  # fmt: skip
    (report,) = reported(*words, capsys=capsys)
    assert report["sweep"] == "stages.metric.options.factor"
    assert [score["value"] for score in report["touch"]] == [0.5 + 0.25 * k for k in range(9)]
    areas = [score["eda"][-1] for score in report["touch"]]
    assert areas == sorted(areas)
    assert areas[0] < areas[-1]
    assert all(score["force_rank"] is not None for score in report["touch"])
    assert drawn.stat().st_size > 10_000
    assert "0.75" in call(capsys, "audit", *words)[0]


def test_a_sweep_of_words_takes_any_stage(presses: Path, still: Path, capsys: Any) -> None:
    words = (presses, "--baseline", still, "--sweep", "stages.metric.name=paper,live")
    scores = reported(*words, capsys=capsys)[0]["touch"]
    assert [(score["reading"], score["value"]) for score in scores] == [("paper", "paper"), ("live", "live")]
    assert scores[0]["eda"] != scores[1]["eda"]


WRONG = [
    ("stages.metric.options.factor", "not of the form KEY=FROM:TO:STEP"),
    ("stages.metric.options.factor=a:b:c", "are not three numbers"),
    ("stages.metric.options.factor=2:1:0.1", "has to lead from 2 to 1"),
    ("stages.metric.options.factor=0:1:0.0001", "wanted 1 to 200"),
    ("session.preset=paper,live", "an audit compares stages"),
    ("stages.metric.options.factr=1,2", "unknown key"),
    ("stages.metric.options.factor=1,eleven", "factor"),
]


@pytest.mark.parametrize(("sweep", "text"), WRONG)
def test_a_sweep_that_cannot_be_is_refused(presses: Path, capsys: Any, sweep: str, text: str) -> None:
    words = (presses, "--set", "stages.metric.name=reading", "--sweep", sweep)
    assert text in refused(*words, capsys=capsys)


def test_the_ends_of_a_sweep_are_exact() -> None:
    assert parse_sweep("stages.metric.options.factor=0.1:0.3:0.1").values == ("0.1", "0.2", "0.3")
    assert parse_sweep("stages.metric.options.factor=1e-1:0.35:0.1").numbers == (0.1, 0.2, 0.3)
    with pytest.raises(ConfigError, match="has to lead"):
        parse_sweep("stages.metric.options.factor=1:2:inf")


def test_loose_pictures_can_be_shown_on_a_vest(presses: Path, still: Path, capsys: Any) -> None:
    words = (presses, "--baseline", still, "--of", "vest", "--reading", "print")
    (score,) = reported(*words, capsys=capsys)[0]["vest"]
    assert score["lit_share"] > 0
    assert score["maxima_of"] == "recording"
    assert "reading 'prnt' is not known" in refused(presses, "--reading", "prnt", capsys=capsys)


@pytest.fixture
def squeeze(tmp_path: Path) -> Path:
    effort = np.tile(np.repeat([0.05, 0.3, 0.95, 0.55], 250), 4)
    noise = np.random.default_rng(3).standard_normal((len(effort), 3))
    file = tmp_path / "squeeze.npy"
    np.save(file, noise * effort[:, None] * 100)
    rows = [f"{k / 250},{10 * effort[k]}" for k in range(0, len(effort), 10)]
    (tmp_path / "forces.csv").write_text("\n".join(["t_s,force_n", *rows]))
    return file


def test_the_rules_of_the_decoder_are_compared(squeeze: Path, capsys: Any) -> None:
    how = ("--emg-rate-hz", 250, "--emg-kind", "raw", "--forces", squeeze.parent / "forces.csv")
    drawn = squeeze.parent / "emg.png"
    (report,) = reported(squeeze, *how, "--picture", drawn, capsys=capsys)
    scores = {score["reading"]: score for score in report["emg"]}
    assert list(scores) == list(READINGS["emg"])
    assert scores["print, τ 50 ms"]["n_blocks"] == pytest.approx(2 * scores["print"]["n_blocks"], rel=0.05)
    assert scores["live"]["changes_per_s"] < scores["print"]["changes_per_s"]
    assert all(score["force_rank"] > 0.5 for score in scores.values())
    assert sum(scores["print"]["level_shares"]) == pytest.approx(1)
    assert scores["print"]["agreement"] == 1.0
    assert scores["print, 5 Hz"]["later_s"] > 0.02
    assert drawn.stat().st_size > 10_000
    assert "--emg-rate-hz" in refused(squeeze, capsys=capsys)
    assert "holds nothing to audit touch on" in refused(squeeze, *how, "--of", "touch", capsys=capsys)


def test_an_option_of_the_decoder_is_swept(squeeze: Path, capsys: Any) -> None:
    how = ("--emg-rate-hz", 250, "--emg-kind", "raw", "--forces", squeeze.parent / "forces.csv")
    sweep = ("--sweep", "stages.decoder.options.cutoff_hz=2:32:10", "--picture", squeeze.parent / "sweep.png")
    scores = reported(squeeze, *how, *sweep, capsys=capsys)[0]["emg"]
    assert [score["value"] for score in scores] == [2.0, 12.0, 22.0, 32.0]
    assert scores[0]["changes_per_s"] < scores[-1]["changes_per_s"]
    assert all(score["force_rank"] is not None for score in scores)


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("foxglove", reason="needs the extra tega[record]")
    from tega.loop import run_session

    folder = tmp_path_factory.mktemp("session")
    (folder / "lab.toml").write_text(synthetic(3.0, "index", "thumb"))
    run_session(load_config(folder / "lab.toml", environ={}).config)
    return folder / "recorded"


@pytest.mark.slow
def test_a_session_is_audited_with_the_numbers_of_its_run(session: Path) -> None:
    from reference.sessions import read_recorded

    (file,) = session.glob("*.mcap")
    recorded = read_recorded(file)
    for path in (session, file):
        (found,) = audit_recording(path, AuditRequest(names=("print", "live", "paper (D3)")))
        report = found.report
        assert report.recording == file.name
        assert {score.finger for score in report.touch} == {"thumb", "index"}
        for finger, contacts in recorded.contacts.items():
            live = next(s for s in report.touch if (s.finger, s.reading) == (finger, "live"))
            assert live.eda[: len(contacts)] == [contact.eda for contact in contacts]
        assert [score.reading for score in report.emg] == ["print", "live"]
        live_levels = report.emg[1].levels
        levels = [intent.level for intent in recorded.of(Intent)]
        assert live_levels[: len(levels)] == levels
        assert report.emg[1].maxima_of == "calibration"
        assert [score.reading for score in report.vest] == ["print"]
        assert report.vest[0].maxima_of == "calibration"


@pytest.mark.slow
def test_the_vest_of_a_session_is_compared_and_swept(session: Path, tmp_path: Path, capsys: Any) -> None:
    (report,) = reported(session, "--of", "vest", "--picture", tmp_path / "vest.png", capsys=capsys)
    scores = {score["reading"]: score for score in report["vest"]}
    assert list(scores) == list(READINGS["vest"])
    assert scores["print"]["lit_share"] > 0.2
    assert scores["linear"]["total"] != scores["print"]["total"]
    assert scores["faces exchanged"]["front_mean"] == pytest.approx(scores["print"]["back_mean"], rel=0.2)
    assert (tmp_path / "vest.png").stat().st_size > 10_000
    sweep = ("--sweep", "stages.mapping.options.first_steps=0,1,3", "--picture", tmp_path / "s.png")
    swept = reported(session, *sweep, capsys=capsys)[0]["vest"]
    assert [score["value"] for score in swept] == [0, 1, 3]
    sums = [sum(score["total"]) for score in swept]
    assert sums[0] < sums[1] < sums[2]
    # What another metric measures reaches the vest as well.
    words = (session, "--of", "vest", "--sweep", "stages.metric.name=paper,live")
    paper, live = reported(*words, capsys=capsys)[0]["vest"]
    assert (paper["maxima_of"], live["maxima_of"]) == ("recording", "calibration")
    assert paper["total"] != live["total"]
