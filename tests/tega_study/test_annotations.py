# mypy: allow-untyped-defs, allow-incomplete-defs, allow-untyped-calls, allow-untyped-decorators
"""Events coded in BORIS and ELAN: states, modifiers, comments, and the forms in which spreadsheets hand them on."""

from __future__ import annotations

import gzip
import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pympi import Elan

from reference.command import call
from reference.sessions import record
from reference.written import boris_project as load_boris
from tega.errors import DeviceUnavailableError, RecordingError
from tega.recording.annotations import AnnotationFile, annotation_keys, annotations_path, read_annotations
from tega.runtime.files.annotations import CodedEvent, known_code
from tega.runtime.files.boris import BorisBehaviour, boris_observation, boris_project, read_boris
from tega.runtime.files.eaf import read_eaf, write_eaf
from tega_study.journal import Journal, JournalEvent, events_path
from tega_study.observers import read_observers
from tega_study.plan import make_plan, write_plan
from tega_study.score.accounts import agreements
from tega_study.score.boris import export_boris, export_elan, import_boris

CODES = ["slip", "deformation", "drop", "lift_off"]
HEAD = (
    "Observation id", "Observation date", "Time offset (s)", "Subject", "Behavior", "Modifier #1", "Behavior type",
    "Time", "Comment",
)  # fmt: skip
_FEW = settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
_WORD = st.text(st.characters(codec="utf-8", categories=("L", "N")), min_size=1, max_size=8)
_SPOKEN = st.text(st.characters(codec="utf-8", exclude_categories=("C", "Z")), max_size=20)


@st.composite
def coded(draw: st.DrawFn) -> list[CodedEvent]:
    """Draw events that do not overlap, on whole milliseconds, deformations as states."""
    events, t_ms = [], 0
    for _ in range(draw(st.integers(0, 12))):
        code = draw(st.sampled_from(CODES))
        t_ms += draw(st.integers(10, 900))
        lasts_ms = draw(st.integers(10, 700)) if code == "deformation" else 0
        modifiers = tuple(draw(st.lists(_WORD, max_size=2)))
        events.append(CodedEvent(t_ms / 1000, "", code, modifiers, draw(_SPOKEN), lasts_ms / 1000))
        t_ms += lasts_ms
    return events


def same(one: list[CodedEvent], other: list[CodedEvent]) -> None:
    assert [e._replace(t_s=0, duration_s=0) for e in one] == [e._replace(t_s=0, duration_s=0) for e in other]
    for name in ("t_s", "duration_s"):
        assert [getattr(e, name) for e in one] == pytest.approx([getattr(e, name) for e in other], abs=1e-6)


def row(code: str, kind: str, time: str, comment: str = "", offset: str = "0") -> list[str]:
    return ["p01_t01_a1", "2026-05-01", offset, "No focal subject", code, "", kind, time, comment]


ROWS = [
    row("deformation", "START", "2.000"),
    row("slip", "POINT", "3.000", "ü"),
    row("deformation", "STOP", "5.500"),
]
RIGHT = [CodedEvent(2.0, "", "deformation", (), "", 3.5), CodedEvent(3.0, "", "slip", (), "ü")]


def table(rows: list[list[str]], mark: str = "\t", before: str = "") -> str:
    return before + "\r\n".join(mark.join(one) for one in [list(HEAD), *rows]) + "\r\n"


FORMS: dict[str, bytes] = {
    "tab": table(ROWS).encode(),
    "comma": table(ROWS, ",").encode(),
    "Excel": table([[cell.replace(".", ",") for cell in one] for one in ROWS], ";").encode("cp1252"),
    "Excel with its first line": table(ROWS, ";", "sep=;\r\n").encode("utf-8-sig"),
    "UTF-16": table(ROWS).encode("utf-16"),
    "UTF-16 without a mark": table(ROWS).encode("utf-16-le"),
    "clock": table([[cell.replace("2.000", "00:00:02.000") for cell in one] for one in ROWS]).encode(),
    "offset": table([row(r[4], r[6], str(float(r[7]) + 10), r[8], "10") for r in ROWS]).encode(),
    "aggregated": (
        "Observation id\tSubject\tBehavior\tBehavior type\tStart (s)\tStop (s)\tComment start\n"
        "p01_t01_a1\tNA\tdeformation\tSTATE\t2.0\t5.5\t\np01_t01_a1\tNA\tslip\tPOINT\t3.0\tNA\tü\n"
    ).encode(),
    "old": (
        "Observation id\tp01_t01_a1\n\nMedia file(s)\n\nTime\tSubject\tBehavior\tComment\tStatus\n"
        "2.000\tx\tdeformation\t\tSTART\n5.500\tx\tdeformation\t\tSTOP\n3.0\t\tslip\tü\tPOINT\n"
    ).encode(),
}


@pytest.mark.parametrize("form", FORMS)
def test_every_form_of_a_table_gives_the_same_events(form: str, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(FORMS[form])
    (found,) = read_boris(path).values()
    same([event._replace(subject="") for event in found], RIGHT)


def test_comments_may_hold_anything(tmp_path: Path) -> None:
    comments = ["two\nlines", "a\u2028b", 'said "now"']
    rows = [row("slip", "POINT", "3.0", '"' + one.replace('"', '""') + '"') for one in comments]
    (tmp_path / "a.tsv").write_text(table(rows), encoding="utf-8", newline="")
    (events,) = read_boris(tmp_path / "a.tsv").values()
    assert [event.comment for event in events] == comments


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ([row("slip", "POINT", "nan")], "row 2: 'nan' is no time"),
        ([row("slip", "POINT", "inf")], "row 2: 'inf' is no time"),
        ([row("slip", "POINT", "NA")], "row 2: 'NA' is no time"),
        ([row("deformation", "STOP", "3")], r"'deformation' ends without a beginning at 3\.000 s"),
        ([row("deformation", "START", "3"), row("deformation", "START", "4")], "begins again before its end"),
        ([row("slip", "PERHAPS", "3")], "behaviour type 'PERHAPS'"),
    ],
)
def test_an_event_without_a_time_or_an_end_is_refused(rows, message, tmp_path):
    (tmp_path / "a.tsv").write_text(table(rows))
    with pytest.raises(RecordingError, match=rf"a\.tsv: .*{message}"):
        read_boris(tmp_path / "a.tsv")


@_FEW
@given(events=coded(), packed=st.booleans(), offset_s=st.sampled_from([0.0, 12.5]))
def test_a_project_keeps_what_was_coded(events, packed, offset_s, tmp_path):
    states = ["deformation"]
    project = boris_project(
        name="a", description="", behaviours=[BorisBehaviour(c, c[0], is_state=c in states) for c in CODES],
        observations={"one": boris_observation(events, length_s=30, variables={}, states=states)},
    )  # fmt: skip
    tree = json.loads(project)
    tree["observations"]["one"]["time offset"] = offset_s
    for event in tree["observations"]["one"]["events"]:
        event[0] += offset_s
    path = tmp_path / ("a.boris.gz" if packed else "a.boris")
    path.write_bytes(gzip.compress(json.dumps(tree).encode()) if packed else json.dumps(tree).encode())
    same(read_boris(path)["one"], events)


def test_a_bomb_of_zeros_is_not_unpacked(tmp_path: Path) -> None:
    (tmp_path / "a.boris.gz").write_bytes(gzip.compress(bytes((1 << 26) + 1)))
    with pytest.raises(RecordingError, match="more than 64 MiB when unpacked"):
        read_boris(tmp_path / "a.boris.gz")


@_FEW
@given(raters=st.dictionaries(st.sampled_from(["r1", "r2"]), coded(), max_size=2))
def test_elan_keeps_what_was_coded_and_pympi_reads_it(raters, tmp_path):
    path = tmp_path / "a.eaf"
    write_eaf(path, raters, codes=CODES, media="front.mp4")
    found = read_eaf(path, CODES)
    assert {rater for rater, events in raters.items() if events} == set(found)
    for rater, events in found.items():
        same(sorted(events), sorted(raters[rater]))
    theirs = Elan.Eaf(str(path))
    tiers = theirs.get_tier_names()
    assert {f"{code}_{rater}" for code in CODES for rater in raters} <= set(tiers)
    n = sum(len(theirs.get_annotation_data_for_tier(tier)) for tier in tiers)
    assert n == sum(map(len, raters.values()))


def test_a_tier_may_hold_several_behaviours(tmp_path: Path) -> None:
    theirs = Elan.Eaf()
    theirs.add_tier("events")
    theirs.add_annotation("events", 1000, 1001, "Slip")
    theirs.add_annotation("events", 2000, 3500, "deformation")
    theirs.add_tier("drop_r1", part="thumb")
    theirs.add_annotation("drop_r1", 250, 251, "ü")
    theirs.to_file(str(tmp_path / "a.eaf"))
    found = read_eaf(tmp_path / "a.eaf", CODES)
    assert found.pop("r1") == [CodedEvent(0.25, "thumb", "drop", (), "ü")]
    ((slip, state),) = found.values()
    assert [(e.code, e.t_s, e.duration_s) for e in (slip, state)] == [("slip", 1, 0), ("deformation", 2, 1.5)]


ENTITIES = [
    '<!DOCTYPE a [<!ENTITY a "aaaaaaaa"><!ENTITY b "&a;&a;&a;">]><ANNOTATION_DOCUMENT>&b;</ANNOTATION_DOCUMENT>',
    '<!DOCTYPE a [<!ENTITY a SYSTEM "file:///etc/passwd">]><ANNOTATION_DOCUMENT>&a;</ANNOTATION_DOCUMENT>',
    '<!DOCTYPE a SYSTEM "http://127.0.0.1:9/a.dtd"><ANNOTATION_DOCUMENT/>',
]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        *((text.encode(), "declares a type of document or entities") for text in ENTITIES),
        *((text, "is no ELAN file") for text in (b"", b"<A", b"<A><TIRE></TIER></A>")),
    ],
)
def test_a_damaged_elan_file_entities_and_types_of_document_are_refused(content, message, tmp_path):
    (tmp_path / "a.eaf").write_bytes(content)
    with pytest.raises(RecordingError, match=message):
        read_eaf(tmp_path / "a.eaf")


def test_behaviours_are_known_but_for_case_and_spaces() -> None:
    named = {"Slip": "slip", "lift off": "lift_off", "Lift-Off ": "lift_off", "slips": None}
    assert {code: known_code(code, CODES) for code in named} == named


@pytest.fixture
def study(tmp_path: Path) -> Path:
    folder = tmp_path / "study"
    write_plan(make_plan(participants=1, objects=["bag"], trials=1, behaviours=["regrasp"]), folder)
    with Journal(events_path(folder, "p01")) as journal:
        journal.add("trial_start", t_ns=10**9, trial=1)
        journal.add("trial_end", t_ns=10**9 + 5_960_000_000, trial=1, status="done", success=True)
    return folder


def coded_of(folder: Path, rater: str) -> list[JournalEvent]:
    return [e for e in read_observers(folder, "p01")[rater] if not e.kind.startswith(("session", "trial"))]


def test_a_state_counts_once_and_keeps_length_modifiers_and_comment(study: Path, tmp_path: Path) -> None:
    rows = [*ROWS, row("regrasp", "POINT", "4.0"), row("Slip ", "POINT", "4.5")]
    rows[1][5] = "long"
    (tmp_path / "a.tsv").write_text(table(rows), encoding="utf-8")
    assert import_boris(study, tmp_path / "a.tsv", "r1") == {"p01": 1}
    state, slip, regrasp, other = coded_of(study, "r1")
    assert (state.kind, state.t_ns, state.duration_s) == ("deformation", 3 * 10**9, 3.5)
    assert (slip.kind, slip.modifiers, slip.text) == ("slip", ("long",), "ü")
    assert (regrasp.kind, regrasp.item, other.kind) == ("behaviour", "regrasp", "slip")
    paths = [tmp_path / "a.boris", tmp_path / "elan"]
    export_boris(study, paths[0])
    export_elan(study, paths[1])
    load_boris(paths[0])
    for n, path in enumerate(paths, 2):
        assert import_boris(study, path, f"r{n}") == {"p01": 1}
        back = coded_of(study, f"r{n}")
        for mine, theirs in zip(coded_of(study, "r1"), back, strict=True):
            assert mine == msgspec.structs.replace(theirs, source="r1")
    found = {(one.kind, one.a, one.b): one.f1 for one in agreements(study)}
    assert found["regrasp", "r1", "r2"] == found["deformation", "r1", "r3"] == 1.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (table([row("slip", "POINT", "931.2")]), r"'slip' at 931\.200 s is outside: it is 5\.960 s long"),
        (table([row("slip", "POINT", "-3.5")]), r"'slip' at -3\.500 s is outside"),
        (
            table([row("deformation", "START", "3"), row("deformation", "STOP", "7")]),
            r"at 7\.000 s is outside",
        ),
        (
            table([row("jump", "POINT", "3")]),
            "'jump' is not known.*slip, deformation, drop, lift_off, regrasp",
        ),
        ("a,b\n1,2\n", "no column Behavior, Time"),
        ("Observation id,Behavior,Time\nmine,slip,1\n", "names no trial"),
        ("Observation id,Behavior,Time\np01_t01_a2,slip,1\n", "was not run"),
    ],
)
def test_events_of_no_trial_or_outside_of_it_are_refused_and_change_nothing(text, message, study, tmp_path):
    (tmp_path / "a.tsv").write_text(text)
    with pytest.raises(RecordingError, match=message):
        import_boris(study, tmp_path / "a.tsv", "r1")
    assert "r1" not in read_observers(study, "p01")


def test_a_state_without_an_end_lasts_to_the_trials_end_and_is_noted(study, tmp_path, caplog):
    (tmp_path / "a.tsv").write_text(table([row("deformation", "START", "2")]))
    import_boris(study, tmp_path / "a.tsv", "r1")
    (state,) = coded_of(study, "r1")
    assert state.duration_s == pytest.approx(3.96)
    assert "'deformation' from 2.000 s on has no end" in caplog.text


def test_keys_code_events_at_the_moment_that_is_played(tmp_path: Path) -> None:
    recording, played = tmp_path / "a.mcap", SimpleNamespace(at_s=1.0)
    with annotation_keys(recording, "r1", lambda: played.at_s) as press:
        message = []
        for t_s, key in ((1, "s"), (2, "d"), (2.5, "x"), (3, "u"), (4, "d"), (5, "q"), (6, "d")):
            played.at_s = float(t_s)
            message.append(press(key))
        with pytest.raises(DeviceUnavailableError, match="another program"):
            AnnotationFile(recording, "r2")
    assert message == [
        "slip at 1.00 s", "deformation from 2.00 s", "drop at 2.50 s", "undone: drop at 2.50 s",
        "deformation 2.00 to 4.00 s", "", "deformation from 6.00 s",
    ]  # fmt: skip
    found = read_annotations(recording)["r1"]
    assert [(e.code, e.t_s, e.duration_s) for e in found] == [
        ("slip", 1.0, 0.0), ("deformation", 2.0, 2.0), ("deformation", 6.0, None),
    ]  # fmt: skip
    path = annotations_path(recording)
    path.write_bytes(path.read_bytes() + b'{"n": 9')  # cut off
    assert read_annotations(recording)["r1"] == found
    path.write_bytes(path.read_bytes() + b"}\n")
    with pytest.raises(RecordingError, match="line 7 is no annotation"):
        read_annotations(recording)


def test_any_recording_is_annotated_by_boris_and_elan(tmp_path, capsys):
    recorded = record(tmp_path / "session")
    boris, elan = tmp_path / "out.boris", tmp_path / "out.eaf"
    call(capsys, "recording", "annotate", recorded, "--boris", boris)
    tree = json.loads(boris.read_text())
    coded = [[0.2, "", "slip", "hard", "here"], [0.3, "", "regrasp", "", ""]]
    tree["observations"][recorded.stem]["events"] = coded
    boris.write_text(json.dumps(tree))
    call(capsys, "recording", "annotate", recorded, "--import", boris, "--rater", "r1", "--elan", elan)
    call(capsys, "recording", "annotate", recorded, "--import", elan, "--rater", "r2")
    rows: Any = json.loads(call(capsys, "recording", "annotate", recorded, "--json")[0])
    assert [(one["rater"], one["code"], one["t_s"]) for one in rows] == [
        ("r1", "slip", 0.2), ("r2", "slip", 0.2), ("r1", "regrasp", 0.3), ("r2", "regrasp", 0.3),
    ]  # fmt: skip
    assert rows[1]["modifiers"] == ["hard"]
    _, message = call(capsys, "recording", "annotate", recorded, "--import", elan, "--rater", "r1", code=1)
    assert "has annotated" in message


def test_keys_and_buttons_of_the_page_code_events() -> None:
    viser = pytest.importorskip("viser")
    from tega.ui.view.browser.timeline import add_annotation_keys

    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        pressed: list[str] = []

        def annotate(key: str) -> str:
            pressed.append(key)
            return "kept"

        buttons = add_annotation_keys(server.gui, annotate)
        commands = server.gui._command_handle_from_uuid.values()
        assert [command.hotkey for command in commands] == ["S", "D", "X", "L", "U"]
        for command in commands:
            for call_back in command._impl.trigger_cb:
                call_back(None)
        assert pressed == ["s", "d", "x", "l", "u"]
        assert buttons.options[0] == "S: slip"
    finally:
        server.stop()
