"""Pairs of links that are not checked, against those of an SRDF."""

from descriptions import ARMS

from guided_lgp.robots import load_robot
from guided_lgp.robots.measures.pairs import sampled_pairs


def test_the_srdf_leaves_out_what_meets_never_or_always() -> None:
    panda = ARMS["panda"]
    limits = {
        name: (float(low), float(high))
        for name, (low, high) in zip(panda.joints, panda.limits(), strict=True)
    }
    sampled = sampled_pairs(panda.urdf, limits)
    stated = load_robot("panda").disabled_pairs
    assert sampled == sampled_pairs(panda.urdf, limits)
    fingers = {"panda_leftfinger", "panda_rightfinger"}
    assert {pair for pair in sampled ^ stated if not pair & fingers} == set()
    assert stated <= sampled
    assert frozenset(("panda_link0", "panda_hand")) not in sampled  # the hand reaches its base
    assert frozenset(("panda_link3", "panda_link4")) in sampled  # neighbours
