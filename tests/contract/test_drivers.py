"""Every registered driver, through the contract."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from contract.peers import PEERS
from tega.devices import Options, driver_class, driver_names
from tega.testing.contract import check_driver
from tega.testing.emulators.allegro_process import AllegroProcess
from tega.testing.emulators.digit import DigitProcess


def _images(folder: Path) -> dict[str, Any]:
    rng = np.random.default_rng(1)
    for k in range(5):
        cv2.imwrite(str(folder / f"f{k}.png"), rng.integers(0, 256, (24, 32, 3), dtype=np.uint8))
    return {"folder": folder}


def _video(folder: Path) -> dict[str, Any]:
    writer = cv2.VideoWriter(str(folder / "v.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 30.0, (32, 24))
    for k in range(5):
        writer.write(np.full((24, 32, 3), 40 * k, np.uint8))
    writer.release()
    return {"file": folder / "v.avi"}


def _emg(folder: Path) -> dict[str, Any]:
    np.save(folder / "emg.npy", np.arange(250.0).reshape(-1, 2))
    return {"file": folder / "emg.npy", "rate_hz": 200.0}


def _allegro(folder: Path) -> dict[str, Any]:
    del folder
    hand = AllegroProcess()
    EMULATED.append(hand)
    return {**hand.__enter__().options, "silent_after_ms": 1000, "lowest_rate_hz": 50}


def _digit(folder: Path) -> dict[str, Any]:
    del folder
    sensor = DigitProcess()
    EMULATED.append(sensor)
    return {"source": sensor.__enter__().source, "warm_up_s": 0.1}


EMULATED: list[AllegroProcess | DigitProcess] = []


@pytest.fixture(autouse=True)
def _end_emulated() -> Iterator[None]:
    yield
    while EMULATED:
        EMULATED.pop().unplug()


OPTIONS: dict[str, Callable[[Path], dict[str, Any]]] = {
    "allegro": _allegro,
    "can-recorder": lambda folder: {"file": folder / "can.csv"},
    "digit": _digit,
    "emg-file": _emg,
    "images": _images,
    "python-can": lambda _folder: {"interface": "virtual", "channel": "contract"},
    "synthetic-emg": lambda _folder: {"seed": 1, "duration_s": 1.0},
    "synthetic-touch": lambda _folder: {"seed": 1, "duration_s": 0.2},
    "vest-recorder": lambda folder: {"file": folder / "vest.csv"},
    "video": _video,
}


# With their emulators, in test_vests.py.
VESTS = {"bhaptics-ble", "bhaptics-player", "hid-vest", "on-screen-vest"}


def test_every_built_in_driver_is_put_through_the_contract() -> None:
    covered = set(OPTIONS) | set(PEERS)
    assert covered <= set(driver_names())
    built_in = {n for n in driver_names() if driver_class(n).__module__.startswith("tega.")}
    assert built_in == covered | VESTS


@pytest.mark.parametrize("name", sorted(OPTIONS))
def test_contract(name: str, tmp_path: Path) -> None:
    driver = driver_class(name)
    make: Any = driver.options_type
    check_driver(driver, make(**OPTIONS[name](tmp_path)))


@pytest.mark.parametrize("name", sorted(PEERS))
def test_contract_with_a_peer(name: str, tmp_path: Path) -> None:
    driver = driver_class(name)
    make: Any = driver.options_type
    with PEERS[name](tmp_path) as options:
        check_driver(driver, make(**options))


class _Forgetful:
    """An EMG source that does not start again when it is opened again."""

    kind = "emg"
    summary = "breaks a rule on purpose"
    extra = ""
    requires = ()
    options_type = Options

    def __init__(self, options: Any) -> None:
        inner: Any = driver_class("emg-file")
        self._inner = inner(options)
        self._opened = 0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._inner, name)

    @property
    def info(self) -> Any:
        return self._inner.info

    @property
    def ended(self) -> bool:
        return bool(self._inner.ended)

    def open(self) -> None:
        self._opened += 1
        self._inner.open()
        if self._opened > 3:
            self._inner.read(0.0)

    def close(self) -> None:
        self._inner.close()

    def read(self, timeout_s: float) -> Any:
        return self._inner.read(timeout_s)

    def __enter__(self) -> Any:
        self.open()
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()


def test_the_contract_notices_a_source_that_does_not_start_again(tmp_path: Path) -> None:
    make: Any = driver_class("emg-file").options_type
    forgetful: Any = _Forgetful
    device = forgetful(make(**_emg(tmp_path)))
    device._opened = 2
    from tega.testing import contract

    with pytest.raises(AssertionError, match="starts from its beginning"):
        contract._check_source(device, 64)
