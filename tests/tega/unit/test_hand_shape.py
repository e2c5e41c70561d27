"""Shape of the hand for the simulation and the page: each link reaches from its joint to the next one."""

from __future__ import annotations

from xml.etree import ElementTree as ET

import pytest

from tega.hand.mjcf import PAD_HALF_LENGTH_M, PAD_RADIUS_M, hand_body


def numbers(one: ET.Element, name: str) -> list[float]:
    """Return the numbers of an attribute."""
    return [float(word) for word in one.attrib[name].split()]


def test_a_link_is_centred_between_its_joint_and_the_next() -> None:
    n_links = n_pads = 0
    for body in ET.fromstring(f"<hand>{hand_body()}</hand>").iter("body"):
        following, geom = body.find("body"), body.find("geom")
        is_link = "_link" in body.attrib["name"] and geom is not None and "pos" in geom.attrib
        if is_link and following is not None and geom is not None:
            length_m = numbers(following, "pos")[2]
            n_links += 1
            assert numbers(geom, "pos") == pytest.approx([0, 0, length_m / 2])
            assert 0 < numbers(geom, "size")[1] <= length_m / 2
        for pad in body.findall("geom"):
            if pad.attrib["name"].endswith("_pad"):
                n_pads += 1
                (site,) = (one for one in body.findall("site") if one.attrib["name"] == pad.attrib["name"])
                assert numbers(pad, "size") == [PAD_RADIUS_M, PAD_HALF_LENGTH_M]
                assert numbers(site, "pos") == [PAD_RADIUS_M, 0, numbers(pad, "pos")[2]]
    assert n_links >= 8
    assert n_pads == 4
