"""What is drawn: on axes, and as HTML for notebooks; names from anywhere are escaped."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as ET

import matplotlib as mpl
import numpy as np
import pytest

import tega
from reference.recordings import baseline, pressed
from tega.errors import InvalidValueError, MissingExtraError
from tega.haptics import LAYOUTS, MotorLevels, vest_frame
from tega.haptics.motor_layout import find_layout, torso_svg
from tega.records import Contact, NamedValue, SentFrame, VestFrame
from tega.stages.base import MuscleSetup
from tega.stages.decoders import RulesDecoder, RulesOptions

HOSTILE = '<script>alert("x")</script>&'


@pytest.fixture(autouse=True)
def _no_window() -> Iterator[None]:
    mpl.use("Agg")
    import matplotlib.pyplot as plt

    yield
    plt.close("all")


def test_a_contact_is_outlined_where_there_is_one() -> None:
    axes = tega.plot.contact(pressed(60.0, noise=1), baseline(), "paper")
    assert len(axes.images) == 1
    assert len(axes.lines) == len(axes.collections) == 1
    assert np.asarray(axes.lines[0].get_xdata())[0] == pytest.approx(40, abs=2)
    assert tega.plot.contact(baseline(), baseline(), "paper").get_title() == "no contact"


def test_a_course_is_drawn_from_topic_frame_and_array(lossless: Path) -> None:
    topic = tega.open_recording(lossless)["/tactile/thumb/contact"]
    table = topic.to_numpy()
    for data in (topic, table, topic.to_pandas(), topic.columns()):
        axes = tega.plot.course(data, "force_n", "depth_mm")
        for line, name in zip(axes.lines, ("force_n", "depth_mm"), strict=True):
            assert np.array_equal(line.get_xdata(), table["t_s"])
            assert np.array_equal(line.get_ydata(), table[name])
    with pytest.raises(InvalidValueError, match="no column 'weight'"):
        tega.plot.course(topic, "weight")


def test_levels_have_a_line_for_each_muscle_and_the_fused_one(lossless: Path) -> None:
    topic = tega.open_recording(lossless)["/emg/levels"]
    axes = tega.plot.levels(topic)
    assert [line.get_label() for line in axes.lines] == ["ch1", "ch2", "ch3", "fused"]
    assert np.array_equal(axes.lines[-1].get_ydata(), topic.to_numpy()["fused"])


@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_motor_is_drawn_where_it_is(layout: str) -> None:
    n = len(find_layout(layout).motors)
    intensities = np.arange(n, dtype=np.uint8)
    frame = MotorLevels(layout, intensities)
    axes = tega.plot.vest(frame)
    offsets = np.asarray(axes.collections[0].get_offsets())
    drawn = ET.fromstring(frame._repr_html_())
    circles = drawn.findall("{http://www.w3.org/2000/svg}circle")
    assert len(circles) == n
    for motor, (x, y), circle in zip(find_layout(layout).motors, offsets, circles, strict=True):
        assert (x > 120) == (motor.face == "back")
        assert (float(circle.get("cx", "")), float(circle.get("cy", ""))) == pytest.approx((x, y), abs=0.06)
    shares = [float(circle.get("fill-opacity", "")) for circle in circles]
    assert shares == pytest.approx(intensities / 100)
    record = VestFrame(t_ns=0, layout=layout, intensities=tuple(range(n)))
    assert record._repr_html_() == frame._repr_html_() == torso_svg(layout, list(range(n)))
    assert tega.plot.vest(record).get_title() == layout


def test_names_are_escaped() -> None:
    displayed = [
        Contact(finger=HOSTILE, t_ns=0, in_contact=True, more=(NamedValue(HOSTILE, 1.0, HOSTILE),)),
        VestFrame(t_ns=0, layout=HOSTILE, intensities=(1,)),
        SentFrame(t_ns=0, layout="x40", intensities=(1,)),
    ]
    for record in displayed:
        html = record._repr_html_()
        assert html is not None
        assert "<script>" not in html
        ET.fromstring(f"<div>{html}</div>")


def test_what_is_printed_is_short() -> None:
    assert (
        repr(vest_frame([50, 0, 0, 0], [0] * 4)) == "MotorLevels('paper32', 4 of 32 motors on, at most 50 %)"
    )
    setup = MuscleSetup("raw", 1000.0, 100, ("a",), (1.0,), "live")
    assert repr(RulesDecoder(setup, RulesOptions())) == (
        "<RulesDecoder: levels by the paper's rules (Eq 10 to 13)>"
    )
    assert repr(tega.emg.GraspIntent(1000, [1.0], tau=100)) == (
        "<GraspIntent: raw, 1000 Hz, blocks of 100, preset live, 1 channel>"
    )


def test_without_matplotlib_the_error_has_the_pip_line(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.partition(".")[0] == "matplotlib"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingExtraError) as reported:
        tega.plot.vest(vest_frame([0] * 4, [0] * 4))
    assert reported.value.hint == "install it with: pip install 'tega[plot]'"


def test_importing_tega_loads_neither_numpy_nor_a_part() -> None:
    code = "import sys, tega; print([n for n in sys.modules if n.startswith(('numpy', 'tega.', 'msgspec'))])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
