"""Opens what a session writes to, and what its operator holds."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING, Any, NamedTuple

from tega.calibration import save_calibration
from tega.calibration.person import whose
from tega.devices.base import HandDriver, SteeredHand, VestSink
from tega.devices.can_recorder import CanRecorder, CanRecorderOptions
from tega.devices.registry import driver_class
from tega.devices.vest_recorder import VestRecorder, VestRecorderOptions
from tega.errors import ConfigError
from tega.recording import RunRecorder
from tega.recording.spared import Disk, Spared
from tega.safety.dose_file import KeptDose
from tega.teleop.inputs import Inputs, Seat
from tega.teleop.keepalive import KeepAlive
from tega.teleop.pacing import refuse_live

if TYPE_CHECKING:
    from tega.config import SessionConfig
    from tega.recording.session import Recording
    from tega.teleop.prepare import Prepared

__all__ = ["Sinks", "open_inputs", "open_sinks"]


class Sinks(NamedTuple):
    """What a run writes to.

    Attributes:
        kept: The vest of the settings, if it is a real one.
        vests: A vest of the settings that only records, the vest recorder.
        hands: A hand of the settings that only takes frames, the CAN recorder.
        steered: A hand of the settings that closes its own loop.
        recorder: Of contacts and levels; ``None`` without an output folder.
    """

    kept: list[KeepAlive]
    vests: list[VestSink]
    hands: list[HandDriver]
    steered: SteeredHand | None
    recorder: RunRecorder | None


def open_inputs(stack: ExitStack, config: SessionConfig) -> Inputs:
    """Open what the operator holds or steps on."""
    seats = {}
    for name, c in config.input.in_use().items():
        source = stack.enter_context(driver_class(c.driver, "input")(c.options))
        refuse_live(source.info, config.session.pace)
        seats[name] = Seat(source, c.button)
    return Inputs(seats)


def _open_vest(stack: ExitStack, config: SessionConfig, recording: Recording | None) -> VestSink | None:
    """Open the vest of the settings; a person's comes with what is left of the day's dose."""
    if config.vest.driver is None:
        return None
    vest: VestSink = driver_class(config.vest.driver, "vest")(config.vest.options)
    budget = getattr(vest, "budget", None)
    if budget is not None and config.calibration.person is not None:
        person, calibrations = whose(config.calibration)
        stack.enter_context(KeptDose(calibrations.person(person) / "vest-dose.json", budget))
    stack.enter_context(vest)
    return recording.vest(vest) if recording is not None and vest.info.live else vest


def open_sinks(
    stack: ExitStack, config: SessionConfig, prepared: Prepared, recording: Recording | None, disk: Disk
) -> Sinks:
    """Open what is written to: the devices of the settings, then the tables of the output folder."""
    kept: list[KeepAlive] = []
    vests: list[VestSink] = []
    hands: list[HandDriver] = []
    steered: SteeredHand | None = None
    vest = _open_vest(stack, config, recording)
    if vest is not None and vest.info.live:
        kept.append(
            KeepAlive(
                vest,
                keep_alive_ns=round(config.vest.keep_alive_s * 1e9),
                period_ns=round(1e9 / config.vest.rate_hz),
                in_steps=getattr(vest, "in_steps", False),
            )
        )
    elif vest is not None:
        vests.append(vest)
    if config.hand.driver is not None:
        hand: HandDriver | SteeredHand = driver_class(config.hand.driver, "hand")(config.hand.options)
        if recording is not None:
            recording.listen(hand)
        stack.enter_context(hand)
        if isinstance(hand, SteeredHand):
            if config.session.pace == "fast":
                raise ConfigError(
                    f"session.pace = 'fast', but {hand.info.label} is live", "set session.pace = 'real'"
                )
            steered = hand
        else:
            hands.append(hand)
    folder = config.session.out_dir
    if folder is None:
        return Sinks(kept, vests, hands, steered, None)
    vest_table = VestRecorder(VestRecorderOptions(file=folder / "vest.csv"))
    hand_table = CanRecorder(CanRecorderOptions(file=folder / "can.csv"))
    vest_table.open()
    hand_table.open()
    recorder = RunRecorder(folder, prepared.muscles.maxima.channels if prepared.muscles else ())
    tables: list[Any] = [vest_table, hand_table, recorder]
    if config.session.pace == "real":
        # Somebody may be steering a hand; a computation in a hurry had better end with an error.
        tables = [Spared(table, disk) for table in tables]
    for table in tables:
        stack.callback(table.close)
    vests.append(tables[0])
    hands.append(tables[1])
    save_calibration(prepared.calibration, folder / "calibration.toml")
    return Sinks(kept, vests, hands, steered, tables[2])
