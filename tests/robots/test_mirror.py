"""The mirror test on arms of robots with two of them."""

from dataclasses import replace

import numpy as np
from descriptions import ARMS

from guided_lgp.robots.chain import read_chain
from guided_lgp.robots.measures.mirror import mirror_of


def test_arms_of_pr2_and_baxter_are_mirror_images() -> None:
    baxter = ARMS["baxter"]
    joints = [joint.replace("left", "right") for joint in baxter.joints]
    right = read_chain(baxter.urdf, baxter.root, "right_gripper_base_link", joints)
    pairs = [(ARMS["pr2, left"].chain, ARMS["pr2, right"].chain), (baxter.chain, right)]
    for first, second in pairs:
        mirror = mirror_of(first, second)
        assert mirror is not None
        np.testing.assert_array_equal(mirror.signs, [-1, 1, -1, 1, -1, 1, -1])
        assert mirror.error < 1e-9


def test_a_longer_arm_is_seen() -> None:
    left, right = ARMS["pr2, left"].chain, ARMS["pr2, right"].chain
    longer = replace(right, position=right.position + np.array([0.01, 0, 0]))
    mirror = mirror_of(left, longer)
    assert mirror is not None
    assert 0.009 < mirror.error < 0.011


def test_arms_of_different_make_do_not_correspond() -> None:
    assert mirror_of(ARMS["pr2, left"].chain, ARMS["panda"].chain) is None
    assert mirror_of(ARMS["pr2, left"].chain, ARMS["ur5"].chain) is None
