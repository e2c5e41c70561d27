"""The audit of muscles and of recorded sessions: the rules of the decoder, and the vest as the run had it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reference.audit import refused, reported
from reference.sessions import synthetic
from tega.config import load_config
from tega.records import Intent
from tega_figures.audit import READINGS, AuditRequest, audit_recording


@pytest.fixture
def squeeze(tmp_path: Path) -> Path:
    """Return a table of EMG at four efforts in turn."""
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
    """Return the folder of a recorded session with two fingers and EMG."""
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
