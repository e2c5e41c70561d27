"""Open the vest, hand and output files that a session writes to, and its operator's input devices."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from typing import Any, Final, NamedTuple

from tega.config import SessionConfig
from tega.devices.base import DeviceInfo, HandDriver, SteeredHand, TellingHand, VestSink, optional
from tega.devices.registry import driver_class
from tega.errors import ConfigError
from tega.hand import split_level
from tega.hand.link import HandSpoken
from tega.loop.inbox.inputs import Inputs, Seat
from tega.loop.pacing import refuse_live
from tega.loop.snapshot import LoopView
from tega.loop.worn_vest import dose_file, worn_vest
from tega.records import HandExchange, bus_frames
from tega.records.bus import Bus

# Nobody wears these.
_DISPLAYED: Final = ("on-screen-vest", "sound-vest")
_Hand = HandDriver | SteeredHand | None


class Sinks(NamedTuple):
    """Outputs of a run: vests that are real or only record, hands that only take frames or close their own loop.

    ``tables`` describe the tables in the output folder; empty without one.
    """

    live_vests: list[VestSink]
    vests: list[VestSink]
    hands: list[HandDriver]
    steered: SteeredHand | None
    tables: tuple[DeviceInfo, ...] = ()

    def displayed(self, view: LoopView) -> LoopView:
        """Add the status that the real vest reports to a view of the loop."""
        conditions = [optional(vest, "condition") for vest in self.live_vests]
        return view._replace(vest_condition="; ".join(filter(None, conditions)))


def open_inputs(stack: ExitStack, config: SessionConfig) -> Inputs:
    """Open the operator's input devices."""
    seats = {}
    for name, c in config.input.in_use().items():
        source = stack.enter_context(driver_class(c.driver, "input")(c.options))
        refuse_live(source.info, config.session.pace)
        seats[name] = Seat(source, c.button)
    return Inputs(seats)


def live_outputs(to: SessionConfig) -> tuple[bool, list[str]]:
    """Return whether any output runs on its own clock, and those that are neither drawing, sound nor virtual bus."""
    from tega.devices.hand.python_can import may_have_hardware

    live, real = False, []
    for kind, section in (("vest", to.vest), ("hand", to.hand)):
        if section.driver is not None:
            info, options = driver_class(section.driver)(section.options).info, section.options
            live = live or info.live
            interface = getattr(options, "interface", None)
            on_a_bus = interface is None or may_have_hardware(interface, options.channel)
            if info.live and section.driver not in _DISPLAYED and on_a_bus:
                real.append(f"{kind}: {info.driver}, {info.label}")
    return live, real


def open_sinks(
    stack: ExitStack, config: SessionConfig, bus: Bus, hand: _Hand, stop: Callable[[], bool]
) -> Sinks:
    """Open the outputs of a run: vest, then hand, unless ``stop`` returns true: then it is ``KeyboardInterrupt``."""
    if config.session.pace == "fast" and (real := live_outputs(config)[1]):
        raise ConfigError(f"session.pace = 'fast', but {real[0]} is live", "set session.pace = 'real'")
    sinks = Sinks([], [], [], None)
    if config.vest.driver is not None:
        vest = stack.enter_context(worn_vest(config.vest, dose_file(config.calibration)))
        (sinks.live_vests if vest.info.live else sinks.vests).append(vest)
    if hand is not None:
        _listen(hand, bus)
        if stop():
            raise KeyboardInterrupt
        stack.enter_context(hand)
        if isinstance(hand, SteeredHand):
            return sinks._replace(steered=hand)
        sinks.hands.append(hand)
    return sinks


def _listen(hand: Any, bus: Bus) -> None:
    """Publish every exchange with a hand; called before the hand is opened, so that none is missed."""
    if not isinstance(hand, TellingHand) or not bus.wants(HandExchange):
        return

    def exchanged(spoken: HandSpoken) -> None:
        whole, closure = split_level(spoken.level)
        bus.publish(
            HandExchange(
                t_ns=spoken.t_ns,
                level=whole,
                closure=closure,
                added=spoken.added,
                received=bus_frames(spoken.received),
                sent=bus_frames(spoken.out),
                action=spoken.action,
            )
        )

    hand.on_exchange = exchanged
