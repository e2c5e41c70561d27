"""Every emulator at once, each in a process of its own, and where they can be reached.

Example::

    with EmulatedBench() as bench:
        print(bench.looked["digit"].found)
"""

from __future__ import annotations

import os
from contextlib import ExitStack
from pathlib import Path
from typing import Self

from tega.config import FINGERS, load_config
from tega.config.calibration import Calibration, TouchMaxima, save_calibration
from tega.devices import Found, driver_class
from tega.errors import DeviceUnavailableError
from tega.loop.maxima import emg_conditions
from tega.runtime.lifecycle import require
from tega.setup.doctor.bench import DriverProbe
from tega.setup.doctor.lab_file import lab_settings
from tega_emulators.bench_moves import Moves
from tega_emulators.emulated_operator import EmulatedOperator
from tega_emulators.lab import keep_baseline
from tega_emulators.process import Emulator

__all__ = ["EmulatedBench"]

# The emulated muscles' mean is about half of it.
_FULL_UV = 200.0
# What an emulated hand may take, which is a program that a busy machine holds up now and then.
_PATIENT = {"lowest_rate_hz": 10.0, "silent_after_ms": 1000.0}


class EmulatedBench:
    """Two fingertip cameras, an OpenBCI Cyton, a Player with a vest, and an Allegro Hand.

    ``arm`` is the driver of an arm that is led too, ``franky`` on franky-sim's robot; ``operator`` is who
    leads it, if there is one. ``digits`` are thumb first; ``moves`` moves muscles and fingertips; ``looked``
    is what would have been found, had they been real.
    """

    def __init__(self, arm: str | None = None) -> None:
        self._up = ExitStack()
        # Their pictures go over HTTP, which costs more than USB; half the rate leaves room on two cores.
        self.digits = [Emulator("digit", "--rate-hz", "30", "--seed", str(seed)) for seed in range(2)]
        self.board = Emulator("cyton", "--signal", "emg")
        self.player = Emulator("bhaptics_player", "--port", "0")
        self.hand = Emulator("allegro_port")
        self.operator = None if arm is None else EmulatedOperator(arm)
        self.moves = Moves(self.digits, self.board, self.player, self.hand)
        self.looked: dict[str, DriverProbe] = {}

    def __enter__(self) -> Self:
        """Start them; this needs pseudo-terminals."""
        for module in ("can", "cv2", "serial", "websockets"):
            require(module, driver="an emulated bench", extra="lab")
        if os.name != "posix":
            raise DeviceUnavailableError(
                "emulated serial devices need pseudo-terminals, which this system lacks", "use Linux or macOS"
            )
        with ExitStack() as starting:
            devices = [*self.digits, self.board, self.player, self.hand]
            for device in devices:
                starting.enter_context(device)
            if self.operator is not None:
                devices += starting.enter_context(self.operator).devices
            # Programs that stand for devices would have to wait on a busy machine, as no device does.
            for device in devices:
                device.go_ahead()
            starting.enter_context(self.moves)
            self._up = starting.pop_all()
        cameras = [
            Found(
                driver="digit",
                label=f"emulated camera {n}",
                # What a calibration is kept under, as under a serial number.
                options={"source": f"{digit.address['source']}/E0000{n}", "rate_hz": 30.0},
            )
            for n, digit in enumerate(self.digits, start=1)
        ]
        amplifier = Found(driver="cyton", label="emulated Cyton", options={"port": self.board.port})
        port = self.player.address["port"]
        vest = Found(driver="bhaptics-player", label="emulated Player", options={"port": port})
        hand = Found(driver="allegro", label="emulated Allegro Hand", options=self.hand.address | _PATIENT)
        self.looked = {
            "digit": DriverProbe("tactile", cameras),
            "cyton": DriverProbe("emg", [amplifier]),
            "bhaptics-player": DriverProbe("vest", [vest]),
            "allegro": DriverProbe("hand", [hand]),
        }
        if self.operator is not None:
            self.looked |= self.operator.looked
        return self

    def write_settings(self, file: Path) -> None:
        """Write settings that reach the emulators, with baselines and a calibration made for them.

        All but the settings file goes into a folder of the same name beside it.
        """
        import msgspec

        folder = file.with_suffix("")
        folder.mkdir(parents=True, exist_ok=True)
        fingers = FINGERS[: len(self.digits)]
        baselines = {finger: Path(folder.name, f"{finger}.npy") for finger in fingers}
        calibration = Path(folder.name, "calibration.toml")
        arm = None if self.operator is None else self.operator.tables
        text = lab_settings(
            self.looked, name=file.name, emulated=True, baselines=baselines, calibration=calibration, arm=arm
        )
        file.write_text(text, encoding="utf-8")
        if self.operator is not None:
            self.operator.write_hidapi(folder / "hidapi")
        config = load_config(file, environ={}).config
        for finger, section in config.tactile.items():
            keep_baseline(section.options, file.parent / baselines[finger])
        # Where a rehearsal's participant reaches them; a press before now would be in the untouched picture.
        (folder / "moves.json").write_text(f'{{"port": {self.moves.port}}}\n', encoding="utf-8")
        if config.emg is None:
            return
        amplifier = driver_class(config.emg.driver, "emg")(config.emg.options)
        conditions = emg_conditions(amplifier, config.emg.kind)
        touch = TouchMaxima(cci_max=1.0, eda_max=10_000.0)
        save_calibration(
            Calibration(
                preset=config.session.preset,
                origin="made up for the emulated devices",
                tactile=dict.fromkeys(fingers, touch),
                emg=msgspec.structs.replace(conditions, maxima=(_FULL_UV,) * len(conditions.channels)),
            ),
            file.parent / calibration,
        )

    def __exit__(self, *_error: object) -> None:
        """End them."""
        self._up.close()
