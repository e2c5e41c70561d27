"""Declare the WebSocket: records of a run as JSON, and commands of one client under the run's limits."""

from __future__ import annotations

from tega.runtime.features import Feature

FEATURE = Feature(
    summary="JSON over WebSocket for game engines, browsers and MATLAB.",
    settings={"websocket": "tega_websocket.settings:WebSocketTable"},
    check="tega_websocket.settings:check_table",
    part="tega_websocket.part:open_part",
    extra="websocket",
)
