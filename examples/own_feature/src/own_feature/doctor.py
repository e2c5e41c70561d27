"""Check the table ``[grip]`` for ``doctor``."""

from __future__ import annotations

from tega.config import SessionConfig
from tega.setup.doctor import Finding


def check_grip(config: SessionConfig) -> list[Finding]:
    """Compare the count of a firm grip with the fingers that have a sensor."""
    table, fingers = config.guests.get("grip"), len(config.tactile)
    if table is None:
        return []
    if table.firm_from > fingers:
        text = (
            f"grip.firm_from is {table.firm_from}, but {fingers} fingers have a sensor: no grip is ever firm"
        )
        return [Finding(check="grip", status="error", finding=text, todo=(f"set it to {fingers} at most",))]
    return [Finding(check="grip", status="ok", finding=f"a grip is firm from {table.firm_from} fingers on")]
