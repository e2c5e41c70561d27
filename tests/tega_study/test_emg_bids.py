# mypy: allow-untyped-defs, allow-incomplete-defs, allow-untyped-calls, allow-untyped-decorators
"""Muscle signals of a study as EMG-BIDS: the validator's verdict, every sample, every event, all people at once."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("foxglove")
pytest.importorskip("edfio", reason="needs the extra formats")

import edfio

from reference.clipped import LEAD_NS, LENGTH_NS
from reference.command import call
from reference.sessions import rewritten
from tega.errors import RecordingError
from tega.recording.mcap_reader import McapReader
from tega_study.emg_bids.dataset import export_bids
from tega_study.emg_bids.signal import Muscles, read_muscles, write_edf
from tega_study.privacy import withdraw


@pytest.fixture
def folder(tmp_path: Path, clipped: Path) -> Path:
    return Path(shutil.copytree(clipped, tmp_path / "study"))


def table(path: Path) -> list[dict[str, str]]:
    head, *rows = (line.split("\t") for line in path.read_text().splitlines())
    return [dict(zip(head, row, strict=True)) for row in rows]


def validated(folder: Path) -> dict[str, Any]:
    """Return the report of the BIDS validator; skip without it."""
    program = Path(sys.executable).with_name("bids-validator-deno")
    found = str(program) if program.is_file() else shutil.which("bids-validator-deno")
    if found is None:
        pytest.skip("needs the package bids-validator-deno")
    done = subprocess.run(
        [found, str(folder), "--format", "json"], check=False, capture_output=True, text=True, timeout=120
    )
    report: dict[str, Any] = json.loads(done.stdout)
    return report


def test_the_validator_finds_no_error_in_all_people_of_a_study(capsys, folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "bids"
    printed, _ = call(capsys, "study", "export", folder, "--out", out, "--bids")
    assert printed.strip() == f"{out}: 2 people, 4 runs"
    report = validated(out)
    issues = report["issues"]["issues"]
    assert [one for one in issues if one["severity"] == "error"] == []
    assert report["summary"]["schemaVersion"]
    assert len(report["summary"]["subjects"]) == 2
    assert report["summary"]["modalities"] == ["emg"] or "EMG" in str(report["summary"]["modalities"]).upper()
    # It does see what is wrong.
    side = next(out.rglob("*_emg.json"))
    content = json.loads(side.read_text())
    del content["EMGReference"]
    side.write_text(json.dumps(content))
    found = validated(out)["issues"]["issues"]
    assert [one["subCode"] for one in found if one["severity"] == "error"] == ["EMGReference"]


def test_every_sample_is_there_to_half_a_step_and_every_event_at_its_time(folder, tmp_path, recording):
    made = export_bids(folder, tmp_path / "bids")
    assert made.people == ("sub-p01", "sub-p02")
    for path in made.runs:
        chunks = [m.value for m in McapReader(recording).messages() if m.topic == "/emg/samples"]
        wanted = np.concatenate([np.array(one.samples).reshape(-1, one.n_channels) for one in chunks])
        edf = edfio.read_edf(path)
        assert edf.signals[0].sampling_frequency == 1000
        for signal, column in zip(edf.signals, wanted.T, strict=True):
            step = (signal.physical_max - signal.physical_min) / 65535
            assert step < 2 * np.abs(column).max() / 65535 * 1.01
            assert np.abs(signal.data[: len(column)] - column).max() <= step / 2 * 1.0001
            assert signal.physical_dimension == "uV"
        stem = str(path).removesuffix("_emg.edf")
        channels = table(Path(f"{stem}_channels.tsv"))
        assert [row["name"] for row in channels] == [signal.label for signal in edf.signals]
        electrodes = table(path.parent / f"{path.parents[1].name}_electrodes.tsv")
        assert [f"EMG {row['name']}" for row in electrodes] == [row["name"] for row in channels]
        events = {row["trial_type"]: row for row in table(Path(f"{stem}_events.tsv"))}
        # The trial begins LEAD_NS after the session of its recording; the first sample is complete a period after it.
        start_s = LEAD_NS / 1e9 - 0.001
        assert float(events["trial"]["onset"]) == pytest.approx(start_s, abs=1e-6)
        assert float(events["trial"]["duration"]) == LENGTH_NS / 1e9
        assert float(events["slip"]["onset"]) == pytest.approx(start_s + 0.5, abs=1e-6)
    people = table(tmp_path / "bids" / "participants.tsv")
    assert [row["participant_id"] for row in people] == list(made.people)


def test_lost_samples_are_zero_and_named_and_those_that_contradict_each_other_an_error(tmp_path, recording):
    def read(first: Callable[[int], int]) -> Muscles | None:
        def change(topic: str, value: Any) -> Any:
            if topic == "/emg/samples":
                value.first_index = first(value.first_index)
            return value

        return read_muscles(rewritten(recording, tmp_path / f"{first(600)}.mcap", change))

    with pytest.raises(RecordingError, match="sample 0 follows sample"):
        read(lambda _index: 0)
    muscles = read(lambda index: index + 250 * (index >= 500))
    assert muscles is not None
    assert [(gap.duration_s, gap.kind) for gap in muscles.gaps] == [(0.25, "lost")]
    at = round(muscles.gaps[0].onset_s * 1000)
    assert not muscles.samples[at : at + 250].any()
    assert muscles.samples[at + 250].any()
    gaps = write_edf(tmp_path / "x.edf", muscles._replace(samples=muscles.samples[:-30]))
    assert [(gap.kind, round(gap.duration_s, 9)) for gap in gaps][-1] == ("padding", (-1720 % 100) / 1000)


def test_who_has_withdrawn_is_not_in_it_and_without_signals_nothing_is_left(folder, tmp_path):
    withdraw(folder, "p01")
    assert export_bids(folder, tmp_path / "bids").people == ("sub-p02",)
    for path in (folder / "recordings").rglob("*.mcap"):
        path.unlink()
    with pytest.raises(RecordingError, match="no muscle signals"):
        export_bids(folder, tmp_path / "empty")
    assert not (tmp_path / "empty").exists()
