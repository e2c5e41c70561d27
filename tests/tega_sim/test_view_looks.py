"""Objects are drawn as what they stand for, and no further from what fingers touch than a quarter of the radius."""

from __future__ import annotations

import pytest

pytest.importorskip("viser", reason="needs the extra view")

from tega.ui.view.browser.object_shapes import LOOKS
from tega.ui.view.browser.solids import _parts
from tega.ui.view.state import Shape
from tega_sim.world.objects import OBJECTS

ROOT_2 = 2**0.5


@pytest.mark.parametrize("name", sorted(LOOKS))
def test_a_look_stands_where_the_object_stands_and_ends_where_it_ends(name: str) -> None:
    assert min(part.middle - part.tall for part in LOOKS[name]) == pytest.approx(-1.0, abs=0.01)
    assert max(part.middle + part.tall for part in LOOKS[name]) == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize("name", sorted(OBJECTS))
def test_every_object_has_a_look_that_is_near_its_wall_where_it_is_grasped(name: str) -> None:
    for height in (-0.3, 0.0, 0.3):
        near, far = [], []
        for part in LOOKS[name]:
            up = abs(height - part.middle) / part.tall
            if up <= 1:
                wide = part.wide * ((1 - up**2) ** 0.5 if part.primitive == "ball" else 1)
                near.append(wide)
                far.append(wide * ROOT_2 if part.primitive == "box" else wide)
        assert max(near) > 0.85
        assert max(far) < 1.25


def test_a_cylinder_of_another_name_stays_one() -> None:
    shapes: list[Shape] = [
        ("bottle", "cylinder", (0.04, 0.13, 0.0), (0.4, 0.6, 0.8, 1.0)),
        ("pipe", "cylinder", (0.04, 0.13, 0.0), (0.4, 0.6, 0.8, 1.0)),
    ]
    parts = _parts(shapes)
    assert [part.shape for part in parts["tube"]].count(0) == 4
    (pipe,) = (part for part in parts["tube"] if part.shape == 1)
    assert (pipe.scale, pipe.shade) == ((0.04, 0.04, 0.13), 1.0)
    body = parts["tube"][0]
    assert body.scale == pytest.approx((0.04, 0.04, 0.69 * 0.13))
    assert body.offset_m == pytest.approx(-0.31 * 0.13)
