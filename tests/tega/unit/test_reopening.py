"""One way to look for a device that went away: rests that grow, and begin anew once the device has worked."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

from tega.config.choose import preset_metric
from tega.devices.base import DeviceInfo, TactileFrame
from tega.errors import DeviceUnavailableError
from tega.loop.inbox.frames import FrameMeter, measured_contacts
from tega.loop.inbox.sources import SourceReport
from tega.runtime.reopening import Reopening, polled


class Rests:
    """Notes how long was waited, and ends after so many rests."""

    def __init__(self, most: int = 100) -> None:
        self.most, self.s = most, list[float]()

    def __call__(self, rest_s: float) -> bool:
        if rest_s:
            self.s.append(rest_s)
        return len(self.s) > self.most


def failing(n: int, error: Exception) -> Callable[[], str]:
    return Mock(side_effect=[*[error] * n, *["link"] * 9])


def test_rests_grow_to_the_longest_and_begin_anew_once_it_worked() -> None:
    rests, again, reported = Rests(), Reopening(0.25, 2.0), list[str]()
    opened = failing(5, DeviceUnavailableError("away"))
    link = again.open(opened, rests, absent=DeviceUnavailableError, refused=lambda e: reported.append(str(e)))
    assert link == "link"
    assert reported == ["away"] * 5
    assert rests.s == [0.25, 0.5, 1.0, 2.0, 2.0, 2.0]
    again.works()
    again.wait(rests)
    assert rests.s[-1] == 0.25


def test_an_error_that_says_nothing_of_absence_is_not_swallowed() -> None:
    opened = failing(1, ValueError("a fault of ours"))
    with pytest.raises(ValueError, match="a fault of ours"):
        Reopening(0.1, 1.0).open(opened, Rests(), absent=DeviceUnavailableError)


def test_a_device_is_used_let_go_of_and_opened_again_until_it_is_not_wanted() -> None:
    rests, done = Rests(3), list[str]()
    opened = failing(1, OSError("away"))

    def use(link: str) -> bool:
        done.append(f"use {link}")
        return link == "first"

    Reopening(0.25, 2.0).serve(
        "first", opened, use, lambda link: done.append(f"close {link}"), rests, absent=OSError
    )
    assert done[:4] == ["use first", "close first", "use link", "close link"]
    assert done[-1] == "close link"
    assert rests.s[:2] == [0.25, 0.5]


def test_a_device_is_let_go_of_whatever_its_use_ends_with() -> None:
    closed: list[str] = []

    def use(link: str) -> bool:
        raise ZeroDivisionError(link)

    with pytest.raises(ZeroDivisionError):
        Reopening(0.1, 1.0).serve("it", lambda: "it", use, closed.append, Rests(), absent=OSError)
    assert closed == ["it"]


def test_who_only_polls_is_asked_while_the_rest_lasts() -> None:
    looks = iter([False, False, True])
    assert polled(lambda: next(looks), every_s=0.001)(60.0)
    assert not polled(lambda: False, every_s=0.001)(0.002)


class LoseableCamera:
    """A live camera of another package: it goes away after three pictures, and counts from 0 when opened again."""

    ended = False
    info = DeviceInfo(driver="mine", kind="tactile", label="mine", live=True, rate_hz=60.0)

    def __init__(self) -> None:
        self.n_opened, self._seq = 0, 0
        self.noise = np.random.default_rng(1)

    def open(self) -> None:
        self.n_opened += 1
        self._seq = 0

    def read(self, _timeout_s: float) -> TactileFrame:
        if self._seq == 3:
            raise DeviceUnavailableError("mine: unplugged")
        self._seq += 1
        image = self.noise.integers(90, 110, (240, 320, 3), np.uint8)
        return TactileFrame(self._seq, self._seq - 1, image, "mine")


def test_a_camera_that_goes_away_is_opened_again_as_an_amplifier_is() -> None:
    camera, report = LoseableCamera(), SourceReport()
    source: Any = camera
    baseline = np.full((240, 320, 3), 100, np.uint8)
    meter = FrameMeter(baseline, preset_metric("paper", baseline), report, live=True)
    stream = measured_contacts(source, meter)
    assert [next(stream).t_ns for _ in range(7)] == [1, 2, 3, 1, 2, 3, 1]
    assert (camera.n_opened, report.n_lost, report.lost, report.n_missing) == (2, 2, "", 0)
