"""Every registered driver, through the contract."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tega.devices import Found, Options, driver_class, driver_names, list_drivers
from tega.errors import TegaError
from tega.setup.contract import check_driver, main
from tega.setup.contract.devices import check_source
from tega_emulators.benches import BENCHES, why_not


def test_every_built_in_driver_is_put_through_the_contract() -> None:
    built_in = {n for n in driver_names() if driver_class(n).__module__.startswith(("tega.", "tega_"))}
    assert built_in == set(BENCHES)


# Each waits some seconds for a device that answers in its own time, or computes a whole bench.
_LONG = {"allegro", "bench-arm", "chords", "lsl-emg"}


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow if n in _LONG else ()) for n in driver_names()]
)
def test_contract(name: str, tmp_path: Path) -> None:
    if name not in BENCHES:
        pytest.skip(f"{name} is not TEGA's own: python -m tega.setup.contract {name}")
    missing = {r.name: r.problem for r in list_drivers()}[name]
    if reason := why_not(name) or missing:
        pytest.skip(reason)
    driver = driver_class(name)
    make: Any = driver.options_type
    with BENCHES[name].start(tmp_path) as options:
        check_driver(driver, make(**options))


@pytest.mark.slow
def test_the_contract_from_a_shell(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert main(["emg-file", "vest-recorder", "synthetic-emg"]) == 0
    message = capsys.readouterr().out
    assert [line.split()[:2] for line in message.splitlines()] == [
        ["ok", "emg-file"],
        ["ok", "vest-recorder"],
        ["ok", "synthetic-emg"],
    ]
    assert main(["vest-recorder", "--set", f"file={tmp_path / 'v.csv'}"]) == 0
    assert main(["cyton", "--set", "port=/dev/nowhere"]) == 2
    assert "not tried" in capsys.readouterr().out
    assert main(["cyton", "--set", "prot=/dev/nowhere"]) == 2
    assert "did you mean 'port'" in capsys.readouterr().out
    assert main(["--real", "digit"]) == 2
    assert "set either serial or source" in capsys.readouterr().out
    for words, text in (
        (["no-such-driver"], "'no-such-driver'"),
        (["--set", "a=b"], "the name of one driver"),
    ):
        with pytest.raises(SystemExit, match="2"):
            main(words)
        assert text in capsys.readouterr().err
    words = [sys.executable, "-m", "tega.setup.contract", "synthetic-touch"]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert done.stdout.startswith("ok")
    assert done.stderr == ""


Recorded = tuple[Any, Any]


@pytest.fixture
def recorded(tmp_path: Path) -> Recorded:
    np.save(tmp_path / "emg.npy", np.arange(250.0).reshape(-1, 2))
    parent: Any = driver_class("emg-file")
    return parent, parent.options_type(file=tmp_path / "emg.npy", rate_hz=200.0)


def test_the_contract_notices_a_source_that_gives_other_samples_again(recorded: Recorded) -> None:
    parent, options = recorded
    opened = []

    class Forgetful(parent):  # type: ignore[valid-type, misc]
        def open(self) -> None:
            super().open()
            opened.append(self)

        def read(self, timeout_s: float) -> Any:
            chunk = super().read(timeout_s)
            return chunk and chunk._replace(samples=chunk.samples + len(opened))

    device: Any = Forgetful(options)
    with pytest.raises(AssertionError, match="starts from its beginning"):
        check_source(device, 64)


@pytest.mark.parametrize(
    ("found", "rule"),
    [
        ({"label": "one", "driver": "other"}, "names this driver"),
        ({"label": ""}, "has a label"),
        ({"label": "one", "options": {"no_such": 1}}, "options that a settings file can hold"),
        ({"label": "one", "options": {"file": Path("x")}}, "options that a settings file can hold"),
        ({"label": "one", "hint": "do"}, "a hint is for a problem"),
    ],
)
def test_the_contract_checks_what_drivers_find(found: dict[str, Any], rule: str, recorded: Recorded) -> None:
    parent, options = recorded

    class Finder(parent):  # type: ignore[valid-type, misc]
        @classmethod
        def discover(cls, timeout_s: float) -> list[Found]:  # noqa: ARG003
            return [Found(**{"driver": "emg-file", **found})]

    finder: Any = Finder
    with pytest.raises(AssertionError, match=rule):
        check_driver(finder, options)


def test_the_contract_looks_at_what_a_driver_calls_harmless(recorded: Recorded, tmp_path: Path) -> None:
    parent, options = recorded

    class Careless(parent):  # type: ignore[valid-type, misc]
        answer: Any = Options()

        @classmethod
        def harmless(cls, options: Any) -> Any:  # noqa: ARG003
            return cls.answer

    careless: Any = Careless
    with pytest.raises(AssertionError, match="of the driver's options_type"):
        check_driver(careless, options)
    Careless.answer = options
    check_driver(careless, options)
    Careless.answer = parent.options_type(file=tmp_path / "none.npy", rate_hz=200.0)
    with pytest.raises(TegaError):
        check_driver(careless, options)
