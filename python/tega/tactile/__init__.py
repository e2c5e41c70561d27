"""Turn a fingertip camera's frame and its baseline into contact metrics (equations 1 to 6)."""

from __future__ import annotations

from tega.tactile.contact import (
    ContactGate,
    ContactMetrics,
    ContactReader,
    Images,
    Reading,
    contact_mask,
    contact_metrics,
    contact_metrics_many,
    estimate_baseline,
    pressure_map,
    read_contact,
    read_contacts,
)
from tega.tactile.tracker import (
    GelLight,
    Order,
    Outline,
    TouchTracker,
    TrackedContact,
    nominal_light,
    sensor_noise,
    update_fingers,
)

__all__ = [
    "ContactGate",
    "ContactMetrics",
    "ContactReader",
    "GelLight",
    "Images",
    "Order",
    "Outline",
    "Reading",
    "TouchTracker",
    "TrackedContact",
    "contact_mask",
    "contact_metrics",
    "contact_metrics_many",
    "estimate_baseline",
    "nominal_light",
    "pressure_map",
    "read_contact",
    "read_contacts",
    "sensor_noise",
    "update_fingers",
]
