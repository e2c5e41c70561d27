"""A tracked contact in millimetres: only where the scale was given, and the same place and size as in pixels."""

from __future__ import annotations

import numpy as np
import pytest

from tega.tactile.tracker import GelLight, TouchTracker, TrackedContact, nominal_light


def pressed(light: GelLight | None, shape: tuple[int, int]) -> TrackedContact:
    gel = np.full((*shape, 3), 90, np.uint8)
    tracker = TouchTracker(gel, light=light)
    frame = gel.copy()
    frame[100:160, 80:140] += 40
    tracker.update(frame)
    return tracker.update(frame)


@pytest.mark.parametrize("shape", [(320, 240), (240, 320), (480, 640)])
def test_middle_spread_and_area_are_scaled_alike(shape: tuple[int, int]) -> None:
    light = nominal_light()._replace(mm_per_px=0.06)
    contact = pressed(light, shape)
    # The scale is that of a picture of 320 x 240.
    mm = 0.06 * 400 / np.hypot(*shape)
    assert contact.in_contact
    assert contact.area_mm2 == pytest.approx(contact.eda * mm**2)
    assert contact.spread_mm == pytest.approx(contact.spread * mm)
    assert contact.centroid_mm == pytest.approx([(at + 0.5) * mm for at in contact.centroid_xy])


def test_without_a_scale_there_are_no_millimetres() -> None:
    contact = pressed(None, (320, 240))
    assert contact.in_contact
    assert (contact.area_mm2, contact.centroid_mm, contact.spread_mm) == (None, None, None)
