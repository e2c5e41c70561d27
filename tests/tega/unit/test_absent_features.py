"""Features that are not here: of a recording, by its tables; of a package of one's own, by the extra that it lacks."""

from __future__ import annotations

import pytest

from tega.errors import MissingExtraError
from tega.recording.absent import absent_features
from tega.runtime.features import Feature, features, load_target


def test_a_feature_that_is_not_installed_is_named_with_its_package() -> None:
    here = next(iter(features()))
    (text,) = absent_features({"features": {"grip": "tega[lab]", here: "tega"}})
    assert "'grip'" in text
    assert text.endswith("pip install 'tega[lab]'")
    assert absent_features({}) == []


def test_a_package_that_only_a_recording_names_is_not_recommended() -> None:
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
