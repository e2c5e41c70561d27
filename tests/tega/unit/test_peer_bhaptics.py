"""The emulated Player's version 3 against the vendor's own client, whose unpacked wheel ``TEGA_BHAPTICS`` names."""

from __future__ import annotations

import asyncio
import json
import os
import sys
from typing import Any

import pytest

from tega_emulators.process import Emulator
from tega_emulators.vest_bench import seen_by

PORT = 15882  # the client asks for no other


@pytest.fixture
def client(monkeypatch: pytest.MonkeyPatch) -> Any:
    folder = os.environ.get("TEGA_BHAPTICS")
    if not folder:
        pytest.skip(
            "set TEGA_BHAPTICS to an unpacked wheel of bhaptics-python 0.2.0, which asks the vendor's server, too"
        )
    monkeypatch.syspath_prepend(folder)
    return pytest.importorskip("bhaptics_python", exc_type=ImportError)


def test_the_emulator_serves_the_vendor_s_client(client: Any) -> None:
    values = [0] * 40
    values[0], values[20] = 80, 13

    async def talk(player: Emulator) -> tuple[bool, list[Any], list[int], list[int]]:
        assert await client.registry_and_initialize("app", "key", "{}")
        for _ in range(100):
            if await client.is_bhaptics_device_connected(0):
                break
            await asyncio.sleep(0.05)
        connected = await client.is_bhaptics_device_connected(0)
        devices = json.loads(await client.get_device_info_json())
        await client.play_dot(0, 2000, values)
        await asyncio.sleep(0.3)
        played = seen_by(player).motors
        await client.stop_all()
        await asyncio.sleep(0.3)
        return connected, devices, played, seen_by(player).motors

    with Emulator("bhaptics_player", "--port", "0", "--port-v3", str(PORT)) as player:
        connected, devices, played, stopped = asyncio.run(talk(player))
        report = seen_by(player)
    assert connected
    assert {d["deviceName"]: d["battery"] for d in devices} == {"TactSuitX40": 98, "Tactosy2 (L)": 26}
    assert played == values
    assert stopped == [0] * 40
    assert report.errors == []
    assert "bhaptics_python" in sys.modules
