"""Settings, stages and fields that were taken out: one clear sentence, and older files that made no use of them."""

from __future__ import annotations

import pytest

from tega.config import load_config
from tega.errors import ConfigError
from tega.runtime.removed import Removed, refuse_removed, without_removed
from tega.stages.registry import stage_class

GONE = {"shear": Removed("0.3", "nothing gives way", "plan anew", "off")}


def test_a_stage_that_was_taken_out_is_refused_by_one_sentence() -> None:
    sentence = r"^stages\.metric shear was taken out in 0\.3: it was not shown"
    with pytest.raises(ConfigError, match=sentence) as refused:
        stage_class("metric", "shear")
    assert "live" in refused.value.hint
    with pytest.raises(ConfigError, match=r"stages\.metric shear was taken out in 0\.3"):
        load_config(None, environ={}, sets=["session.preset=live", "stages.metric.name=shear"])


def test_what_was_never_there_is_no_removed_stage() -> None:
    refuse_removed("stages.metric velvet")
    with pytest.raises(ConfigError, match="no metric is called 'velvet'"):
        stage_class("metric", "velvet")


def test_fields_that_were_taken_out_pass_where_they_were_unused_and_are_refused_where_they_were_not() -> None:
    assert without_removed({"shear": "off", "view": "direct"}, GONE) == {"view": "direct"}
    with pytest.raises(ConfigError, match=r"^shear was taken out in 0\.3: nothing gives way"):
        without_removed({"shear": "dots", "view": "direct"}, GONE)
