# mypy: allow-untyped-defs, allow-incomplete-defs, allow-untyped-calls, allow-untyped-decorators
"""The bench: what it measures is what it says, and nothing here depends on how fast that is."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
import tomllib
from functools import partial
from pathlib import Path

import msgspec
import numpy as np
import pytest
from click.testing import CliRunner

from tega.haptics import FINGERS
from tega_figures.bench import command as cli_bench
from tega_figures.bench import (
    filters,
    peers,
    report,
    scenes,
    simulation,
    tables,
    tick,
    timing,
    variants,
    widths,
)
from tega_figures.bench.machine import processor_s
from tega_figures.bench.variants import CONTACT_LAWS
from tega_figures.exact import exact_contact

SMALL = (24, 32)


@pytest.mark.slow
@pytest.mark.parametrize("name", peers.MAKERS)
@pytest.mark.parametrize("law", CONTACT_LAWS, ids=lambda law: law.name)
def test_a_peer_computes_the_same_thing(name, law):
    """Up to its own rounding: 8-bit grey is off by a tenth, anything better by far less."""
    needs, _ = peers.MAKERS[name]
    pytest.importorskip(needs, reason=f"{needs} is not installed")
    size = (120, 160)
    kernel = peers.contact_peers(law, size)[name]
    tolerance = 0.5 if "8-bit" in name else 1e-4
    for frame, baseline in scenes.scenes(size):
        error = variants.measure_error(
            kernel(frame, baseline), exact_contact(frame, baseline, **law._asdict())
        )
        assert error is not None
        assert max(error.centroid_px, error.spread_relative, error.cci_relative) < tolerance


def test_a_peer_without_an_answer_has_no_error_and_the_worst_is_of_each_number():
    truth = exact_contact(*scenes.scenes((160, 120))[0], **CONTACT_LAWS[0]._asdict())
    assert variants.measure_error(peers.NONE, truth) is None
    dark = np.zeros((*SMALL, 3), np.uint8)
    for kernel in peers.contact_peers(CONTACT_LAWS[0], SMALL).values():
        assert variants.measure_error(kernel(dark, dark), truth) is None
    assert variants.worst([None]) is None

    def error(*values):
        return variants.ContactError(
            **dict(zip(variants.ContactError.__struct_fields__, values, strict=True))
        )

    assert variants.worst([error(1.0, 0.0, 3.0, 0.5), error(0.0, 2.0, 1.0, 0.7)]) == error(1.0, 2.0, 3.0, 0.7)


@pytest.mark.parametrize("place", [(0, 0, 0), (7, 7, 2)], ids=str)
def test_a_floor_reads_all_of_both_images(place):
    frame, baseline = np.zeros((2, 8, 8, 3), np.uint8)
    read, by_numpy = variants.floor_kernels((frame, baseline)).values()
    assert (read(), by_numpy()) == (0, 0)
    baseline[place] = 1
    assert by_numpy() in {1, 1 << 56}
    frame[place] = 1
    assert read() != 0


def test_every_filter_answers_as_the_exact_one():
    samples = filters.signal(120)
    truth = filters.true_response(samples)
    for run in filters.filters(samples[0]).values():
        passed = np.concatenate([run(block) for block in np.split(samples, 12)])
        assert passed.shape == samples.shape
        assert filters.error_of_full_scale(passed, truth, 4096.0) < 1e-11


@pytest.mark.parametrize("reading", ["live", "paper"])
def test_a_tick_makes_packets_of_the_fingers_that_are_pressed(reading):
    for pressed in (0, 1, len(FINGERS)):
        one = tick.Tick(reading, pressed)
        for _ in range(tick.PICTURES):
            stages, packet, data = one.run()
        assert len(stages) == len(tick.STAGES)
        assert (len(packet), len(data)) == (20, 32)
        assert any(packet) == (pressed > 0)


def test_turns_are_fair_and_counted():
    calls: list[str] = []
    turns = timing.take_turns({n: partial(calls.append, n) for n in "ab"}, budget_s=1e-9)
    n_rounds = timing.FEWEST_ROUNDS
    assert all(len(t) == n_rounds and {len(turn) for turn in t} == {4} for t in turns.values())
    assert calls.count("a") == calls.count("b") == timing.WARM_ROUNDS + n_rounds * timing.CALLS_PER_TURN
    timed = "".join(calls[2 * timing.WARM_ROUNDS :])
    assert timed == "aaaaabbbbb" + "bbbbbaaaaa" + "aaaaabbbbb"
    found = timing.timing([[1000, 3000], [2000, 4000]])
    assert (found.median_us, found.n_calls) == (2.5, 4)
    # A round in which the machine was twice as slow for both changes nothing.
    assert timing.ratio([[30, 30], [60, 60]], [[10, 10], [20, 20]]) == 3.0


@pytest.mark.slow
def test_what_is_not_installed_is_listed_and_left_out(monkeypatch):
    monkeypatch.setattr(report, "SIZES", scenes.SIZES[:1])
    monkeypatch.setattr(widths, "WIDTHS", widths.WIDTHS[:1])
    monkeypatch.setattr(timing, "MOST_ROUNDS", 3)
    absent = {"cv2", "numba", "scipy"}
    found = importlib.util.find_spec
    for module in (report, peers, filters):
        monkeypatch.setattr(module, "find_spec", lambda name: None if name in absent else found(name))
    for name in (*absent, "threadpoolctl"):
        monkeypatch.setitem(sys.modules, name, None)
    measured = report.run_bench(quick=True)
    assert set(measured.missing) == absent
    assert {row.variant for row in measured.emg} == {"TEGA"}
    assert all(0 < row.error_of_full_scale < 1e-13 for row in measured.emg)
    assert "NumPy, tuned" in {row.variant for row in measured.contact}
    assert measured.threads == {"BLAS": "not limited: threadpoolctl is not installed"}


@pytest.mark.slow
def test_the_verb_prints_what_its_help_says(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(report, "SIZES", scenes.SIZES[:1])
    monkeypatch.setattr(widths, "WIDTHS", widths.WIDTHS[:1])
    monkeypatch.setattr(timing, "MOST_ROUNDS", 3)
    picture = tmp_path / "pareto.png"
    done = CliRunner().invoke(
        cli_bench.bench, ["--quick", "--json", "--picture", str(picture)], catch_exceptions=False
    )
    assert done.exit_code == 0
    printed = json.loads(done.stdout)
    assert set(printed) == {f.name for f in msgspec.structs.fields(report.BenchReport)}
    help_text = CliRunner().invoke(cli_bench.bench, ["--help"]).stdout
    for part in (printed, printed["machine"], printed["contact"][0], printed["contact"][0]["error"]):
        assert all(key in help_text for key in part)
    for part in ("widths", "emg", "batches", "tick"):
        assert all(key in help_text for key in printed[part][0])
    ours = [row for row in printed["contact"] if row["variant"].startswith("TEGA") and row["error"]]
    assert {row["error"]["eda_pixels"] for row in ours} == {0.0}
    assert {row["reading"] for row in ours} == {*(law.name for law in CONTACT_LAWS), "presets"}
    floors = [row for row in printed["contact"] if row["variant"] == report.FLOOR]
    assert {row["to_floor"] for row in floors} == {1.0}
    assert {(row["reading"], row["n_in_contact"]) for row in printed["tick"]} == {
        (reading, n) for reading in ("live", "paper") for n in range(5)
    }
    assert all(set(row["stages_us"]) == set(tick.STAGES) for row in printed["tick"])
    assert picture.read_bytes().startswith(b"\x89PNG")

    tables.print_bench(msgspec.convert(printed, report.BenchReport))
    text = capsys.readouterr().out
    named = ("TEGA, bilinear", "NumPy, as printed", report.FLOOR, "EMG low-pass", "in contact", "take turns")
    assert all(name in text for name in named)


@pytest.fixture
def benches(monkeypatch):
    folder = Path(__file__).resolve().parents[2] / "benches"
    if not folder.is_dir():
        pytest.skip("no benches beside the tests: not a checkout")
    monkeypatch.syspath_prepend(folder)
    return importlib.import_module


def test_counts_are_committed_for_both_paths_and_one_off_by_more_than_the_tolerance_is_told(benches):
    counts = benches("counts")
    committed = {"a": {"avx2": 1000, "baseline": 5000}, "gone": {"baseline": 10}}
    counted = {"a": {"avx2": 1019, "baseline": 4800}, "new": {"baseline": 7}}
    ok = {(row.kernel, row.path): row.ok for row in counts.verdicts(committed, counted)}
    wrong = [("a", "baseline"), ("gone", "baseline"), ("new", "baseline")]
    assert ok == {("a", "avx2"): True, **dict.fromkeys(wrong, False)}
    # A path that this processor lacks is not judged.
    (avx2, baseline) = counts.verdicts({"a": {"avx2": 1000, "baseline": 5000}}, {"a": {"baseline": 5000}})
    assert (avx2.ok, avx2.change, baseline.ok) == (True, None, True)
    committed = tomllib.loads(counts.COMMITTED.read_text(encoding="utf-8"))["counts"]
    tactile = [kernel for kernel in committed if kernel.endswith(counts.SIZE)]
    assert len(tactile) >= 7
    for kernel in tactile:
        assert committed[kernel]["avx2"] < committed[kernel]["baseline"]


@pytest.mark.slow
def test_the_time_of_a_simulated_lift_adds_up():
    pytest.importorskip("mujoco", reason="needs the extra tega[sim]")
    from tega_sim.world import World

    advance_to = World.advance_to
    done = CliRunner().invoke(cli_bench.bench, ["sim", "--objects", "bag", "--repeats", "1", "--json"])
    assert done.exit_code == 0, done.output
    report = json.loads(done.output)
    whole, grasping = report["rows"]
    assert (whole["object"], whole["part"], grasping["part"]) == ("bag", "whole", "grasping")
    assert 0 < grasping["simulated_s"] < whole["simulated_s"]
    for row in (whole, grasping):
        assert {"physics", "render", "tactile read", "EMG", "operator", "CAN bus"} <= set(row["stages_ms"])
        assert all(spent_ms > 0 for spent_ms in row["stages_ms"].values())
    assert [row["skip"] for row in report["skips"]] == [
        "untouched fingertips are not rendered",
        "their known frames are not measured",
    ]
    # What was timed is left as it was.
    assert World.advance_to is advance_to
    tables.print_simulation(msgspec.convert(report, simulation.SimReport))


@pytest.mark.words
def test_the_page_s_figures_are_those_of_the_committed_results(benches):
    figures = benches("figures")
    assert figures.PAGE.read_text(encoding="utf-8") == figures.made(), "python benches/figures.py --tables"
    results = json.loads(figures.RESULTS.read_text(encoding="utf-8"))
    assert msgspec.convert(results, report.BenchReport, strict=False).missing == []
    # What the page says of the kernels beside every peer.
    ours = [r for r in results["contact"] if r["variant"] == "TEGA"]
    assert all(r["to_best_peer"] < 1 for r in ours)


def test_a_bare_clock_in_a_process_of_its_own_tells_how_late_each_tick_was():
    from tega_figures.bench.witness import LateTicks, witness

    with witness() as clock:
        clock.begin(0.06)
        reported = clock.late()
    assert reported.ticks == sum(reported.late) == 20
    assert reported == LateTicks.of_bins(reported.late, worst_ms=reported.worst_ms)
    # By hand: two in the first bin, one each in those of 1 to 2 ms and of more than 100 ms.
    counted = LateTicks.of([0, 100_000, 1_000_001, 200_000_000])
    assert counted.late == (2, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 1)
    assert (counted.over_1_ms, counted.worst_ms) == (2, 200.0)


@pytest.mark.skipif(sys.platform != "linux", reason="read from /proc")
def test_the_time_of_a_program_counts_with_that_of_those_that_it_started():
    busy = (
        "import subprocess, sys, time; t = time.process_time()\nwhile time.process_time() - t < 0.05: pass\n"
    )
    inner = [sys.executable, "-c", busy + "sys.stdout.write('.'); sys.stdout.flush(); sys.stdin.read()"]
    outer = f"import subprocess; subprocess.run({inner!r})"
    with subprocess.Popen(
        [sys.executable, "-c", outer], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as program:
        assert program.stdin is not None
        assert program.stdout is not None
        assert program.stdout.read(1) == b"."
        assert processor_s([program.pid]) >= 0.05
        program.stdin.close()
