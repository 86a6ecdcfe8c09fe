"""Keyframes that are certified: PyBullet, asked all the same, finds nothing in them."""

from unittest.mock import Mock

import numpy as np
import pytest
from motions import SIZE, scene

from guided_lgp.bounds.coarse import CoarseBound
from guided_lgp.bounds.collision import certificate
from guided_lgp.bounds.results import Keyframe
from guided_lgp.bounds.verify import Violation, keyframes, verify_keyframe
from guided_lgp.bounds.verify.certified import KeyframeCertificate, Moment
from guided_lgp.logic import Action, State, parse_skeleton, successor
from guided_lgp.scene import Box, PlacedRobot, Scene, Table
from guided_lgp.scene.world import World

Moments = list[tuple[Keyframe, State, Action | None]]

PR2_SCENE = scene(
    red=(0.5, 0.3, 0.65, 0.4, "tab1"),
    green=(0.5, -0.3, 0.65, 0.0, "tab2"),
    blue=(0.6, 0.45, 0.65, -0.6, "tab1"),
)
PANDA_SCENE = Scene(
    tables=(Table(name="tab1", position=(0.5, 0.0, 0.2), half_extents=(0.2, 0.3)),),
    boxes=(
        Box(name="red", size=SIZE, position=(0.5, 0.1, 0.25), yaw=0.0, on="tab1"),
        Box(name="blue", size=SIZE, position=(0.45, -0.15, 0.25), yaw=0.4, on="tab1"),
    ),
    robot=PlacedRobot(model="panda"),
)
CASES = {
    "pr2": (
        PR2_SCENE,
        "(grasp pr2L red) (grasp pr2R green) (place pr2L red blue) (place pr2R green tab2)",
    ),
    "panda": (PANDA_SCENE, "(grasp panda red) (place panda red blue)"),
}
"""Scenes, and what is done in them."""


def solved(placed: Scene, words: str) -> Moments:
    """All keyframes of a coarse solution."""
    result = CoarseBound(placed, 12).solve(parse_skeleton(words))
    assert result.feasible
    found: Moments = []
    state = placed.state
    for action, switch, after in zip(
        result.skeleton, result.at_switch, result.after_action, strict=True
    ):
        found.append((switch, state, action))
        state = successor(state, action)
        found.append((after, state, None))
    return found


def disturbed(moments: Moments, count: int) -> Moments:
    """Some of them, with the arms somewhere else, by a little or by much, or a box by a little."""
    rng = np.random.default_rng(1)
    found: Moments = []
    for number in rng.integers(len(moments), size=count):
        frame, state, action = moments[number]
        q, boxes = frame.q.copy(), dict(frame.boxes)
        if rng.random() < 0.8:
            q += 10 ** rng.uniform(-3, 0) * rng.normal(size=q.shape)
        if rng.random() < 0.5:
            name = rng.choice(sorted(boxes))
            boxes[name] = boxes[name].copy()
            boxes[name][:3] += 10 ** rng.uniform(-3, -1) * rng.normal(size=3)
        found.append((Keyframe(q, boxes), state, action))
    return found


@pytest.mark.parametrize("case", CASES)
def test_verification_says_the_same_with_and_without(
    case: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    placed, words = CASES[case]
    given = solved(placed, words)
    moments = [*given, *disturbed(given, 600)]
    cleared: list[bool] = []
    clear = KeyframeCertificate.clear

    def remembered(self: KeyframeCertificate, those: list[Moment]) -> list[bool]:
        cleared.extend(found := clear(self, those))
        return found

    with World(placed) as world:
        monkeypatch.setattr(KeyframeCertificate, "clear", remembered)
        certified = [verify_keyframe(world, *moment) for moment in moments]
        monkeypatch.setattr(KeyframeCertificate, "clear", nothing)
        judged = [verify_keyframe(world, *moment) for moment in moments]
    assert certified == judged
    free = [not any(map(is_collision, found)) for found in judged]
    assert not all(free)
    assert sum(cleared) >= 0.8 * sum(free)  # or the certificate saves little


def nothing(self: KeyframeCertificate, those: list[Moment]) -> list[bool]:
    return [False] * len(those)


def is_collision(found: Violation) -> bool:
    return found.constraint.split()[0] in {"clear", "apart", "beside"}


def test_what_is_certified_is_not_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    given = solved(*CASES["pr2"])
    with World(PR2_SCENE) as world:
        monkeypatch.setattr(world, "penetrations", lambda *_, **__: pytest.fail("looked at"))
        assert verify_keyframe(world, *given[-1]) == []


def test_without_a_compiler_pybullet_judges_all(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(certificate, "_library", lambda lanes: None)
    given = solved(*CASES["pr2"])
    keyframes._site.cache_clear()
    with World(PR2_SCENE) as world:
        looked = Mock(wraps=world.penetrations)
        monkeypatch.setattr(world, "penetrations", looked)
        assert not any(verify_keyframe(world, *moment) for moment in given)
    assert looked.call_count == len(given)
