"""The live view fits a terminal of 80 x 24 and uses 120 columns."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from reference.moments import Moments
from tega.ui.cli.page import address_lines
from tega.ui.view.terminal import render

VIEW = (
    Moments()
    .at(2.0)
    .loop._replace(
        state="active",
        alerts=(
            "vest: not reached, so touch is not felt",
            "latency: camera to vest p99 12 ms, above 5 ms",
            "x",
            "y",
        ),
        latency="camera to vest p50 1.1 ms, p99 2.3 ms (n 1200); muscle to hand p50 4.2 ms, p99 9.1 ms (n 410)",
        angles_rad=[0.4] * 16,
        command=5.0,
        devices=frozenset({"emg", "hand", "vest"}),
    )
)
RATES = {"touch": 60.0, "levels": 10.0, "hand": 333.0, "vest": 30.0}


def screen(width: int, height: int) -> list[str]:
    console = Console(file=io.StringIO(), width=width, color_system=None)
    drawn = render(
        VIEW,
        title="TEGA · lab.toml",
        rates_hz=RATES,
        address="http://[::1]:8080/t/",
        width=width,
        height=height,
    )
    console.print(drawn)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue().splitlines()


@pytest.mark.parametrize(("width", "height"), [(80, 24), (120, 40), (200, 60)])
def test_hand_levels_rates_latency_and_both_faces_are_in_sight(width: int, height: int) -> None:
    lines = screen(width, height)
    assert len(lines) <= height - 1  # the cursor stands in the line below
    assert {len(line) for line in lines} == {min(width, 120)}
    displayed = "\n".join(lines)
    for text in (
        "command level 5: tight",
        "reported bend",
        "channels",
        "333 Hz",
        "n 410",
        "front",
        "back",
        "vest",
        "/t/",
    ):
        assert text in displayed, text


def test_alerts_that_do_not_fit_are_counted() -> None:
    assert "! 2 more" in "\n".join(screen(80, 24))
    assert "more" not in "\n".join(screen(120, 40))


def test_the_page_s_address_has_a_line_of_its_own_and_over_ssh_the_command_that_forwards_its_port() -> None:
    url = "http://127.0.0.1:8080/kJ2nX0bq3mX4T5v6y7z8Aw/"
    assert address_lines(url, {})[-1] == url
    over = address_lines(url, {"SSH_CONNECTION": "10.0.0.2 50000 10.0.0.7 22", "USER": "lab"})
    assert over[1] == url
    assert over[-1] == "ssh -N -L 8080:127.0.0.1:8080 lab@10.0.0.7"
    assert max(map(len, over)) < 80
    served = address_lines("http://10.0.0.7:8080/t/", {"SSH_CONNECTION": "10.0.0.2 50000 10.0.0.7 22"})
    assert len(served) == 2
