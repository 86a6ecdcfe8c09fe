"""Pairs of links that are not checked, against those of an SRDF."""

import xml.etree.ElementTree as ET

from descriptions import ARMS, description

from guided_lgp.robots.measures.pairs import sampled_pairs


def test_sampled_pairs_are_nearly_those_of_the_srdf() -> None:
    panda = ARMS["panda"]
    limits = {
        name: (float(low), float(high))
        for name, (low, high) in zip(panda.joints, panda.limits(), strict=True)
    }
    sampled = sampled_pairs(panda.urdf, limits)
    srdf = ET.parse(description("panda_description/srdf/panda.srdf")).getroot()
    stated = {
        frozenset((pair.get("link1"), pair.get("link2")))
        for pair in srdf.iter("disable_collisions")
    }
    assert sampled == sampled_pairs(panda.urdf, limits)
    fingers = {"panda_leftfinger", "panda_rightfinger"}
    assert {pair for pair in sampled - stated if not pair & fingers} == set()
    assert len(stated - sampled) <= 2
    assert frozenset(("panda_link0", "panda_hand")) not in sampled  # the hand reaches its base
    assert frozenset(("panda_link3", "panda_link4")) in sampled  # neighbours
