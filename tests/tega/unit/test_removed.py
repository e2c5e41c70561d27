"""What was taken out, is not installed or is a mistake in a feature of one's own is named, with what to do."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar

import pytest

from tega.config import load_config
from tega.config.errors import CONSTANTS, REMOVED
from tega.errors import ConfigError, InvalidValueError, MissingExtraError
from tega.recording.origin import absent_features
from tega.records import Record
from tega.records.base import Count, Ns
from tega.records.schema import fields
from tega.runtime.features import Feature, features, load_target
from tega.runtime.words import Removed, without_removed
from tega.stages.registry import stage_class

GONE = {"shear": Removed("0.3", "nothing gives way", "plan anew", "off")}


def test_a_stage_that_was_taken_out_is_refused_by_one_sentence() -> None:
    sentence = r"^stages\.metric shear was taken out in 0\.3: it was not shown"
    with pytest.raises(ConfigError, match=sentence) as refused:
        stage_class("metric", "shear")
    assert "live" in refused.value.hint
    with pytest.raises(ConfigError, match=r"stages\.metric shear was taken out in 0\.3"):
        load_config(None, environ={}, sets=["session.preset=live", "stages.metric.name=shear"])


def test_fields_that_were_taken_out_pass_where_they_were_unused_and_are_refused_where_they_were_not() -> None:
    assert without_removed({"shear": "off", "view": "direct"}, GONE) == {"view": "direct"}
    with pytest.raises(ConfigError, match=r"^shear was taken out in 0\.3: nothing gives way"):
        without_removed({"shear": "dots", "view": "direct"}, GONE)


@pytest.mark.parametrize("name", REMOVED)
def test_a_removed_setting_names_its_version_and_what_to_set(tmp_path: Path, name: str) -> None:
    key, _, value = name.partition(" = ")
    table, _, leaf = key.rpartition(".")
    file = tmp_path / "lab.toml"
    file.write_text(f'[{table}]\n{leaf} = "{value or "odd"}"\n', encoding="utf-8")
    gone = REMOVED[name]
    with pytest.raises(ConfigError) as refused:
        load_config(file, environ={})
    assert refused.value.message == f"lab.toml:2: {name} was taken out in {gone.since}: {gone.reason}"
    assert refused.value.hint == gone.hint
    with pytest.raises(ConfigError, match=r"--set: .* was taken out"):
        load_config(None, environ={}, sets=[f"{key}={value or 'odd'}"])


BESIDE = {
    "hand": "hand.driver=python-can",
    "stages.mapping": "stages.mapping.name=changes",
    "stages.reflex": "stages.reflex.name=grip",
}


@pytest.mark.parametrize("key", CONSTANTS)
def test_a_setting_that_became_a_constant_is_read_with_its_value_only(key: str) -> None:
    beside = BESIDE[key.partition(".options")[0]]
    plain = load_config(None, environ={}, sets=[beside]).config
    assert load_config(None, environ={}, sets=[beside, f"{key}={CONSTANTS[key]!r}"]).config == plain
    with pytest.raises(ConfigError, match=r"--set: .* was taken out in 0\.3; leave it out: it is always"):
        load_config(None, environ={}, sets=[beside, f"{key}=0.07"])


def test_a_feature_that_is_not_installed_is_named_and_only_tega_s_own_package_recommended() -> None:
    here = next(iter(features()))
    (text,) = absent_features({"features": {"grip": "tega[lab]", here: "tega"}})
    assert "'grip'" in text
    assert text.endswith("pip install 'tega[lab]'")
    assert absent_features({}) == []
    (text,) = absent_features({"features": {"grip": "own-feature[lab]"}})
    assert "pip install" not in text
    assert "'own-feature[lab]'; ask who made it" in text


@pytest.mark.parametrize(
    ("name", "requirement"),
    [
        ("grip", "x' && rm -rf '"),
        ("grip", "--index-url=http://example.org x"),
        ("grip", "own feature"),
        ("grip", "x\n"),
        ("\x1b[2Jgrip", "own-feature"),
        ("g" * 1000, "own-feature"),
    ],
)
def test_nothing_but_names_is_printed_out_of_a_recording(name: str, requirement: str) -> None:
    assert absent_features({"features": {name: requirement}}) == []


def test_a_feature_of_another_package_is_installed_by_that_package_s_name() -> None:
    feature = Feature(summary="Grip.", extra="lab", package="own-feature")
    with pytest.raises(MissingExtraError) as error:
        load_target("no_such_module:x", feature)
    assert error.value.hint == "install it with: pip install 'own-feature[lab]'"


@pytest.mark.parametrize("target", ["tega.loop.parts:open_prat", "tega.loop.prats:open_part"])
def test_a_misspelt_target_is_a_mistake_of_the_declaration(target: str) -> None:
    with pytest.raises(ConfigError) as error:
        load_target(target, Feature(summary="Grip.", name="grip", package="own-feature"))
    assert error.value.message == f"feature 'grip': {target} does not exist"
    assert error.value.hint == "correct own-feature, or update it"


def test_a_field_that_no_file_can_hold_is_named() -> None:
    class Lists(Record, frozen=True, kw_only=True):
        topic: ClassVar[str] = "/lists"
        t_ns: Ns
        held: list[Any]

    class Mixed(Record, frozen=True, kw_only=True):
        topic: ClassVar[str] = "/mixed"
        t_ns: Ns
        held: Count | str = 0

    for kind in (Lists, Mixed):
        with pytest.raises(InvalidValueError, match=f"record {kind.__name__}: field held has the type"):
            fields(kind)
