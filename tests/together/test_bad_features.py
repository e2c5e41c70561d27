"""A feature of another package with any mistake is named with the next step; everything else works, in runs, too."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import click
import pytest

from reference import bad_features
from reference.bad_features import RECORDS, Install
from reference.command import call
from reference.parts import checked
from tega.config import SessionConfig
from tega.errors import ConfigError, FeatureError, TegaError
from tega.loop import run_session
from tega.recording import export
from tega.records import types
from tega.records.bus import Bus
from tega.records.display import DisplayRows
from tega.runtime import features as loader
from tega.runtime.declaration import OWN_NAMES
from tega.runtime.features import broken_features, features
from tega.setup.doctor.settings import examine
from tega.ui.cli import main as command_line
from tega.ui.cli.guest_group import GuestGroup

install = bad_features.install


def left_out(name: str = "load") -> str:
    """Return why a feature is left out, with the next step, after everything of TEGA's own was found."""
    assert {"recording", "output", "sim", "scene", "study"} <= features().keys()
    (one,) = (one for one in broken_features() if one.name == name)
    assert one.hint
    return f"{one.problem}; {one.hint}"


def record(topic: str, fields: str = "t_ns: Ns", name: str = "Odd", more: str = "") -> str:
    lines = (f"class {name}(Record, frozen=True, kw_only=True):", f"    topic: ClassVar[str] = {topic!r}")
    return "\n".join((*lines, f"    {more}\n    {fields}", f"RECORDS = ({name},)"))


@pytest.mark.parametrize(
    ("members", "code", "named"),
    [
        ("settings='load'", "", "settings is 'load', not a Mapping[str, str]"),
        ("settings={'load': 3}", "", "settings['load'] is 3, not a str"),
        ("records=(int,)", "", "records is (<class 'int'>,), not a str"),
        ("part=print", "", "part is <built-in function print>, not a str"),
        ("in_play='no'", "", "in_play is 'no', not a bool"),
        ("verbs={'load': 'm:load'}", "", "verbs['load'] is 'm:load', not a Verb"),
        ("verbs={'load': Verb('m:load', None)}", "", "verbs['load'].summary is None, not a str"),
        ("verbs={'run': Verb('m:f', 's')}", "", "verbs: the name 'run' is taken by TEGA"),
        ("verbs={'export': Verb('m:f', 's')}", "", "verbs: the name 'export' is taken by TEGA"),
        ("verbs={'emg inspect': Verb('m:f', 's')}", "", "verbs: the name 'emg inspect' is taken by TEGA"),
        ("verbs={'demo': Verb('m:f', 's')}", "", "verbs: the name 'demo' is taken by feature 'sim'"),
        ("verbs={'egm load': Verb('m:f', 's')}", "", "'egm load' joins no group: there is no group 'egm'"),
        ("verbs={'emg load now': Verb('m:f', 's')}", "", "'emg load now' is neither one word nor two"),
        ("settings={'emg': 'm:T'}", "", "settings: the name 'emg' is taken by TEGA"),
        ("settings={'scene': 'm:T'}", "", "settings: the name 'scene' is taken by feature 'scene'"),
        ("formats={'csv': 'm:F'}", "", "formats: the name 'csv' is taken by TEGA"),
        ("streams={'rerun': 'm:S'}", "", "streams: the name 'rerun' is taken by feature 'viewers'"),
        ("records='tega_load.members:RECORD'", "", "tega_load.members:RECORD does not exist"),
        ("records='tega_load.members:Load'", "", "not a tuple of Record classes"),
        (RECORDS, "RECORDS = (int,)", "RECORDS holds <class 'int'>, not a Record class"),
        (RECORDS, "raise ValueError('boom')", "tega_load.members:RECORDS: ValueError: boom"),
        (RECORDS, record("/load/{nix}"), "its topic /load/{nix} has no field 'nix' to stand for"),
        (RECORDS, record(""), "has the topic ''"),
        (RECORDS, record("/touch/event"), "has the topic of tega.records.touch.Event"),
        (RECORDS, record("/tactile/thumb/contact"), "has the topic of tega.records.touch.Contact"),
        (RECORDS, record("/odd", name="Contact"), "has the name of tega.records.touch.Contact"),
        (RECORDS, record("/odd", more='schema: ClassVar[str] = "Contact"'), "sets its schema to 'Contact'"),
        (RECORDS, record("/odd", more='schema: ClassVar[str] = "foxglove.Grid"'), "sets its schema to 'foxglove.Grid'"),
        (RECORDS, record("/odd", "held: dict[str, int]"), "field held has the type"),
        (RECORDS, record("/odd", "held: Annotated[int, msgspec.Meta(ge=0)]"), "field held has the type"),
        (RECORDS, record("/odd", "held: 'Unknown'"), "name 'Unknown' is not defined"),
        (RECORDS, record("/odd", "held: Annotated[int, quantity('1', 'int33')]"), "field held has the type"),
        (RECORDS, record("/odd", "held: Table"), "field held has the type"),
    ],
)  # fmt: skip
def test_a_bad_declaration_is_left_out_and_named(install, members, code, named):
    install(members, code)
    assert "records" not in members or len(types.record_types()) > 20
    assert named in left_out()
    assert "load" not in features()


@pytest.mark.parametrize(
    ("head", "named"),
    [
        ("import no_such_lib\n", "pip install no_such_lib, or remove tega-load"),
        ("import tega_load.gone\n", "pip install --force-reinstall tega-load, or remove tega-load"),
        ("raise SystemExit(7)\n", "SystemExit: 7; correct the declaration tega_load:FEATURE"),
    ],
)
def test_a_declaration_that_is_not_imported_is_named_and_the_rest_works(install, head, named, capsys):
    install(head=head)
    assert named in left_out()
    shown, warned = call(capsys, "config", "show")
    assert "session.preset" in shown
    assert "feature 'load' is left out: " in warned
    assert named.partition(";")[0] in " ".join(warned.split())


def test_ctrl_c_while_a_declaration_is_imported_stops(install: Install) -> None:
    install(head="raise KeyboardInterrupt\n")
    with pytest.raises(KeyboardInterrupt):
        features()


def test_tega_s_own_come_first_and_the_later_of_two_is_left_out(install: Install) -> None:
    install(name="sim", of="a-load")
    assert "the entry point 'sim' has the name of a feature of tega" in left_out("sim")
    assert features()["sim"].package == "tega"
    install("settings={'load': 'm:T'}", name="one", of="b-load")
    install("settings={'load': 'm:T'}", name="two", of="c-load")
    assert "the name 'load' is taken by feature 'one'" in left_out("two")
    assert features()["one"].package == "b-load"


def test_tega_s_own_names_are_all_there() -> None:
    verbs = {*command_line._VERBS, *command_line._EARLIER}
    for name in command_line._VERBS:
        group = command_line.cli.get_command(click.Context(command_line.cli), name)
        if isinstance(group, GuestGroup):
            verbs |= {f"{name} {verb}" for verb in group.commands}
    assert set(OWN_NAMES["verbs"]) == verbs
    assert set(OWN_NAMES["settings"]) == set(SessionConfig.__struct_fields__)
    assert set(OWN_NAMES["formats"]) == set(export._GROWING)


@pytest.mark.parametrize("member", ["part", "checks", "panels", "played"])
def test_a_target_of_another_kind_names_member_value_and_kind(install: Install, member: str) -> None:
    install(f"{member}='tega_load.members:odd'", "odd = 'text'")
    with pytest.raises(ConfigError, match=r"'load': tega_load\.members:odd is 'text', not a function or"):
        loader.call_member(features()["load"], member)


def test_a_table_of_a_feature_that_is_left_out_is_refused_with_the_error(install: Install) -> None:
    tree = {"load": {"warn_n": 2.0}}
    install("settings={'load': 'tega_load.members:Table'}, " + RECORDS, record("/touch/event"))
    checked({})
    assert not broken_features()  # nothing of it is imported for settings without its table
    with pytest.raises(ConfigError, match="load: unknown key") as refused:
        checked(tree)
    why = "this is a table of the feature 'load', which is installed but could not"
    assert refused.value.hint.startswith(why)


def test_a_feature_that_is_not_imported_is_named_by_recordings_and_settings(install: Install) -> None:
    from tega.recording.origin import absent_features

    install(head="import no_such_lib\n")
    (text,) = absent_features({"features": {"load": "tega-load"}})
    assert "'load', which is installed but could not be loaded: ModuleNotFoundError" in text
    assert "not installed here" not in text
    with pytest.raises(ConfigError) as refused:
        checked({"load": {"warn_n": 2.0}})
    assert "installed but could not be loaded: ModuleNotFoundError" in refused.value.hint


@pytest.mark.parametrize(
    ("code", "named"),
    [
        ("def check(table): return table", r"check tega_load.members:check: TypeError: check\(\) takes 1"),
        ("def check(table, context): pass", "check tega_load.members:check returned None, not Table"),
    ],
)
def test_a_check_that_fails_is_named(install: Install, code: str, named: str) -> None:
    install("settings={'load': 'tega_load.members:Table'}, check='tega_load.members:check'", code)
    with pytest.raises(FeatureError, match=f"feature 'load': {named}") as refused:
        checked({"load": {}})
    assert "leave out [load], or pip uninstall tega-load" in refused.value.hint


@pytest.mark.parametrize(
    ("code", "named"),
    [
        ("", "tega_load.members:check does not exist"),
        ("def check(config): return None", "TypeError"),
        ("def check(config): return 'fine'", "ValidationError"),
        ("def check(config): return 1 / 0", "ZeroDivisionError: division by zero"),
        ("def check(config): return [Finding(check='x', status='odd', finding='x')]", "Invalid enum value 'odd'"),
    ],
)  # fmt: skip
def test_a_check_of_doctor_that_fails_is_a_finding(install: Install, code: str, named: str) -> None:
    install("checks='tega_load.members:check'", code)
    found = examine(checked({"vest": {"driver": "on-screen-vest"}}), name="lab.toml").findings
    (one,) = (one for one in found if one.check == "load")
    assert one.status == "error"
    assert "feature 'load'" in one.finding
    assert named in one.finding
    assert one.todo
    assert len(found) > 1


def test_a_panel_that_fails_is_left_out_once(install: Install) -> None:
    install("panels='tega_load.members:panel'", "def panel(bus): raise ValueError('boom')")
    warnings: list[str] = []
    loader.show_warnings(lambda message, _hint: warnings.append(message))
    for display in ("terminal", "page"):
        assert DisplayRows(Bus(), display)() == {}
    why = "feature 'load': panels tega_load.members:panel: ValueError: boom"
    assert warnings == [f"a panel is left out: {why}"]


TAKEN = (
    "from tega.ui.cli.export_format import ExportFormat\nodd = ExportFormat((click.Option(['{}']),), print)"
)


@pytest.mark.parametrize(
    ("code", "named"),
    [
        (TAKEN.format("--out"), "recording export has an option --out already"),
        (TAKEN.format("--fps"), "recording export has an option --fps already"),  # of LeRobot's format
        ("odd = 'text'", "feature 'load': tega_load.members:odd is 'text', not a tega.ui.cli."),
    ],
)
def test_a_bad_format_is_left_out_and_the_others_are_there(install, code, named, capsys):
    install("formats={'odd': 'tega_load.members:odd'}", code)
    out, err = call(capsys, "recording", "export", "--help")
    assert f"format 'odd' is left out: {named}" in err
    for option in ("--out", "--fps"):
        assert sum(line.startswith(f"  {option} ") for line in out.splitlines()) == 1


@pytest.mark.parametrize("verb", ["load", "emg load"])
def test_an_error_in_a_verb_names_its_package(install, verb, capsys):
    install(
        f"verbs={{{verb!r}: Verb('tega_load.members:verb', 'Loads.', 'Examine')}}",
        "@click.command()\ndef verb(): click.open_file(None)",
    )
    _, err = call(capsys, *verb.split(), code=1)
    assert "report it to the authors of tega-load" in err


def test_help_imports_no_verb_and_a_bad_one_is_named(install, capsys):
    install("verbs={'emg load': Verb('tega_load.members:odd', 'Loads it all.')}", "odd = 'text'")
    assert "Loads it all." in call(capsys, "emg", "--help")[0]
    assert "tega_load.members" not in sys.modules
    _, err = call(capsys, "emg", "load", code=1)
    assert "'load': tega_load.members:odd is 'text', not a click command" in err


def run(folder: Path) -> tuple[dict[str, Any], dict[str, int]]:
    """Run two seconds of synthetic touch; return the summary, and the recorded messages by topic."""
    from tega.loop.snapshot import Snapshot
    from tega.recording.mcap_reader import McapReader

    bus = Bus()
    bus.subscribe(Snapshot, lambda _snapshot: None, name="a display")
    tree = {
        "session": {"pace": "fast", "duration_s": 2.0},
        "tactile": {"thumb": {"driver": "synthetic-touch"}, "index": {"driver": "synthetic-touch"}},
        "recording": {"dir": str(folder / "recorded"), "stop_free_mib": 0.0},
    }
    summary = run_session(checked(tree), bus=bus)
    counts: dict[str, int] = {}
    for message in McapReader(folder / "recorded" / summary["recording"]["file"]).messages():
        counts[message.topic] = counts.get(message.topic, 0) + 1
    assert summary["recording"]["state"] == "complete"
    assert summary["recording"]["duration_s"] >= 1.9
    assert counts["/tactile/thumb/contact"] > 10
    json.dumps(summary)
    return summary, counts


PUBLISHES = """
def begin(self, run):
    self.bus.subscribe(Contact, self.publish, name="load")
def publish(self, contact):
    self.bus.publish(Extra(t_ns=contact.t_ns))
LoadPart.begin, LoadPart.publish = begin, publish
"""
PART = "part='tega_load.members:open_part', " + RECORDS


@pytest.mark.slow
def test_a_record_that_is_not_declared_costs_itself_only(install, tmp_path, caplog):
    pytest.importorskip("foxglove", reason="needs the extra tega[record]")
    install(PART, PUBLISHES)
    summary, counts = run(tmp_path)
    assert not any(topic.startswith("/load") for topic in counts)
    named = "Extra is not in the records of the feature 'load'"
    for text in (caplog.text, str(summary["safety"]["alerts"]), str(summary["notes"])):
        assert named in text


@pytest.mark.slow
@pytest.mark.parametrize("hook", ["end", "ended", "summary", "notes", "finish", "displayed"])
@pytest.mark.parametrize("does", ["raises", "rubbish"])
def test_a_part_that_fails_at_the_end_costs_itself_only(install, tmp_path, hook, does):
    pytest.importorskip("foxglove", reason="needs the extra tega[record]")
    body = {
        "raises": "raise ValueError('boom')",
        "rubbish": "[d.update(odd={1}) for d in given]; return 'odd'",
    }
    body["rubbish"] = body["rubbish"] if hook == "finish" else "return 'odd'"
    install(PART, f"def hook(self, *given): {body[does]}\nLoadPart.{hook} = hook")
    summary, _ = run(tmp_path)
    assert "odd" not in summary
    named = [note for note in summary["notes"] if "feature 'load'" in note]
    expected = 0 if does == "rubbish" and hook in {"end", "ended"} else 1  # what they return is nobody's
    assert len(named) == expected
    assert all(f"{hook}()" in note for note in named)


def test_a_part_does_not_replace_what_the_summary_has(install: Install) -> None:
    install(PART, "LoadPart.summary = lambda self: {'vest': 'odd', 'load': 1}")
    tactile = {"thumb": {"driver": "synthetic-touch"}}
    summary = run_session(checked({"session": {"pace": "fast", "duration_s": 0.2}, "tactile": tactile}))
    assert (summary["vest"]["layout"], summary["load"]) == ("x40", 1)
    assert "a part's 'vest' is left out: the summary has it" in summary["notes"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("body", "named"),
    [
        ("1 / 0", "feature 'load': alerts: 'load': ZeroDivisionError: division by zero"),
        ("None", "feature 'load': alerts: 'load' returned None, not str"),
    ],
)
def test_an_alert_that_fails_stops_the_run_with_the_feature_s_name(install, tmp_path, body, named):
    install(PART, f"LoadPart.alerts = lambda self: {{'load': lambda: {body}}}")
    with pytest.raises(FeatureError) as stopped:
        run(tmp_path)
    assert stopped.value.message == named
    assert "to go on without it, pip uninstall tega-load" in stopped.value.hint
    assert not list((tmp_path / "recorded").glob("*.part"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("code", "named"),
    [
        ("open_parts = 'text'", "is 'text', not a function or class"),
        (
            "def open_parts(context): raise ValueError('boom')",
            "part tega_load.members:open_parts: ValueError: boom",
        ),
        ("LoadPart.alerts = lambda self: 'text'", "alerts() returned 'text', not Mapping"),
        ("LoadPart.prepared = lambda self, prepared: None", "prepared() returned None, not Prepared"),
        ("class LoadPart:\n    pass", "open_part returned <tega_load.members.LoadPart"),
    ],
)
def test_a_part_of_the_wrong_kind_is_named(install: Install, tmp_path: Path, code: str, named: str) -> None:
    target = "open_parts" if "open_parts" in code else "open_part"
    install(f"part='tega_load.members:{target}'", code)
    with pytest.raises(TegaError, match="feature 'load'") as refused:
        run(tmp_path)
    assert named in refused.value.message
