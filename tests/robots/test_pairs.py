"""Pairs of links that are not checked, against the descriptions and by fresh samples."""

from pathlib import Path

import numpy as np
import pytest
from descriptions import ARMS, description

from guided_lgp.errors import InputError
from guided_lgp.robots.chain import read_joints
from guided_lgp.robots.pairs import sampled_pairs, stated_pairs

_PANDA = ARMS["panda"]
_SRDF = "panda_description/srdf/panda.srdf"


def links() -> set[str]:
    return {link for j in read_joints(_PANDA.urdf).values() for link in (j.parent, j.child)}


def test_sampled_pairs_are_nearly_those_of_the_srdf() -> None:
    limits = {
        name: (float(low), float(high))
        for name, (low, high) in zip(_PANDA.joints, _PANDA.limits(), strict=True)
    }
    sampled = sampled_pairs(_PANDA.urdf, limits)
    stated = stated_pairs(description(_SRDF), links())
    assert sampled == sampled_pairs(_PANDA.urdf, limits)
    fingers = {"panda_leftfinger", "panda_rightfinger"}
    assert {pair for pair in sampled - stated if not pair & fingers} == set()
    assert len(stated - sampled) <= 2
    assert frozenset(("panda_link0", "panda_hand")) not in sampled  # the hand reaches its base
    assert frozenset(("panda_link3", "panda_link4")) in sampled  # neighbours


def test_an_unknown_link_is_named(tmp_path: Path) -> None:
    file = tmp_path / "robot.srdf"
    file.write_text('<robot name="r"><disable_collisions link1="panda_hand" link2="tail"/></robot>')
    with pytest.raises(InputError, match=r"robot.srdf: unknown link tail"):
        stated_pairs(file, links())
    with pytest.raises(InputError, match="not a readable SRDF"):
        stated_pairs(tmp_path / "none.srdf", links())
    assert np.all([len(pair) == 2 for pair in stated_pairs(description(_SRDF), links())])
