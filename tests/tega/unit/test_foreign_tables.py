"""Tables as other programs write them: what is a channel, what is refused, and when each sample was; other formats."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reference.command import call
from reference.emg_writers import xdf_header
from reference.xdf_file import Received, write_xdf
from tega.config import check_tree
from tega.devices.emg.emg_file import EmgFile, EmgFileOptions
from tega.errors import MissingExtraError, RecordingError
from tega.loop import run_session
from tega.records import HeardMarker, Intent
from tega.records.bus import Bus
from tega.runtime.files.formats import OTHERS as OTHER_FORMATS
from tega.runtime.files.signals import Signals, read_signals
from tega.runtime.files.tables.header import stated_rate
from tega.runtime.files.tables.table import Reading
from tega.runtime.files.tables.timing import lost_by_counter

RATE_HZ = 250.0
N = 1500
_RNG = np.random.default_rng(42)
EMG = (
    _RNG.normal(size=(N, 3)) * np.interp(np.arange(N), [0, 400, 800, 1500], [5, 300, 20, 250])[:, None]
).round(2)
T_S = np.arange(N) / RATE_HZ

Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def written(
        rows: Sequence[Sequence[Any]], head: str = "", *, sep: str = ",", comma: bool = False, **how: Any
    ) -> Path:
        path = tmp_path / str(how.get("name", "a.csv"))
        cells = [
            [f"{c:.{how.get('digits', 4)}f}" if isinstance(c, float) else str(c) for c in row] for row in rows
        ]
        lines = [sep.join(c.replace(".", ",") if comma else c for c in row) for row in cells]
        text = (f"{head}\n" if head else "") + "\n".join(lines) + "\n"
        path.write_bytes(text.encode(how.get("encoding", "utf-8")))
        return path

    return written


def timed(times_s: Any = T_S, emg: Any = EMG) -> list[list[Any]]:
    return [[float(t), *map(float, row)] for t, row in zip(times_s, emg, strict=True)]


def same(signals: Signals, emg: Any = EMG) -> Signals:
    np.testing.assert_allclose(signals.samples, emg[:, : signals.samples.shape[1]], atol=1e-9)
    return signals


@pytest.mark.parametrize("sep", [";", "\t", " ", ","])
def test_decimal_commas_are_read_whatever_stands_between_them(sep: str, write: Write) -> None:
    found = same(read_signals(write(EMG.tolist(), sep=sep, comma=True, digits=2)))
    assert found.decision.words == "3 channels: decimal comma"
    same(read_signals(write(EMG[:, :1].tolist(), comma=True, digits=2)))
    same(read_signals(write([[f"{v:g}".replace(".", ",")] for v in EMG[:, 0].tolist()])))


def test_a_comma_that_may_be_either_is_asked_about(write: Write) -> None:
    path = write([[str(12 + k), str(11 + k * 7 % 80)] for k in range(20)])
    with pytest.raises(RecordingError, match=r"a decimal comma or 2 columns .*set decimal to comma or point"):
        read_signals(path)
    assert read_signals(path, Reading(decimal="comma")).samples[0, 0] == 12.11
    assert read_signals(path, Reading(decimal="point")).samples[0].tolist() == [12.0, 11.0]


@pytest.mark.parametrize(
    "encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-be", "utf-16-le", "latin-1", "cp1252"]
)
def test_encodings(encoding: str, write: Write) -> None:
    path = write(timed(), "Zeit [s];a [µV];b [µV];c [µV]", sep=";", comma=True, encoding=encoding)
    found = same(read_signals(path))
    assert found.rate_hz == RATE_HZ
    assert found.decision.unit == "µV"


OTHERS = "X [s]|Package Num|SampleIndex|Zeit [s]|Fz|restimulus|accx|Unnamed: 0||t|gyro_x|Trigger|battery|gesture_id"


@pytest.mark.parametrize("name", OTHERS.split("|"))
def test_names_of_other_things_are_no_channels(name: str, write: Write) -> None:
    # A column without a name is judged by its values alone.
    for first in (T_S * 1000, *([np.random.default_rng(5).normal(size=N)] if name else [])):
        path = write(
            [[float(f), *map(float, row)] for f, row in zip(first[:500], EMG[:500], strict=True)],
            f"{name},ch1,ch2,ch3",
        )
        found = same(read_signals(path), EMG[:500])
        assert found.channels == (2, 3, 4)
        assert found.decision.words.startswith("3 channels of 4 columns: ")


@pytest.mark.parametrize(
    "name", ["ECR", "FCU left", "EMG_1 (uV)", "Avanti sensor 1: EMG 1", "RT FLEX", "pronator teres", "CH3"]
)
def test_names_of_muscles_are_channels(name: str, write: Write) -> None:
    assert read_signals(write(EMG[:, :1].tolist(), name)).channels == (1,)


def test_columns_that_rise_evenly_or_hold_labels_are_no_channels(write: Write) -> None:
    rows = [[k % 256, *map(float, row), k // 300] for k, row in enumerate(EMG)]
    found = same(read_signals(write(rows)))
    assert found.decision.words == "3 channels of 5 columns: column 1 counts, column 5 is a label"


def test_whole_numbers_and_ramps_are_samples_and_a_header_of_numbers_is_none(write: Write) -> None:
    ramps = np.arange(300.0).reshape(100, 3)
    for numbers in (ramps, _RNG.integers(-128, 128, (400, 8)), _RNG.integers(1900, 2100, (400, 2))):
        np.testing.assert_array_equal(read_signals(write(numbers.tolist())).samples, numbers)
    for head in ("0,1,2", "3,6,8"):
        same(read_signals(write(EMG.tolist(), head, digits=2)))


def test_a_mix_of_named_and_unnamed_muscles_is_asked_about(write: Write) -> None:
    path = write(EMG.tolist(), "EMG1,EMG2,something")
    with pytest.raises(RecordingError, match=r'"something" may be EMG too; name the channels, such as 1,2'):
        read_signals(path)
    assert read_signals(path, Reading(channels=(1, 2, 3))).channels == (1, 2, 3)
    with pytest.raises(RecordingError, match=r"a row per value \(a long table\)"):
        read_signals(write(EMG.tolist(), "time,channel,value"))


def test_a_short_column_of_another_sensor_is_left_to_itself(write: Write) -> None:
    rows = [[*map(float, row), 0.01 * k if k < 300 else ""] for k, row in enumerate(EMG)]
    same(read_signals(write(rows, "ch1,ch2,ch3,accx")))
    same(read_signals(write(rows, "ch1,ch2,ch3,other"), Reading(channels=(1, 2, 3))))
    noise = [[*row[:3], -float(row[0]) if k < 300 else ""] for k, row in enumerate(rows)]
    with pytest.raises(
        RecordingError, match=r"column 4 ends at sample 300 of 1500: .*name the channels without it: 1,2,3"
    ):
        read_signals(write(noise, "ch1,ch2,ch3,ch4"))


def test_cells_without_a_number_are_missing_samples(write: Write) -> None:
    for word in ("NA", "nan", "", "#N/A", "null"):
        rows: list[list[Any]] = [list(map(float, row)) for row in EMG]
        rows[700][1] = word
        found = read_signals(write(rows, "a,b,c"))
        assert np.isnan(found.samples[700, 1])
        assert found.notes == ("1 cells have no number; they count as missing samples",)


def test_rows_of_channels_are_turned(write: Write, tmp_path: Path) -> None:
    same(read_signals(write(EMG.T.tolist(), digits=2)))
    for n, words in ((3, "3 channels: each row is a channel"), (1, "")):
        np.save(tmp_path / "a.npy", EMG[:400, :n].T)
        assert same(read_signals(tmp_path / "a.npy"), EMG[:400, :n]).decision.words == words
    np.save(tmp_path / "b.npy", np.zeros((100, 130)))
    with pytest.raises(RecordingError, match="either can be the samples; set rows"):
        read_signals(tmp_path / "b.npy")
    assert read_signals(tmp_path / "b.npy", Reading(rows="channels")).samples.shape == (130, 100)


def test_the_files_time_gives_the_rate_and_contradicts_another(write: Write) -> None:
    path = write(timed(), "time_s,a,b,c")
    assert read_signals(path).rate_hz == RATE_HZ
    with pytest.raises(
        RecordingError, match=r'"time_s" says 250 samples/s, 1000 were stated; leave the rate out'
    ):
        read_signals(path, Reading(rate_hz=1000.0))
    assert read_signals(path, Reading(rate_hz=1000.0, time="none")).rate_hz == 1000.0
    for unit, scale in (("s", 1.0), ("ms", 1e3), ("us", 1e6)):
        for head in (f"time_{unit},a,b,c", f"Time [{unit}],a,b,c", "time,a,b,c"):
            assert read_signals(write(timed(T_S * scale), head)).rate_hz == RATE_HZ


OPEN_SIGNALS = '# {"00:07": {"sensor": ["EMG", "EMG", "EMG"], "column": ["nSeq", "DI", "CH1", "CH2", "CH3"]}}'
BIOPAC = "a.acq\n4 msec/sample\n3 channels\na\nmV\nb\nmV\nc\nmV\nmin\tCH1\tCH2\tCH3\n\t1500\t1500\t1500"


@pytest.mark.parametrize(
    ("head", "row"),
    [
        ("", "10:30:{t:06.3f} -> {a},{b},{c}"),  # Arduino IDE
        ("Time,a,b,c", "12/01/2026 10:30:{t:06.3f} PM,{a},{b},{c}"),
        ("Zeit;a;b;c", "01.12.2026 10:30:{t:06.3f};{a};{b};{c}"),
        ("timestamp_us,a,b,c", "{us},{a},{b},{c}"),  # since a board was switched on
        ("micros,a,b,c", "{us},{a},{b},{c}"),
        ("Temps (s);a;b;c", "{t:.3f}|{a}|{b}|{c}"),  # French: 1\u202f234,50
        (BIOPAC, "{min:.7f}\t{a}\t{b}\t{c}"),
        ("ChannelTitle=\ta\tb\tc", "{t:.3f}\t{a}\t{b}\t{c}{note}"),  # LabChart
        ('"sep=\t"\nt\ta_EMG\tb_EMG\tc_EMG\t\nms\tmV\tmV\tmV\t', "{ms}\t{a}\t{b}\t{c}\t"),  # Shimmer
        (f"{OPEN_SIGNALS}\n# sampling rate: 250", "{k}\t0\t{a}\t{b}\t{c}\t"),
    ],
)
def test_tables_of_other_programs(head: str, row: str, tmp_path: Path) -> None:
    lines, values = [head] if head else [], EMG * 10
    for k, (t, sample) in enumerate(zip(T_S.tolist(), values.tolist(), strict=True)):
        a, b, c = (f"{v:_.2f}" if "Temps" in head else f"{v:.2f}" for v in sample)
        more = {"us": 1_020_000_000 + round(t * 1e6), "ms": round(t * 1e3), "min": t / 60, "k": k % 16}
        lines.append(row.format(t=t, a=a, b=b, c=c, note="\t#* squeeze" if k == 700 else "", **more))
    french = str.maketrans("_.|", "\u202f,;") if "Temps" in head else {}
    (tmp_path / "a.txt").write_text("\n".join(lines).translate(french) + "\n")
    found = same(read_signals(tmp_path / "a.txt"), values)
    assert (len(found.samples), found.channels[-1] - found.channels[0], found.rate_hz) == (N, 2, RATE_HZ)


def test_lines_before_the_samples_and_what_is_no_table_of_them(write: Write) -> None:
    listed = [[f"[{a:.2f}", f"{b:.2f}", f"{c:.2f}]"] for a, b, c in EMG.tolist()]
    with pytest.raises(RecordingError, match=r"a number among signs: '\[.*name the channels"):
        read_signals(write(listed, sep=" "))
    assert read_signals(write([[*row, "", ""] for row in EMG.tolist()], "a,b,c,,")).channels == (1, 2, 3)
    rows = [[k, *row, -row[0]] for k, row in enumerate(EMG.tolist())]
    for head in ("Sample #,EMG #1,EMG #2,EMG #3,Acc X", "Sample\tEMG1\tEMG2\tEMG3\tAcc X"):
        assert read_signals(write(rows, head)).channels == (2, 3, 4)
    notes = read_signals(write(rows, "k,a [mV],b [uV],c,Acc X")).notes
    assert notes[1] == "channels have several units: mV, uV, none"
    stated = {"Sample rate: 1,000 Hz": 1000.0, "fs = 2.000": 2000.0, "2,148.15 Hz": 2148.15}
    assert {line: stated_rate([line]) for line in stated} == stated
    assert not any(stated_rate([line]) for line in ("Notch frequency: 50 Hz", "High-pass 20 Hz", "20-450 Hz"))


def test_arrays_with_times_of_any_unit_and_columns_of_one_name(tmp_path: Path) -> None:
    import h5py
    import pyarrow as pa
    from pyarrow import parquet

    for name, scale in (("time", 1e3), ("timestamps_us", 1e6), ("t", 1.0), ("timestamp_ns", 1e9)):
        arrays: Any = {"emg": EMG, name: T_S * scale}
        np.savez(tmp_path / "a.npz", **arrays)
        assert same(read_signals(tmp_path / "a.npz")).rate_hz == RATE_HZ
    vectors: Any = dict(zip(("emg_c", "emg_b", "emg_a"), EMG.T, strict=True))
    np.savez(tmp_path / "a.npz", **vectors, t=T_S, force=T_S)
    assert same(read_signals(tmp_path / "a.npz")).rate_hz == RATE_HZ
    with h5py.File(tmp_path / "a.h5", "w", track_order=True) as file:
        file.attrs["fs"] = RATE_HZ
        file.update(vectors)
    assert same(read_signals(tmp_path / "a.h5")).rate_hz == RATE_HZ
    parquet.write_table(pa.table(list(map(pa.array, EMG.T)), names=["emg"] * 3), tmp_path / "a.parquet")
    same(read_signals(tmp_path / "a.parquet"))
    with h5py.File(tmp_path / "a.nwb", "w") as file:
        file["acquisition/emg/data"] = EMG
        file["acquisition/emg/starting_time"] = 0.0
        file["acquisition/emg/starting_time"].attrs["rate"] = RATE_HZ
    assert same(read_signals(tmp_path / "a.nwb")).rate_hz == RATE_HZ


def test_losses_are_gaps_in_the_numbers_of_samples(write: Write) -> None:
    kept = np.r_[0:700, 950:N]
    path = write(timed(T_S[kept], EMG[kept]), "time_s,a,b,c")
    found = read_signals(path)
    assert found.decision.faults == ["250 samples were lost in 1 gap, the longest 1000 ms"]
    assert found.starts == [(0, 0), (700, 950)]
    with EmgFile(EmgFileOptions(file=path)) as source:
        chunks = [source.read(0.0) for _ in range(60)]
        assert source.ended
    taken = [(c.first_index, len(c.samples)) for c in chunks if c is not None]
    assert [n for first, many in taken for n in range(first, first + many)] == kept.tolist()


def test_a_counter_shows_losses_that_times_do_not(write: Write) -> None:
    kept = np.r_[0:700, 740:N]
    rows = [[k % 256, *map(float, EMG[k])] for k in kept.tolist()]
    found = read_signals(write(rows, "Sample Index,a,b,c"), Reading(rate_hz=RATE_HZ))
    assert found.decision.faults == ["40 samples were lost in 1 gap, the longest 160 ms"]
    damaged = np.arange(200.0)
    damaged[120] = 1e300
    assert lost_by_counter(damaged) == []


def test_rows_that_came_twice_and_clocks_that_step_back_are_reported(write: Write) -> None:
    twice = np.repeat(np.arange(N), 2)
    found = same(read_signals(write(timed(T_S[twice], EMG[twice]), "time_s,a,b,c")))
    assert found.decision.faults == ["1500 rows came twice, with their times; used once"]
    found = same(read_signals(write(timed(T_S - 2.0 * (np.arange(N) >= 900)), "time_s,a,b,c")))
    (fault,) = found.decision.faults
    assert fault == '"time_s" steps back 1 time, the furthest by 2 s at sample 901; samples are counted on'


def test_samples_that_share_a_stamp_are_no_losses(write: Write) -> None:
    late = np.random.default_rng(2).uniform(0, 0.003, N)
    for times_s in (np.arange(N) // 10 * 0.04, T_S + late, np.floor(T_S)):
        found = same(read_signals(write(timed(times_s), "time_s,a,b,c")))
        assert found.rate_hz == pytest.approx(RATE_HZ, rel=1e-3)
        assert found.decision.faults == []


def test_a_jump_of_hours_is_refused(write: Write) -> None:
    times_s = T_S + 90_000.0 * (np.arange(N) >= 900)
    with pytest.raises(RecordingError, match=r"jumps by 25 h between samples 900 and 901; cut the file"):
        read_signals(write(timed(times_s), "time_s,a,b,c"))


def levels(emg: dict[str, Any], tmp_path: Path) -> tuple[list[Intent], list[HeardMarker], dict[str, Any]]:
    bus, intents, markers = Bus(), list[Intent](), list[HeardMarker]()
    bus.subscribe(Intent, intents.append)
    bus.subscribe(HeardMarker, markers.append)
    tree = {
        "session": {"pace": "fast", "out_dir": str(tmp_path / "out")},
        "emg": {"driver": "emg-file", "kind": "raw", "options": emg},
    }
    summary = run_session(check_tree(tree, {}, base=tmp_path).config, bus=bus)
    return intents, markers, summary


def test_levels_fall_at_the_files_times(write: Write, tmp_path: Path) -> None:
    # A crystal that is 2 % slow: the rate that was given stays, the times are the file's.
    path = write(timed(T_S * 1.02), "time_s,a,b,c", digits=6)
    slow, _, _ = levels({"file": str(path), "rate_hz": RATE_HZ}, tmp_path)
    at_s = np.array([one.t_ns for one in slow]) / 1e9
    np.testing.assert_allclose(at_s, (np.arange(1, 61) * 0.1) * 1.02, atol=0.012)


def test_a_loss_longer_than_a_second_takes_its_time(write: Write, tmp_path: Path) -> None:
    times_s = T_S + 3.0 * (np.arange(N) >= 750)
    path = write(timed(times_s), "time_s,a,b,c")
    found, _, summary = levels({"file": str(path)}, tmp_path)
    assert found[-1].t_ns == 9_000_000_000
    assert summary["emg"]["missing"] == 750
    assert any("750 samples were lost in 1 gap" in note for note in summary["notes"])


def test_markers_of_an_xdf_file_are_heard_at_their_times(tmp_path: Path) -> None:
    amp = Received(xdf_header("amp", "EMG", 3), EMG.tolist(), (50.0 + T_S).tolist())
    marks = Received(xdf_header("buttons", "Markers", 1, rate_hz=0.0), [[7.0], [8.0]], [51.0, 53.5])
    write_xdf(tmp_path / "a.xdf", [marks, amp])
    _, markers, _ = levels({"file": str(tmp_path / "a.xdf")}, tmp_path)
    assert [(one.t_ns, one.text) for one in markers] == [(1_000_000_000, "7.0"), (3_500_000_000, "8.0")]
    write_xdf(tmp_path / "a.xdf", [amp, amp])  # an outlet that was started again
    with pytest.raises(RecordingError, match=r"no single stream is called 'amp'; .* give the number of one"):
        read_signals(tmp_path / "a.xdf", Reading(variable="amp"))
    same(read_signals(tmp_path / "a.xdf", Reading(variable="2")))


def test_interrupted_edf_keeps_its_times(tmp_path: Path) -> None:
    import edfio

    signal = edfio.EdfSignal(EMG[:, 0], RATE_HZ, label="EMG", physical_range=(-2000, 2000))
    edfio.Edf([signal], annotations=[edfio.EdfAnnotation(4.5, None, "squeeze")]).write(tmp_path / "a.edf")
    whole = (tmp_path / "a.edf").read_bytes().replace(b"EDF+C", b"EDF+D")
    for second in (5, 4, 3):
        whole = whole.replace(f"+{second}\x14\x14".encode(), f"+{second + 2}\x14\x14".encode())
    (tmp_path / "b.edf").write_bytes(whole)
    found = read_signals(tmp_path / "b.edf")
    assert found.decision.faults == ["500 samples were lost in 1 gap, the longest 2000 ms"]
    assert found.starts == [(0, 0), (750, 1250)]
    commas = (tmp_path / "a.edf").read_bytes().replace(b"-2000   ", b"-2000,0 ")
    (tmp_path / "b.edf").write_bytes(commas)
    np.testing.assert_allclose(read_signals(tmp_path / "b.edf").samples, EMG[:, :1], atol=0.05)
    (tmp_path / "b.edf").write_bytes(whole[:244] + b"0".ljust(8) + whole[252:])
    with pytest.raises(RecordingError, match="its records last 0 s"):
        read_signals(tmp_path / "b.edf")
    (tmp_path / "b.edf").write_bytes(commas.replace(b"-2000,0", b"none   "))
    assert read_signals(tmp_path / "b.edf").decision.unit == "counts"


def test_inspect_prints_the_decision(write: Write, capsys: pytest.CaptureFixture[str]) -> None:
    rows = [[t, k, *row] for k, (t, *row) in enumerate(timed())]
    path = write(rows, "time [s];Counter;a;b;c", sep=";", comma=True)
    text, _ = call(capsys, "emg", "inspect", path)
    assert '3 channels of 5 columns: "time [s]" is time, "Counter" counts; decimal comma' in text
    reported = json.loads(call(capsys, "emg", "inspect", path, "--json")[0])
    assert (reported["channels"], reported["time"], reported["counter"]) == ([3, 4, 5], 1, 2)
    assert (reported["rate_hz"], reported["facts"]["decimal"]) == (250.0, "comma")
    kinds = json.loads(call(capsys, "emg", "inspect", "--json")[0])
    assert {"EDF", "XDF", "HDF5"} <= {one["name"] for one in kinds}


def test_text_takes_little_more_memory_than_its_numbers(write: Write) -> None:
    import tracemalloc

    path = write(np.random.default_rng(1).normal(0, 100, (1000, 6)).tolist())
    path.write_bytes(path.read_bytes() * 100)
    read_signals(write(EMG.tolist(), name="b.csv"))  # imports are not of the file
    tracemalloc.start()
    found = read_signals(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    # Two MiB of text are lines at a time, whatever the file's size: that is the rest.
    assert peak < 2 * found.samples.nbytes + 16 * 2**20


def test_formats_that_are_not_read_are_named_with_the_way_out(tmp_path: Path) -> None:
    for ending, (name, route) in OTHER_FORMATS.items():
        (path := tmp_path / f"a{ending}").write_bytes(b"\x01\x02\x03")
        with pytest.raises(RecordingError) as caught:
            read_signals(path)
        assert (caught.value.message, caught.value.hint) == (f"a{ending}: {name} is not read as EMG", route)


def test_a_missing_library_is_named_with_its_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "h5py", None)
    (tmp_path / "a.h5").write_bytes(b"\x89HDF\r\n\x1a\n")
    with pytest.raises(MissingExtraError, match=r"needs the package 'h5py'.*pip install 'tega\[formats\]'"):
        read_signals(tmp_path / "a.h5")
