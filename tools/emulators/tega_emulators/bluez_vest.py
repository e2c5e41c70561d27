"""An emulated bHaptics X40 behind the D-Bus interface of BlueZ, on a private bus.

It starts a message bus of its own (``dbus-daemon`` has to be installed; Linux only), claims the name ``org.bluez`` on
it, and shows one adapter and one vest there. A client whose ``DBUS_SYSTEM_BUS_ADDRESS`` is set to the address it prints
finds them with any Bluetooth library that goes through BlueZ. No radio is involved: advertising, connection intervals
and losses are not shown. The frame's layout is that of the open descriptions of this vest. Like the vest, as far as is
known, it holds the last frame for ever, over a lost link too.

Faults: ``drop`` (the link breaks), ``freeze`` (a write is never answered), ``slow`` (after 150 ms), ``refuse`` (does
not let itself be connected), ``held`` (a program that died has left it connected), ``off`` (is not found, though BlueZ
remembers it), ``wrong-version`` (has no motor characteristic), ``garbage`` (an empty battery level), ``no-adapter``.
"""

from __future__ import annotations

import asyncio
from typing import Any, ClassVar

from dbus_fast import Message, MessageType, Variant
from dbus_fast.aio import MessageBus

from tega_emulators import vest_process
from tega_emulators.message_bus import PrivateBus
from tega_emulators.vest_process import Motors

_ADAPTER = "/org/bluez/hci0"
_ADDRESS = "C0:FF:EE:00:40:01"
_DEVICE = f"{_ADAPTER}/dev_{_ADDRESS.replace(':', '_')}"
_SERVICE = f"{_DEVICE}/service000a"
_UUID = "6e40{}-b5a3-f393-e0a9-e50e24dcca9e"
_MOTORS, _BATTERY = f"{_SERVICE}/char000b", f"{_SERVICE}/char000e"
_SLOW_S = 0.15
_PROPERTIES = "org.freedesktop.DBus.Properties"

# The motor behind each four-bit slot of the frame, slot 0 first: F front, B back, row by row from the top.
_SLOTS = (  # noqa: SIM905  # reads like the table it is
    "F3 F2 F7 F6 F11 F10 F15 F14 F19 F18 B0 B1 B4 B5 B8 B9 B12 B13 B16 B17 "
    "B2 B3 B6 B7 B10 B11 B14 B15 B18 B19 F1 F0 F5 F4 F9 F8 F13 F12 F17 F16"
).split()


class BluezVest:
    """BlueZ, its adapter and the vest."""

    faults: ClassVar[tuple[str, ...]] = (
        "drop",
        "freeze",
        "slow",
        "refuse",
        "held",
        "off",
        "wrong-version",
        "garbage",
        "no-adapter",
    )

    def __init__(self) -> None:
        self.motors = Motors()
        self.errors: list[str] = []
        self.received = 0
        self.connections = 0
        self._fault = ""
        self._connected = False
        self._discovering = False
        self._private = PrivateBus()
        self._tasks: set[asyncio.Task[None]] = set()

    async def start(self) -> dict[str, Any]:
        """Start the bus and appear on it."""
        address = await self._private.start()
        self._bus = await MessageBus(bus_address=address).connect()
        self._bus.add_message_handler(self._answer)
        await self._bus.request_name("org.bluez")
        self._start(self._advertise())
        return {"bus": address, "vest": _ADDRESS}

    def stop(self) -> None:
        """End the bus."""
        self._private.stop()

    async def fault(self, name: str) -> None:
        """Switch a fault on."""
        self._fault = name
        if name in {"drop", "refuse", "held", "off", "wrong-version", "no-adapter"} and self._connected:
            self._set_connected(on=False)
        if name == "held":
            self._connected = True

    def _start(self, work: Any) -> None:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _advertise(self) -> None:
        strength = -60
        while True:
            await asyncio.sleep(0.05)
            if self._discovering and not self._connected and self._fault != "off":
                strength = -60 if strength != -60 else -61
                self._changed(_DEVICE, "org.bluez.Device1", {"RSSI": Variant("n", strength)})

    def _set_connected(self, *, on: bool) -> None:
        self._connected = on
        self.connections += on
        self._changed(
            _DEVICE,
            "org.bluez.Device1",
            {"Connected": Variant("b", on), "ServicesResolved": Variant("b", on)},
        )

    def _changed(self, path: str, interface: str, values: dict[str, Variant]) -> None:
        body = [interface, values, []]
        self._bus.send(Message.new_signal(path, _PROPERTIES, "PropertiesChanged", "sa{sv}as", body))

    def _answer(self, message: Message) -> Message | bool:  # noqa: PLR0911  # one for each call
        if message.message_type is not MessageType.METHOD_CALL:
            return False
        call = (message.interface or "").rsplit(".", maxsplit=1)[-1] + "." + (message.member or "")
        if call == "ObjectManager.GetManagedObjects":
            return Message.new_method_return(message, "a{oa{sa{sv}}}", [self._objects()])
        if call in {"Adapter1.SetDiscoveryFilter", "Adapter1.StartDiscovery", "Adapter1.StopDiscovery"}:
            if call != "Adapter1.SetDiscoveryFilter":
                self._discovering = call == "Adapter1.StartDiscovery"
            return Message.new_method_return(message)
        if call == "Device1.Connect" and self._fault in {"refuse", "held", "off"}:
            return Message.new_error(message, "org.bluez.Error.Failed", "le-connection-refused")
        if call in {"Device1.Connect", "Device1.Disconnect"}:
            self._set_connected(on=call == "Device1.Connect")
            return Message.new_method_return(message)
        if not self._connected:
            return Message.new_error(message, "org.bluez.Error.Failed", "Not connected")
        if call == "GattCharacteristic1.ReadValue" and message.path == _BATTERY:
            return Message.new_method_return(
                message, "ay", [b"" if self._fault == "garbage" else b"\x4d\x00"]
            )
        if call == "GattCharacteristic1.WriteValue" and message.path == _MOTORS:
            self._start(self._write(message))
            return True
        self.errors.append(f"{call} on {message.path}")
        return Message.new_error(message, "org.bluez.Error.NotSupported", "not emulated")

    async def _write(self, message: Message) -> None:
        if self._fault == "freeze":
            return
        if self._fault == "slow":
            await asyncio.sleep(_SLOW_S)
        frame, how = bytes(message.body[0]), message.body[1]
        self.received += 1
        if len(frame) != len(_SLOTS) // 2:
            self.errors.append(f"a frame of {len(frame)} bytes")
        elif how.get("type", Variant("s", "?")).value != "command":
            self.errors.append("a write that waits for a response")
        else:
            self._drive(frame)
        self._bus.send(Message.new_method_return(message))

    def _drive(self, frame: bytes) -> None:
        values = [0] * 40
        for slot, motor in enumerate(_SLOTS):
            level = frame[slot // 2] >> 4 if slot % 2 == 0 else frame[slot // 2] & 0xF
            values[int(motor[1:]) + (20 if motor[0] == "B" else 0)] = round(level * 100 / 15)
        self.motors.set(values)

    def _objects(self) -> dict[str, dict[str, dict[str, Variant]]]:
        objects = {
            _DEVICE: {
                "org.bluez.Device1": {
                    "Address": Variant("s", _ADDRESS),
                    "Name": Variant("s", "TactSuitX40_EMU"),
                    "Alias": Variant("s", "TactSuitX40_EMU"),
                    "Appearance": Variant("q", 509),
                    "Adapter": Variant("o", _ADAPTER),
                    "UUIDs": Variant("as", [_UUID.format("0001")] if self._connected else []),
                    "Paired": Variant("b", value=False),
                    "Connected": Variant("b", self._connected),
                    "ServicesResolved": Variant("b", self._connected),
                }
            },
            _SERVICE: {
                "org.bluez.GattService1": {
                    "UUID": Variant("s", _UUID.format("0001")),
                    "Device": Variant("o", _DEVICE),
                    "Primary": Variant("b", value=True),
                }
            },
            _BATTERY: _characteristic("0008", ["read", "notify"]),
        }
        if self._fault != "wrong-version":
            objects[_MOTORS] = _characteristic("000a", ["write", "write-without-response"])
        if self._fault != "no-adapter":
            objects[_ADAPTER] = {
                "org.bluez.Adapter1": {
                    "Address": Variant("s", "C0:FF:EE:00:00:00"),
                    "Powered": Variant("b", value=True),
                    "Roles": Variant("as", ["central"]),
                }
            }
        return objects


def _characteristic(number: str, flags: list[str]) -> dict[str, dict[str, Variant]]:
    return {
        "org.bluez.GattCharacteristic1": {
            "UUID": Variant("s", _UUID.format(number)),
            "Service": Variant("o", _SERVICE),
            "Flags": Variant("as", flags),
            "MTU": Variant("q", 23),
        }
    }


async def _run() -> None:
    vest = BluezVest()
    try:
        await vest_process.serve(vest)
    finally:
        vest.stop()


def main() -> None:
    """Run it until standard input ends."""
    asyncio.run(_run())


if __name__ == "__main__":
    main()
