"""What ``doctor`` says of a gel: dark, dirty, worn, or with a baseline that is no longer so."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tega.config.calibration.records import GelRecord, write_record
from tega.setup.doctor.findings import DriverCase
from tega.setup.doctor.gel import check_gel
from tega_sim.gel import Gel, ball

pytest.importorskip("cv2", reason="pictures need the extra tactile")


BARE = DriverCase("tactile.thumb", "tactile", "digit", None)


def pictures(gel: Gel, *, first: int = 0, noisier: float = 1.0, indenters: Any = ()) -> list[Any]:
    """Return half a second of a sensor, with its noise made larger."""
    frames = [gel.frame(list(indenters), first + k) for k in range(60)]
    quiet = np.mean(frames, axis=0) if indenters else gel.still().astype(float)
    return [
        np.clip(np.rint(quiet + noisier * (frame - quiet)), 0, 255).astype(np.uint8) for frame in frames[:30]
    ]


def case(path: Path, baseline: Any) -> DriverCase:
    file = path / "thumb.npy"
    np.save(file, np.rint(np.mean(baseline, axis=0)).astype(np.uint8))
    return DriverCase("tactile.thumb", "tactile", "digit", None, file)


@pytest.mark.parametrize("noisier", [1.0, 2.5])
def test_a_gel_like_its_baseline_is_fine_whatever_its_noise(tmp_path: Path, noisier: float) -> None:
    for seed in range(2):
        gel = Gel(seed)
        before = pictures(gel, noisier=noisier)
        assert check_gel(case(tmp_path, before), "D1", pictures(gel, first=60, noisier=noisier)) == []


def test_a_gel_that_is_touched_or_has_drifted_is_told_in_its_own_noise(tmp_path: Path) -> None:
    gel = Gel(1)
    reported = case(tmp_path, pictures(gel))
    touched = check_gel(reported, "D1", pictures(gel, indenters=[ball(force_n=1.0)]))
    assert any(
        "differs from its baseline (" in one.finding and "times its noise" in one.finding for one in touched
    )
    assert all(one.status == "warning" for one in touched)
    assert touched[-1].measured["difference_noises"] > 3
    # What a quiet sensor shows clearly, one that is five times as noisy does not.
    faint = [ball(force_n=0.05)]
    found = [
        [
            one
            for one in check_gel(
                case(tmp_path, pictures(gel, noisier=by)), "D1", pictures(gel, noisier=by, indenters=faint)
            )
            if "differs" in one.finding
        ]
        for by in (1.0, 5.0)
    ]
    assert [len(one) for one in found] == [1, 0]


def test_dirt_wear_and_old_lights_are_named(tmp_path: Path) -> None:
    gel = Gel(2)
    reported = case(tmp_path, pictures(gel))
    record = GelRecord(
        device="D1",
        driver="digit",
        made=datetime(2026, 3, 4, tzinfo=UTC),
        noise_counts=(3.1, 1.7, 2.7),
        n_pictures=30,
    )
    write_record(record, tmp_path / "thumb.toml")
    spotted = pictures(gel, first=90)
    for picture in spotted:
        picture[200:212, 60:72] //= 3
    text = " ".join(one.finding for one in check_gel(reported, "D1", spotted))
    assert "a dark spot of " in text
    assert "that was not there on 2026-03-04" in text
    dimmer = [(picture * 0.75).astype(np.uint8) for picture in pictures(gel, first=90)]
    text = " ".join(one.finding for one in check_gel(reported, "D1", dimmer))
    assert "counts darker than on 2026-03-04" in text


def test_lights_that_are_off_are_told_with_and_without_a_baseline(tmp_path: Path) -> None:
    gel = Gel(3)
    off = [np.clip((p.astype(float) - gel.still()) + 6, 0, 255).astype(np.uint8) for p in pictures(gel)]
    for reported in (case(tmp_path, pictures(gel)), BARE):
        first = check_gel(reported, "D1", off)[0]
        assert first.status == "error"
        assert "the picture is dark" in first.finding
    assert check_gel(BARE, "D1", pictures(gel)) == []


def test_a_few_pictures_say_nothing_and_another_size_is_named(tmp_path: Path) -> None:
    gel = Gel(4)
    reported = case(tmp_path, pictures(gel))
    assert check_gel(reported, "D1", pictures(gel, indenters=[ball(force_n=4.0)])[:3]) == []
    turned = [np.swapaxes(p, 0, 1) for p in pictures(gel)]
    (found,) = check_gel(reported, "D1", turned)
    assert found.status == "error"
    assert "thumb.npy is 240×320, D1 sends 320×240" in found.finding


def banded(gel: Gel, share: float, hz: float, pictures_hz: float, n: int = 90) -> list[Any]:
    """Return pictures of a sensor under a lamp that flickers, read row by row in nine tenths of a period."""
    rows = np.arange(320)[:, None, None] / 320
    lamp = [1 + share * np.sin(2 * np.pi * hz * (k + 0.9 * rows) / pictures_hz) for k in range(n)]
    return [np.clip(gel.frame([], 60 + k) * one, 0, 255).astype(np.uint8) for k, one in enumerate(lamp)]


def banding(reported: DriverCase, sent: list[Any]) -> Any:
    found = [one for one in check_gel(reported, "D1", sent) if "bands of" in one.finding]
    assert len(found) <= 1
    assert all(one.status == "warning" for one in found)
    return found[0] if found else None


@pytest.mark.parametrize("hz", [100.0, 120.0])
def test_bands_of_mains_light_are_measured_with_and_without_a_baseline(tmp_path: Path, hz: float) -> None:
    gel = Gel(5)
    for reported in (case(tmp_path, pictures(gel)), BARE):
        found = banding(reported, banded(gel, 0.01, hz, 58.0, n=30))
        assert "hardly" not in found.finding
        assert found.measured["banding_percent"] == pytest.approx(1.0, abs=0.3)


@pytest.mark.parametrize(
    ("hz", "pictures_hz"),
    [
        (120.0, 60.0),
        (119.9, 60.0),
        *(
            pytest.param(*rates, marks=pytest.mark.slow)
            for rates in ((120.02, 60.0), (120.1, 30.0), (100.05, 25.0))
        ),
    ],
)
def test_bands_that_hardly_move_are_measured(tmp_path: Path, hz: float, pictures_hz: float) -> None:
    gel = Gel(6)
    sent = banded(gel, 0.02, hz, pictures_hz)
    turned = [np.swapaxes(picture, 0, 1) for picture in sent]
    stand = hz == 2 * pictures_hz
    found = banding(case(tmp_path, pictures(gel)), sent)
    assert ("its baseline has not" if stand else "or more hardly move") in found.finding
    assert "areas wrong" in found.why
    assert (1.8 if stand else 0.2) < found.measured["banding_percent"] < 2.2
    # Without a baseline, those that stand still look like the gel.
    for one in (sent, turned):
        assert (banding(BARE, one) is None) == stand


def test_without_a_lamp_nothing_is_said_of_bands(tmp_path: Path) -> None:
    gel = Gel(1)
    sent, reported = banded(gel, 0.0, 120.0, 60.0, n=60), case(tmp_path, pictures(gel))
    dimming = [np.clip(picture * (1 - 0.0005 * k), 0, 255).astype(np.uint8) for k, picture in enumerate(sent)]
    touched = pictures(gel, indenters=[ball(force_n=2.0)])
    for one in (dimming, sent[:30] + touched):
        assert banding(BARE, one) is None
        assert banding(reported, one) is None
